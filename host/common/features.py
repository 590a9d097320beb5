"""Find the features: capabilities beside the core, each registered by an entry point of the group `steptwin.features`.

The core imports no feature and knows none by name. Where a feature may add something, the core asks here who gives it.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Protocol

if TYPE_CHECKING:
    from steptwin.controller.motion.backend import Kernel
    from steptwin.emulator.simulation import Participant, Simulation
    from steptwin.host.common.tables import Reading, Table
    from steptwin.host.planning.drives import DriveLimits
    from steptwin.host.planning.jobs.job import Job
    from steptwin.host.planning.motions.whole import MotionTimer
    from steptwin.host.planning.plan import HighestSpeed, Plan
    from steptwin.host.planning.programs.program_file import StepReading
    from steptwin.host.planning.trajectory import Trajectory
    from steptwin.host.robots.kinematics.kinds import Kind
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.machine.machine_options import MachineOptions
    from steptwin.host.verify.comparison import Comparison
    from steptwin.protocol.drivers import DriverProfile

GROUP: Final = "steptwin.features"


class RobotSection(Protocol):
    """A feature's table of a robot file, as it has been read."""

    def check(self, robot: "Robot") -> None:
        """Raise InputError for what the table names and the robot does not have."""
        ...


class MachinePart(Protocol):
    """A feature's part of one emulated machine, from power-up on."""

    def join(self, simulation: "Simulation") -> "Participant":
        """Return its participant of a simulation whose boards have no power yet."""
        ...

    def evidence(self) -> Any:
        """Look now; return what has happened since power-up; None if that is judged only when a run has ended."""
        ...

    def seen(self) -> Any:
        """Return what has happened up to the last look."""
        ...

    def settled(self, last_counts: int) -> Any:
        """Return what shows only some time after a run's last edge, which was at an instant; None if nothing does.

        Boards and bus stand still meanwhile. No scenario of faults excuses what it shows.
        """
        ...

    def end_round(self) -> None:
        """Forget what a board that is served for months need not remember."""
        ...


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
    """

    name: str
    group: str
    help: str
    module: str


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
        replayed: returns such options from a stored report; None if the run had none.
        kernels: returns what makes its forms of the firmware's kernel, by name; they raise InputError if they cannot.
        part: returns its part of a machine from robot, joints at power-up, axes of each board, options and the inputs
            for which the motion waits (None: unknown); None if the machine has no such part.
        expected: returns what a motion is planned to leave, from robot, trajectory and options; None for nothing.
        judge: returns the judge of its evidence.
        live: returns what it says of a served board.
        drive_model: returns what it knows of drives, for planning; the first feature that has one is asked.
        run_options: returns a dataclass of options of `steptwin run`: a `RunHook`.
        verify_options: returns a dataclass of options of `steptwin verify`: an `OtherEvidence`.
        new_options: returns a dataclass of options of `steptwin new`: a `RobotSource`.
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
    replayed: "Callable[[Table], Any] | None" = None
    kernels: "Callable[[], Mapping[str, Callable[[], Kernel]]] | None" = None
    part: MakePart | None = None
    expected: "Callable[[Robot, Trajectory, Any], Any] | None" = None
    judge: "Callable[[], FeatureJudge] | None" = None
    live: Callable[[], LiveWords] | None = None
    drive_model: Callable[[], DriveModel] | None = None
    run_options: Callable[[], type[Any]] | None = None
    verify_options: Callable[[], type[Any]] | None = None
    new_options: Callable[[], type[Any]] | None = None
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
    while alone := next((each for each in found.values() if not set(each.needs) <= found.keys()), None):
        missing = ", ".join(sorted(set(alone.needs) - found.keys()))
        del found[alone.name]
        broken[alone.name] = f"feature {alone.name} needs the feature {missing}, which is not there"
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
