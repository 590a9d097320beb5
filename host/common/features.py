"""Find the features: capabilities beside the core, each registered by an entry point of the group `steptwin.features`.

The core imports no feature and knows none by name. Where a feature may add something, the core asks here who gives it.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from re import Pattern
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Protocol

from steptwin.host.common.file_limits import PROGRAM_BYTES_MAX

if TYPE_CHECKING:
    from steptwin.controller.motion.backend import Kernel
    from steptwin.emulator.board.board_firmware import BoardProgram
    from steptwin.emulator.operations import Operation
    from steptwin.emulator.simulation import Participant, Simulation
    from steptwin.host.cli.arguments import CheckedFile
    from steptwin.host.common.errors import BusError
    from steptwin.host.common.findings import Findings
    from steptwin.host.common.tables import Reading, Table
    from steptwin.host.planning.drives import DriveLimits
    from steptwin.host.planning.jobs.job import Job
    from steptwin.host.planning.motions.whole import MotionTimer
    from steptwin.host.planning.plan import HighestSpeed, Plan
    from steptwin.host.planning.programs.program_file import StepReading
    from steptwin.host.planning.trajectory import Trajectory
    from steptwin.host.robots.kinematics.kinds import Kind
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
    from steptwin.host.twin.embedded.embedded_network import EmbeddedNetwork
    from steptwin.host.twin.embedded.outcome import RunEnd, RunFault, RunVerdict
    from steptwin.host.twin.live.live_board import LiveBoard
    from steptwin.host.twin.machine.emulated_machine import EmulatedMachine
    from steptwin.host.twin.machine.machine_options import MachineOptions
    from steptwin.host.verify.comparison import Comparison
    from steptwin.protocol.drivers import DriverProfile

GROUP: Final = "steptwin.features"


class RobotSection(Protocol):
    """A feature's table of a robot file, as it has been read."""

    def check(self, robot: "Robot") -> None:
        """Raise InputError for what the table names and the robot does not have."""
        ...


class MachinePart:
    """A feature's part of one emulated machine, from power-up on; it overrides what concerns it.

    `EmulatedMachine` calls `join` and `switched_on`; `EmbeddedBoard`, which is in virtual time, and its runs `network`,
    `outlive` and `verdict`; `LiveBoard`, which is in real time, `check_live` and `end_round`. The feature's judge is
    given `evidence`, in a live report `seen`; reports without a judgement have `document` and `in_words`.
    """

    def join(self, simulation: "Simulation") -> "Participant | None":
        """Return its participant of a simulation whose boards have no power yet; None if it has none."""

    def switched_on(self, machine: "EmulatedMachine") -> None:
        """Begin: the boards have just been switched on; raise InputError for what the machine does not have."""

    def check_live(self) -> None:
        """Raise InputError for what cannot happen to a board in real time, whose hosts are programs of their own."""

    def network(self) -> "EmbeddedNetwork | None":
        """Return the network by which a host in this process is connected to the bus; None for the usual one."""

    def outlive(self, board: "EmbeddedBoard", error: "BusError") -> "RunFault | None":
        """Let a machine in motion go on without its host, if the part has ended that; return how the run has ended."""

    def evidence(self) -> Any:
        """Look now; return what has happened since power-up; None for nothing, or if a run's end decides."""

    def seen(self) -> Any:
        """Return what has happened up to the last look; None for nothing."""

    def settled(self, last_counts: int) -> Any:
        """Return what shows only some time after a run's last edge, which was at an instant; None if nothing does.

        Boards and bus stand still meanwhile. What another feature has done to the run does not excuse what it shows.
        """

    def end_round(self) -> None:
        """Forget what a board that is served for months need not remember."""

    def described(self) -> Sequence[str]:
        """Return a line for each thing that the machine of a served board has besides its boards."""
        return ()

    def state(self) -> Mapping[str, Any]:
        """Return what a control port tells of it at any time, under keys of its own."""
        return {}

    def document(self) -> Mapping[str, Any]:
        """Return what has happened so far under keys of report.json, without a judgement."""
        return {}

    def in_words(self) -> str:
        """Return what has happened so far in lines, for the report of a failed test; empty if there is nothing."""
        return ""

    def verdict(self, end: "RunEnd") -> "RunVerdict | None":
        """Judge a run that ends now by what the part has done to it; None if it has done nothing."""


class FeatureJudge(Protocol):
    """Judges a feature's evidence; `expected` is what `Feature.expected` has returned, None if that is nothing."""

    def reasons(self, evidence: Any, expected: Any, start_counts: int) -> list[str]:
        """Return one line for each reason to fail the run; `start_counts` is the motion's t = 0."""
        ...

    def document(self, evidence: Any, start_counts: int) -> dict[str, Any]:
        """Return what stands under the feature's name in report.json; times are the trajectory's."""
        ...

    def contradictions(self, evidence: Any, comparison: "Comparison") -> Iterable[str]:
        """Yield one line for each statement of stored evidence that the drivers' counts contradict."""
        ...

    def stored(self, evidence: Any, expected: Any, start_counts: int) -> dict[str, Any]:
        """Return what the file NAME.json of a run folder holds."""
        ...

    def read(self, table: "Table") -> tuple[Any, Any]:
        """Return evidence and expectation from that file; raise InputError for what is wrong in it."""
        ...


class LiveWords(Protocol):
    """What a feature says of a served board on which it has a part."""

    def banner(self) -> str:
        """Return what the machine has besides, in words; empty for nothing."""
        ...

    def warnings(self, seen: Any) -> Iterable[str]:
        """Return what is to be told while the board runs, each line once, from what the part has seen."""
        ...

    def print_report(self, document: Mapping[str, Any]) -> None:
        """Print the feature's part of the board's final report."""
        ...


class DriveModel(Protocol):
    """What a feature knows of a machine's drives beside the limits of its joints."""

    def limits(self, robot: "Robot", left_percent: float) -> "DriveLimits":
        """Return what limits fastest motions, so that some percent of the drives' torque are left.

        Raises:
            InputError: the robot's file does not describe its drives.
        """
        ...

    def forecast(self, robot: "Robot", motion: "Trajectory") -> str | None:
        """Return what to say of a motion before it runs that nobody has limited by the drives; None for nothing."""
        ...

    def highest_speed(self, plan: "Plan", percent: int) -> "HighestSpeed | None":
        """Return the highest speed up to a percentage that the drives hold; None if they are not described."""


class ControlRequests(Protocol):
    """A feature's requests of the control port, by which programs operate the machine of a served board."""

    @property
    def names(self) -> Sequence[str]:
        """The values of their key `do`, in the order of help and docs."""
        ...

    def answer(self, board: "LiveBoard", request: Mapping[str, Any]) -> Mapping[str, Any]:
        """Do what is requested; return what is told beside the machine's state.

        Raises:
            InputError: the request has other keys or values, or the machine lacks what it concerns.
        """
        ...

    def written(self, robot: "Robot", operation: "Operation") -> Mapping[str, Any] | None:
        """Return the request that asks for an operation; None if there is none."""
        ...


class FileKind(NamedTuple):
    """A kind of file that `steptwin check` knows.

    Attributes:
        name: what it is, in a word.
        keys: keys by which it is known: a file of this kind has any of them.
        check: checks a text, from the file's path, the text, the robot given, and the list for what is wrong.
        bytes_max: greatest length.
        mark: what the text of a file has that may be longer than a program; None if none may.
    """

    name: str
    keys: Sequence[str]
    check: "Callable[[str, str, str | None, Findings], CheckedFile]"
    bytes_max: int = PROGRAM_BYTES_MAX
    mark: Pattern[str] | None = None


class Telling(Protocol):
    """Prints what a feature's keys of a document say; of a document without them it prints nothing."""

    def print_run(self, document: Mapping[str, Any]) -> None:
        """Print it for a run in virtual time."""
        ...

    def print_served(self, document: Mapping[str, Any]) -> None:
        """Print it for a served board."""
        ...

    def served_failure(self, document: Mapping[str, Any]) -> str:
        """Return why a served board's end is no success; empty if it is one."""
        ...


COMMAND_GROUPS: Final = ("Robots and maths", "Run and verify", "Live board", "Files and tools")
"""Titles of the groups of commands in `steptwin --help`."""


class CommandRow(NamedTuple):
    """A command of the command line, whose module is imported when it is called.

    Attributes:
        name: its name.
        group: one of `COMMAND_GROUPS`.
        help: its line in `steptwin --help`: the summary of its docstring.
        module: the module with its function, which has the command's name, with `_` for `-`.
        usual: False for one that `steptwin --help` lists by its name alone: it shows at most ten a group.
    """

    name: str
    group: str
    help: str
    module: str
    usual: bool = True


MakePart = Callable[["Robot", Sequence[float], Sequence[int], Any, Collection[str] | None], MachinePart | None]
"""Makes a feature's part of one emulated machine; `Feature` says of what."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Feature:
    """A capability beside the core. All but the name may be left out; functions import what they need when called.

    Attributes:
        name: name of the feature, of its table in robot files, of its key in report.json, of its file in run folders.
        needs: the features that it imports.
        section: reads its table of a robot file.
        robot_tables: returns tables that belong to the file of a robot that StepTwin brings, by the robot's name.
        timer: returns what times motions as a whole: those with `law = "fastest"` or `blend_mm`.
        program_steps: returns what reads its steps of program files, by their verbs.
        program_keys: reads its keys of program files; the values become the trajectory's `expects`.
        check_program: raises InputError for such a value, by its key, that a robot cannot fulfil.
        kinematics: returns its kinds of mechanisms, by name; one that has the name of another kind replaces it.
        jobs: returns its jobs, by the kind of mechanism; one that has the name of another job replaces it.
        job_extra: returns its options of an emulated machine for a job's intent; None if the intent is not its own.
        check_robot: returns warnings about a robot, for `steptwin check`.
        check_travel: raises InputError if something is in the way of a straight move of all joints.
        check_machine: raises InputError if its options (None: not given) do not go with the other ones of a machine,
            in real time or not.
        machine_warnings: returns warnings about a machine before it is operated, from robot, drivers and options.
        machine_options: returns the class of its options of an emulated machine: a frozen dataclass whose fields have
            spellings, with a method `over` as that of `MachineOptions`.
        read_options: returns such options with the files read that they name, from options, robot and the folder where
            relative paths begin; raises InputError for what is wrong in them.
        replayed: returns such options from a stored report; None if the run had none.
        kernels: returns what makes its forms of the firmware's kernel, by name; they raise InputError if they cannot.
        program: returns what makes the program that each board of a machine runs instead of our firmware, from its
            options; None if there is none.
        part: returns its part of a machine from robot, joints at power-up, axes of each board, options and the inputs
            for which the motion waits (None: unknown); None if the machine has no such part.
        expected: returns what a motion is planned to leave, from robot, trajectory and options; None for nothing.
        judge: returns the judge of its evidence.
        live: returns what it says of a served board.
        drive_model: returns what it knows of drives, for planning; the first feature that has one is asked.
        requests: returns its requests of the control port.
        file_kinds: returns the kinds of its files for `steptwin check`.
        run_options: returns a dataclass of options of `steptwin run`: a `RunHook`.
        serve_options: returns a dataclass of options of `steptwin serve`: a `ServedProgram`.
        verify_options: returns a dataclass of options of `steptwin verify`: an `OtherEvidence`.
        new_options: returns a dataclass of options of `steptwin new`: a `RobotSource`.
        telling: returns what prints its keys of documents.
        report_lines: returns lines of text for its part of a run's document.
        commands: its commands.
    """

    name: str
    needs: Sequence[str] = ()
    section: "Reading | None" = None
    robot_tables: Callable[[str], str] | None = None
    timer: "Callable[[], MotionTimer] | None" = None
    program_steps: "Callable[[], Mapping[str, StepReading]] | None" = None
    program_keys: "Mapping[str, Reading]" = field(default_factory=dict)
    check_program: "Callable[[Robot, str, Any], None] | None" = None
    kinematics: "Callable[[], Mapping[str, Kind]] | None" = None
    jobs: "Callable[[], Mapping[str, Sequence[Job[Any]]]] | None" = None
    job_extra: "Callable[[Robot, Any], Any] | None" = None
    check_robot: "Callable[[Robot], Iterable[str]] | None" = None
    check_travel: "Callable[[Robot, Sequence[float], Sequence[float]], None] | None" = None
    check_machine: "Callable[[MachineOptions, Any, bool], None] | None" = None
    machine_warnings: "Callable[[Robot, DriverProfile, Any], Iterable[str]] | None" = None
    machine_options: Callable[[], type[Any]] | None = None
    read_options: "Callable[[Any, Robot, Path], Any] | None" = None
    replayed: "Callable[[Table], Any] | None" = None
    kernels: "Callable[[], Mapping[str, Callable[[], Kernel]]] | None" = None
    program: "Callable[[Any], Callable[[], BoardProgram] | None] | None" = None
    part: MakePart | None = None
    expected: "Callable[[Robot, Trajectory, Any], Any] | None" = None
    judge: "Callable[[], FeatureJudge] | None" = None
    live: Callable[[], LiveWords] | None = None
    drive_model: Callable[[], DriveModel] | None = None
    requests: Callable[[], ControlRequests] | None = None
    file_kinds: Callable[[], Sequence[FileKind]] | None = None
    run_options: Callable[[], type[Any]] | None = None
    serve_options: Callable[[], type[Any]] | None = None
    verify_options: Callable[[], type[Any]] | None = None
    new_options: Callable[[], type[Any]] | None = None
    telling: Callable[[], Telling] | None = None
    report_lines: Callable[[Mapping[str, Any]], Iterable[str]] | None = None
    commands: Sequence[CommandRow] = ()

    def options_in(self, extras: Sequence[object]) -> Any:
        """Return this feature's options among those of all features; None if they are not there."""
        made = None if self.machine_options is None else self.machine_options()
        return next((each for each in extras if made is not None and isinstance(each, made)), None)


@cache
def registered() -> tuple[Mapping[str, Feature], Mapping[str, str]]:
    """Return the features, and why others cannot be loaded, both by name and in the order of their names."""
    found: dict[str, Feature] = {}
    broken: dict[str, str] = {}
    for point in sorted(entry_points(group=GROUP), key=lambda each: each.name):
        try:
            found[point.name] = point.load()
        except Exception as error:
            broken[point.name] = f"feature {point.name} of {_origin(point)} cannot be loaded: {error}; install it again"
    while name := next((name for name, each in found.items() if not set(each.needs) <= found.keys()), None):
        missing = ", ".join(sorted(set(found.pop(name).needs) - found.keys()))
        broken[name] = f"feature {name} needs the feature {missing}, which is not there"
    return found, broken


def _origin(point: EntryPoint) -> str:
    return f"{point.dist.name} {point.dist.version}" if point.dist else point.value


def features() -> Mapping[str, Feature]:
    """Return the features that are installed, by name."""
    return registered()[0]


def broken_features() -> Mapping[str, str]:
    """Return why a registered feature cannot be loaded, in a sentence, by its name."""
    return registered()[1]


def giving(attribute: str) -> list[tuple[Feature, Any]]:
    """Return each feature that has an attribute, with the attribute."""
    return [(each, given) for each in features().values() if (given := getattr(each, attribute)) is not None]


def judge_of(name: str) -> FeatureJudge:
    """Return the judge of a feature that has evidence."""
    make = features()[name].judge
    assert make is not None
    return make()


def drive_model() -> DriveModel | None:
    """Return what is known of machines' drives; None if no feature knows any."""
    return next((make() for _, make in giving("drive_model")), None)
