"""Find the features: capabilities beside the core, each registered by an entry point of the group `steptwin.features`.

The core imports no feature and knows none by name. Where a feature may add something, the core asks here who gives it.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
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
    from steptwin.host.common.tables import Table
    from steptwin.host.planning.drives import DriveLimits
    from steptwin.host.planning.jobs.job import Job
    from steptwin.host.planning.motion import Motion
    from steptwin.host.planning.motions.whole import MotionTimer
    from steptwin.host.planning.plan import HighestSpeed, Plan
    from steptwin.host.robots.kinematics.kinds import Kind
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
    from steptwin.host.twin.embedded.embedded_network import EmbeddedNetwork
    from steptwin.host.twin.embedded.outcome import RunEnd, RunFault, RunVerdict
    from steptwin.host.twin.live.live_board import LiveBoard
    from steptwin.host.twin.machine.emulated_machine import EmulatedMachine
    from steptwin.host.twin.machine.machine_options import MachineOptions
    from steptwin.host.verify.comparison import Comparison
    from steptwin.host.verify.figures import ReportFigure, SeenAxis
    from steptwin.protocol.drivers import DriverProfile
    from steptwin.protocol.object_view import ObjectView

GROUP: Final = "steptwin.features"


class RobotSection(Protocol):
    """A feature's table of a robot file, as it has been read."""

    def check(self, robot: "Robot") -> None:
        """Raise InputError for what the table names and the robot does not have."""
        ...


class MachinePart:
    """A feature's part of one emulated machine, from power-up on; it overrides what concerns it.

    `EmulatedMachine` calls `join` and `switched_on`; `EmbeddedBoard`, which is in virtual time, and its runs `network`,
    `outlive` and `verdict`; `LiveBoard`, which is in real time, `check_live`, `end_round` and `close`. The feature's
    judge is given `evidence`, in a live report `seen`; reports without a judgement have `document` and `in_words`.
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
        """Continue a machine in motion without its host, if the part has ended the host; return the end of the run."""

    def evidence(self) -> Any:
        """Return the evidence since power-up; None if there is none, or if it is complete only at a run's end."""

    def seen(self) -> Any:
        """Return the evidence up to the last call of `evidence`; None if there is none."""

    def settled(self, last_counts: int) -> Any:
        """Return evidence that is complete only some time after a run's last edge; None if there is none.

        Boards and bus do not change meanwhile. An effect of another feature on the run does not excuse this evidence.
        """

    def end_round(self) -> None:
        """Drop old data, so a board that is served for months needs bounded memory."""

    def close(self) -> None:
        """Release sockets and the like at the end of a board in real time."""

    def described(self) -> Sequence[str]:
        """Return one line for each further device in the machine of a served board."""
        return ()

    def state(self) -> Mapping[str, Any]:
        """Return its state for a control port, under its own keys."""
        return {}

    def document(self) -> Mapping[str, Any]:
        """Return the evidence so far under keys of report.json, without a judgement."""
        return {}

    def in_words(self) -> str:
        """Return the evidence so far as text lines, for the report of a failed test; empty if there is none."""
        return ""

    def verdict(self, end: "RunEnd") -> "RunVerdict | None":
        """Judge a run at its end by the effects of the part on it; None if it had none."""


class FeatureJudge(Protocol):
    """Judges a feature's evidence; `expected` is the result of `Feature.expected`, or None."""

    def reasons(self, evidence: Any, expected: Any, start_counts: int) -> list[str]:
        """Return one line for each reason to fail the run; `start_counts` is the motion's t = 0."""
        ...

    def document(self, evidence: Any, start_counts: int) -> dict[str, Any]:
        """Return the value under the feature's name in report.json; times are trajectory times."""
        ...

    def contradictions(self, evidence: Any, comparison: "Comparison") -> Iterable[str]:
        """Yield one line for each statement of stored evidence that the drivers' counts contradict."""
        ...

    def stored(self, evidence: Any, expected: Any, start_counts: int) -> dict[str, Any]:
        """Return the content of the file NAME.json in a run folder."""
        ...

    def read(self, table: "Table") -> tuple[Any, Any]:
        """Return evidence and expectation from NAME.json; raise InputError for errors in it."""
        ...


class LiveWords(Protocol):
    """A feature's texts about a served board on which it has a part."""

    def banner(self) -> str:
        """Return a description of the feature's part of the machine; empty for none."""
        ...

    def warnings(self, seen: Any) -> Iterable[str]:
        """Return warnings while the board runs, each line once, from the part's evidence."""
        ...

    def print_report(self, document: Mapping[str, Any]) -> None:
        """Print the feature's part of the board's final report."""
        ...


class DriveModel(Protocol):
    """A feature's model of a machine's drives, in addition to the joints' limits."""

    @property
    def name(self) -> str:
        """Key of its results in JSON documents."""
        ...

    def limits(self, robot: "Robot", left_percent: float) -> "DriveLimits":
        """Return the limits of fastest motions that leave `left_percent` of the drives' torque.

        Raises:
            InputError: the robot's file does not describe its drives.
        """
        ...

    def forecast(self, robot: "Robot", motion: "Motion") -> str | None:
        """Return a warning about a motion, not planned with the drives' limits, before it runs; None for none."""
        ...

    def highest_speed(self, plan: "Plan", percent: int) -> "HighestSpeed | None":
        """Return the highest speed, up to a percentage, that the drives allow; None if they are not described."""


class ChangedMotion(NamedTuple):
    """A motion that a feature has changed before it is checked.

    Attributes:
        motion: the motion to execute.
        later_s: converts a time of the motion before the change.
        described: returns what has changed, as one line.
    """

    motion: "Motion"
    later_s: Callable[[float], float]
    described: Callable[[], str]


class ControlRequests(Protocol):
    """A feature's requests of the control port of a served board."""

    @property
    def names(self) -> Sequence[str]:
        """Values of their key `do`, in the order of help and docs."""
        ...

    def answer(self, board: "LiveBoard", request: Mapping[str, Any]) -> Mapping[str, Any]:
        """Execute a request; return its answer in addition to the machine's state.

        Raises:
            InputError: the request has unknown keys or invalid values, or the machine lacks its target.
        """
        ...

    def written(self, robot: "Robot", operation: "Operation") -> Mapping[str, Any] | None:
        """Return the request for an operation; None if there is none."""
        ...


class FileKind(NamedTuple):
    """A kind of file that `steptwin check` supports.

    Attributes:
        name: name of the kind.
        keys: keys that identify it: a file of this kind has at least one of them.
        check: checks a file, from its path, its text, the given robot, and the list of errors.
        bytes_max: largest size.
        mark: pattern in the text of a file that may be larger than a program; None if no file may.
    """

    name: str
    keys: Sequence[str]
    check: "Callable[[str, str, str | None, Findings], CheckedFile]"
    bytes_max: int = PROGRAM_BYTES_MAX
    mark: Pattern[str] | None = None


class FileOptions(Protocol):
    """A feature's options of commands for the files that its steps run: a dataclass."""

    def keys(self, file: str) -> Mapping[str, str]:
        """Return keys of the step that runs a file, as texts of TOML or without quotation marks.

        Raises:
            InputError: an option is given for a file of another kind.
        """
        ...


class Telling(Protocol):
    """Prints a feature's keys of a document; nothing for a document without them."""

    def print_run(self, document: Mapping[str, Any]) -> None:
        """Print the keys of a run in virtual time."""
        ...

    def print_served(self, document: Mapping[str, Any]) -> None:
        """Print the keys of a served board."""
        ...

    def print_verified(self, document: Mapping[str, Any]) -> None:
        """Print it for a stored run that was verified again."""
        ...

    def kept(self, report: "Table") -> Mapping[str, Any]:
        """Return what verifying a stored run again keeps of its report, by key; raise InputError for what is wrong."""
        ...

    def served_failure(self, document: Mapping[str, Any]) -> str:
        """Return the reason why a served board has failed; empty for success."""
        ...


COMMAND_GROUPS: Final = ("Robots and maths", "Run and verify", "Live board", "Files and tools")
"""Titles of the groups of commands in `steptwin --help`."""


class CommandRow(NamedTuple):
    """A command of the command line; its module is imported when it is called.

    Attributes:
        name: name of the command.
        group: one of `COMMAND_GROUPS`.
        help: its line in `steptwin --help`: the summary of its docstring.
        module: module of its function, which has the command's name, with `_` for `-`.
        usual: False if `steptwin --help` lists only its name, because each group shows at most ten commands.
    """

    name: str
    group: str
    help: str
    module: str
    usual: bool = True


MakePart = Callable[["Robot", Sequence[float], Sequence[int], Any, Collection[str] | None], MachinePart | None]
"""Creates a feature's part of one emulated machine; see `Feature.part` for the arguments."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Feature:
    """A capability beside the core. All but the name may be left out; functions import what they need when called.

    Attributes:
        name: name of the feature, of its table in robot files, of its key in report.json, of its file in run folders.
        needs: the features that it imports.
        section: returns the model of its table of a robot file: a `FileTable` that is a `RobotSection`.
        robots: the folder of the robot files that it brings.
        joint_tables: returns the models of its tables of a joint in robot files, `FileTable`s, by name; what is read
            stands in `Joint.tables`.
        robot_tables: returns tables that belong to the file of a robot that StepTwin brings, by the robot's name.
        timer: returns what times motions as a whole: those with `law = "fastest"` or `blend_mm`.
        program_steps: returns the models of its steps of program files, `StepTable`s, by their verbs.
        program_keys: returns the types of its keys of program files; the values become the motion's `expects`.
        check_program: raises InputError for such a value, by its key, that a robot cannot fulfil.
        kinematics: returns its kinds of mechanisms, by name; one that has the name of another kind replaces it.
        jobs: returns its jobs, by the kind of mechanism; of two with one name that of the later feature counts.
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
        object_view: returns the objects that boards with our firmware show on the bus in place of its own, from robot
            and options; None for its own.
        part: returns its part of a machine from robot, joints at power-up, axes of each board, options and the inputs
            for which the motion waits (None: unknown); None if the machine has no such part.
        change_motion: returns a motion changed before it is checked, from robot and motion; None to leave it as it is.
            The first feature that changes it is the only one.
        expected: returns what a motion is planned to leave, from robot, motion and options; None for nothing.
        judge: returns the judge of its evidence.
        figures: returns its figures of an axis, by key: they stand in its part of report.json under `axes`, and have
            columns and limits as those of the core.
        live: returns what it says of a served board.
        drive_model: returns what it knows of drives, for planning; the first feature that has one is asked.
        requests: returns its requests of the control port.
        file_kinds: returns the kinds of its files for `steptwin check`.
        schemas: returns what gives the model of each kind of its files, by the kind, for `steptwin schema`.
        run_options: returns a dataclass of options of `steptwin run`: a `RunHook`.
        serve_options: returns a dataclass of options of `steptwin serve`: a `ServedProgram`.
        file_options: returns a dataclass of options of `steptwin run` and `check`: `FileOptions`.
        verify_options: returns a dataclass of options of `steptwin verify`: an `OtherEvidence`.
        new_options: returns a dataclass of options of `steptwin new`: a `RobotSource`.
        telling: returns what prints its keys of documents.
        report_lines: returns lines of text for its part of a run's document.
        commands: its commands.
    """

    name: str
    needs: Sequence[str] = ()
    section: Callable[[], type[Any]] | None = None
    robots: Path | None = None
    joint_tables: Callable[[], Mapping[str, type[Any]]] | None = None
    robot_tables: Callable[[str], str] | None = None
    timer: "Callable[[], MotionTimer] | None" = None
    program_steps: "Callable[[], Mapping[str, Any]] | None" = None
    program_keys: Callable[[], Mapping[str, Any]] | None = None
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
    object_view: "Callable[[Robot, Any], ObjectView | None] | None" = None
    part: MakePart | None = None
    change_motion: "Callable[[Robot, Motion], ChangedMotion | None] | None" = None
    expected: "Callable[[Robot, Motion, Any], Any] | None" = None
    judge: "Callable[[], FeatureJudge] | None" = None
    figures: "Callable[[], Mapping[str, ReportFigure[SeenAxis]]] | None" = None
    live: Callable[[], LiveWords] | None = None
    drive_model: Callable[[], DriveModel] | None = None
    requests: Callable[[], ControlRequests] | None = None
    file_kinds: Callable[[], Sequence[FileKind]] | None = None
    schemas: Callable[[], Mapping[str, Callable[[], type[Any]]]] | None = None
    run_options: Callable[[], type[Any]] | None = None
    serve_options: Callable[[], type[Any]] | None = None
    file_options: Callable[[], type[Any]] | None = None
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
    """Return the features, and the reasons why others cannot be loaded, both by name in alphabetical order."""
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
    """Return the installed features by name."""
    return registered()[0]


def broken_features() -> Mapping[str, str]:
    """Return the reasons why registered features cannot be loaded, by name."""
    return registered()[1]


def giving(attribute: str) -> list[tuple[Feature, Any]]:
    """Return all features that have an attribute, with its value."""
    return [(each, given) for each in features().values() if (given := getattr(each, attribute)) is not None]


def judge_of(name: str) -> FeatureJudge:
    """Return the judge of a feature that has evidence."""
    make = features()[name].judge
    assert make is not None
    return make()


def changed_motion(robot: "Robot", motion: "Motion") -> ChangedMotion | None:
    """Return a motion as a feature changes it before it is checked; None if it stays as it is."""
    return next((made for _, change in giving("change_motion") if (made := change(robot, motion))), None)


def drive_model() -> DriveModel | None:
    """Return the model of machines' drives; None if no feature has one."""
    return next((make() for _, make in giving("drive_model")), None)
