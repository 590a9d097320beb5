"""A campaign as its file describes it: which robots make which motions, what goes wrong meanwhile, and what varies.

Everything that it can draw is tried once as it is read, so that a mistake is told before any run.
"""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from random import Random
from typing import Annotated, Any, ClassVar, Final

import numpy as np

from steptwin.features.campaigns.sources import Sources
from steptwin.features.campaigns.values import Template, drawn, placed, read_template
from steptwin.features.campaigns.variations import VARIATIONS, Setup
from steptwin.features.faults.scenario import SCENARIO_BYTES_MAX, scenario_of
from steptwin.features.motors.limits import motor_limits
from steptwin.features.motors.options import MotorsTurn
from steptwin.features.motors.turning import check_described
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import known, prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import NAME_CHARS_MAX
from steptwin.host.common.file_models import FileReading, FileTable, read_model
from steptwin.host.common.file_values import Choice, Name, NotNegative, OneOf, ReadBy, TableList, Within
from steptwin.host.common.findings import Findings, UnreadError, judged
from steptwin.host.common.own_files import read_text
from steptwin.host.common.tables import toml_table
from steptwin.host.planning.jobs import job_fields, make_job
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan, plan_stretched
from steptwin.host.planning.programs import SUFFIX as PROGRAM_SUFFIX
from steptwin.host.planning.programs import compile_program, read_program
from steptwin.host.planning.trajectory_file import SUFFIXES, is_trajectory_file, read_trajectory
from steptwin.host.robots import SUFFIX as ROBOT_SUFFIX
from steptwin.host.robots import load_robot, load_robot_file
from steptwin.host.robots.robot import Robot

RUNS_MAX: Final = 10_000_000
"""Greatest number of runs: a list of those that are done takes a byte for each."""
_SEED_MAX: Final = 1 << 53
"""Greatest first seed: every program that reads the results holds such a number exactly."""
_REACH: Final = 0.1
"""Part of each joint's range by which random moves are from home at most, without the key."""
_TRIES: Final = 6
"""Number of draws of a random move, each half as far, until the robot can make it."""


@dataclass(slots=True)
class CampaignReading:
    """What the tables of a campaign share while it is read.

    Attributes:
        sources: its files.
        files: names of those that it names.
        planned: a motion of each robot, where scenarios are placed: a campaign has up to twenty thousand.
    """

    sources: Sources
    files: set[str] = field(default_factory=set)
    planned: dict[str, Plan] = field(default_factory=dict)

    def path(self, name: str) -> str:
        """Return the path of a file that the campaign names."""
        self.files.add(name)
        return self.sources.path(name)

    def some_motion(self, name: str, robot: Robot) -> Plan:
        """Return a motion of a robot, planned once."""
        if name not in self.planned:
            self.planned[name] = plan(robot, random_moves(robot, 1, _REACH, Random(name)))
        return self.planned[name]


def _read_robots(names: object, reading: FileReading) -> Mapping[str, Robot]:
    robots, found = dict[str, Robot](), Findings()
    if not isinstance(names, list) or not names:
        raise InputError("names none")
    for name in names:
        with found.collecting():
            if not isinstance(name, str):
                raise InputError(f"{name!r} is not a text")
            is_file = name.endswith(ROBOT_SUFFIX)
            robots[name] = load_robot_file(reading.known.path(name)) if is_file else load_robot(name)
    found.raise_first()
    return robots


def _robots(reading: FileReading) -> Mapping[str, Robot]:
    if "robots" not in reading.read:
        raise UnreadError("robots")
    robots: Mapping[str, Robot] = reading.read["robots"]
    return robots


def _read_motors(value: object, _: FileReading) -> MotorsTurn | None:
    if isinstance(value, bool):
        return MotorsTurn.AFTER if value else None
    if value != MotorsTurn.IN_LOOP:
        raise InputError(f'{value!r} is none of true, false and "{MotorsTurn.IN_LOOP}"')
    return MotorsTurn.IN_LOOP


def _read_varied(value: object, reading: FileReading) -> Template:
    template, parameter = read_template(value), reading.name
    for name, robot in _robots(reading).items() if parameter in VARIATIONS else ():
        VARIATIONS[parameter](Setup(robot), drawn(template, Random(name), robot))
    return template


_Drawn = Annotated[Any, ReadBy(lambda value, _: read_template(value), dict)]
"""A value that may be drawn."""
_Motors = Annotated[MotorsTurn | None, ReadBy(_read_motors, lambda: {"enum": [True, False, MotorsTurn.IN_LOOP]})]
_Parameter = Annotated[str, Choice("parameter", lambda: tuple(VARIATIONS))]
_Vary = Mapping[_Parameter, Annotated[Any, ReadBy(_read_varied, dict)]]
_RobotName = Annotated[
    str, ReadBy(lambda name, reading: known("robot", name, _robots(reading)), lambda: {"type": "string"})
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Weighted(FileTable):
    """One of what runs choose from.

    Attributes:
        robots: names of the robots that may have it; without it all.
        weight: how often it is chosen, beside the others.
    """

    may_lack: ClassVar[tuple[str, ...]] = ("robots",)
    robots: tuple[_RobotName, ...]
    weight: NotNegative = 1.0

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> Any:
        """Return it, for all robots if the table names none."""
        if "robots" in values and values["robots"] is None:
            values["robots"] = tuple(_robots(reading))
        return judged(cls, values, reading.findings)


# --- motions

Stream = Callable[[str], Random]
"""Returns the generator of a quantity by its name."""
Drawing = tuple[dict[str, Any], Motion]
"""The drawn values of a motion, and the motion itself."""


class DrawnMotion(Weighted, ABC):
    """A motion that runs may make."""

    __slots__ = ()

    @abstractmethod
    def drawn_for(self, name: str, robot: Robot, stream: Stream) -> Drawing:
        """Return the motion of a robot, which has a name in the campaign, as it is drawn."""


def _one_stream(robot: str, _: str) -> Random:
    return Random(robot)


@dataclass(frozen=True, slots=True)
class JobMotion(DrawnMotion):
    """A job of the robot.

    Attributes:
        job: name of the job.
        options: its options by name; each may be drawn.
    """

    job: str
    options: Mapping[str, _Drawn] = field(default_factory=dict)

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> Any:
        """Return the motion; raise InputError if a robot does not have such a job."""
        motion: JobMotion = super(JobMotion, cls).made_of(values, reading)
        for name in motion.robots:
            robot = _robots(reading)[name]
            with prefixed(f"{name}: "):
                options = [option.name for option in job_fields(robot, motion.job)]
            for option in motion.options:
                if option not in options:
                    raise unknown("options: option", option, options)
            if motion.options:
                with prefixed(f"{name}: "):
                    motion.drawn_for(name, robot, partial(_one_stream, name))
        return motion

    def __str__(self) -> str:
        return self.job

    def drawn_for(self, name: str, robot: Robot, stream: Stream) -> Drawing:
        del name
        options = {
            option: drawn(value, stream(f"{self.job}.{option}"), robot) for option, value in self.options.items()
        }
        return options, make_job(robot, self.job, {option: str(value) for option, value in options.items()})


@dataclass(frozen=True, slots=True)
class RandomMoves(DrawnMotion):
    """Moves of all joints to random positions around the robot's home, one after the other, jerk-limited.

    Attributes:
        moves: number of moves; may be drawn.
        reach: how far from home, as a part of each joint's range, at most; may be drawn.
    """

    moves: _Drawn
    reach: _Drawn = _REACH

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> Any:
        """Return the motion; raise InputError for other values than numbers of moves and parts of ranges."""
        motion: RandomMoves = super(RandomMoves, cls).made_of(values, reading)
        for name, robot in _robots(reading).items():
            count, part = drawn(motion.moves, Random(name), robot), drawn(motion.reach, Random(name), robot)
            if isinstance(count, bool) or not isinstance(count, int) or count < 1:
                raise InputError(f"moves: {count!r} is not a whole number of at least 1")
            if isinstance(part, bool) or not isinstance(part, int | float) or not 0 < part <= 1:
                raise InputError(f"reach: {part!r} is not a part of the joints' ranges, above 0 and up to 1")
        return motion

    def __str__(self) -> str:
        return "random moves"

    def drawn_for(self, name: str, robot: Robot, stream: Stream) -> Drawing:
        del name
        random = stream("moves")
        options = {"moves": drawn(self.moves, random, robot), "reach": drawn(self.reach, random, robot)}
        return options, random_moves(robot, options["moves"], options["reach"], random)


@dataclass(frozen=True, slots=True)
class CampaignMotion(DrawnMotion):
    """A motion of a trajectory file or a program: the motion for each robot that makes it, by the robot's name."""

    file: str
    by_robot: Mapping[str, Motion]

    def __str__(self) -> str:
        return self.file

    def drawn_for(self, name: str, robot: Robot, stream: Stream) -> Drawing:
        del robot, stream
        return {}, self.by_robot[name]


@dataclass(frozen=True, slots=True)
class MotionOfFile(Weighted):
    """A motion of a trajectory file or a program.

    Attributes:
        file: name of the file.
    """

    file: str

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> CampaignMotion:
        """Return the motion; raise InputError for what is wrong in its file."""
        table: MotionOfFile = super(MotionOfFile, cls).made_of(values, reading)
        by_robot, path = dict[str, Motion](), reading.known.path(table.file)
        for name in table.robots:
            robot = _robots(reading)[name]
            with prefixed(f"{robot.name}: "):
                if is_trajectory_file(table.file):
                    by_robot[name] = read_trajectory(path, robot)
                elif table.file.endswith(PROGRAM_SUFFIX):
                    by_robot[name] = compile_program(read_program(path), robot, drives=motor_limits).motion
                else:
                    endings = f"a trajectory ({', '.join(SUFFIXES)}) nor a program ({PROGRAM_SUFFIX})"
                    raise InputError(f"file: {table.file} is neither {endings}")
        return CampaignMotion(table.file, by_robot, robots=table.robots, weight=table.weight)


def random_moves(robot: Robot, moves: int, reach: float, random: Random) -> Motion:
    """Return moves of all joints around the robot's home, each within `reach` of the joints' ranges; raise InputError.

    A position that the robot cannot reach is drawn again, half as far.
    """
    lower = np.array([joint.lower for joint in robot.joints])
    upper = np.array([joint.upper for joint in robot.joints])
    home = np.array(robot.home)
    composer = Composer(robot, home)
    for _ in range(moves):
        for attempt in range(_TRIES):
            parts = np.array([random.uniform(-1, 1) for _ in robot.joints])
            goal = np.clip(home + parts * reach / 2**attempt * (upper - lower), lower, upper)
            try:
                _check_move(robot, composer.joints, goal)
            except InputError:
                if attempt == _TRIES - 1:
                    raise
            else:
                composer.go(goal)
                break
    return composer.sequence()


def _check_move(robot: Robot, start: FloatArray, goal: FloatArray) -> None:
    """Raise InputError if the robot cannot make the move."""
    composer = Composer(robot, start)
    composer.go(goal)
    plan_stretched(robot, composer.sequence(), None)


# --- what goes wrong


def _read_file(name: object, reading: FileReading) -> Template:
    if not isinstance(name, str):
        raise InputError(f"{name!r} is not a text")
    return read_template(read_scenario_table(reading.known.path(name)))


@dataclass(frozen=True, slots=True)
class ScenarioChoice(Weighted):
    """A scenario that runs may meet; without a fault nothing goes wrong.

    Attributes:
        name: its name in results.
        title: a line for people.
        seed: seed of everything in it that is random; may be drawn.
        fault: its faults, as in a file of faults; their values may be drawn.
        file: a file of faults in place of them.
        vary: parameters that vary, in place of the campaign's.
        motors: whether the motors of its runs turn, in place of the campaign's.
    """

    name: Annotated[str, Name(NAME_CHARS_MAX)]
    title: _Drawn = None
    seed: _Drawn = None
    fault: _Drawn = None
    file: Annotated[Template, ReadBy(_read_file, lambda: {"type": "string"})] = None
    vary: _Vary = field(default_factory=dict)
    motors: _Motors = None

    @property
    def table(self) -> Mapping[str, Template]:
        """The template of a scenario's table without its name; a run without a fault has an empty one."""
        own = {"title": self.title, "seed": self.seed, "fault": self.fault}
        return self.file or {key: value for key, value in own.items() if value is not None}

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> Any:
        """Return the scenario; raise InputError for what is wrong in it, as it is drawn once for each robot."""
        if "motors" not in reading.table:
            values["motors"] = reading.read.get("motors")
        if "file" in reading.table and (own := [key for key in ("title", "seed", "fault") if key in reading.table]):
            raise InputError(f"{own[0]}: the file has the scenario")
        choice: ScenarioChoice = super(ScenarioChoice, cls).made_of(values, reading)
        for name in choice.robots:
            robot = _robots(reading)[name]
            table = placed(drawn(choice.table, Random(name), robot), reading.known.some_motion(name, robot))
            if table and not table.get("fault"):
                raise InputError(f"fault: is missing, but there is {next(iter(table))}")
            if table:
                findings = Findings()
                with prefixed(f"{name}: "):
                    scenario = scenario_of(table | {"name": choice.name}, robot, findings)
                    findings.raise_first()
                    for fault in scenario.faults:
                        fault.fault.check_motors(turning=choice.motors is MotorsTurn.IN_LOOP)
        return choice

    def check_loop(self, campaign: "Campaign") -> None:
        """Raise InputError for a scenario with motors in the loop which some of its runs cannot have."""
        if self.motors is MotorsTurn.IN_LOOP:
            with prefixed(f"scenario {self.name}: "):
                for name in self.robots:
                    check_described(campaign.robots[name])
                if {**campaign.vary, **self.vary}.get("crystal_ppm", 0) != 0:
                    raise InputError("motors in the loop need exact crystals: give it vary = { crystal_ppm = 0 }")


def read_scenario_table(path: str) -> dict[str, Any]:
    """Return the table of a scenario's file, to be read for a robot later; raise InputError if it is not TOML."""
    with prefixed(f"{path}: "):
        table = dict(toml_table(read_text(path, SCENARIO_BYTES_MAX)).values)
    table.pop("name", None)
    return table


# --- the campaign

_MOTIONS: Final = {"job": JobMotion, "moves": RandomMoves, "file": MotionOfFile}


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign(FileTable):
    """All runs that a campaign may draw; equal campaigns draw equal runs.

    Attributes:
        runs: number of runs.
        first_seed: seed of the first run; the others have the next ones.
        robots: names of robots, or robot files.
        motors: true: turn the motors by each run's record; "loop": as the run goes.
        motion: the motions to choose from.
        scenario: the scenarios to choose from.
        vary: parameters that vary from run to run.
        recover: true to recover every machine after its run: repair it, reset, home, move.
    """

    runs: Annotated[int, Within(1, RUNS_MAX)]
    first_seed: Annotated[int, Within(0, _SEED_MAX)] = 0
    robots: Annotated[
        Mapping[str, Robot], ReadBy(_read_robots, lambda: {"type": "array", "items": {"type": "string"}, "minItems": 1})
    ]
    motors: _Motors = None
    motion: Annotated[tuple[Annotated[Any, OneOf("motion", lambda: _MOTIONS)], ...], TableList("motion")]
    scenario: tuple[ScenarioChoice, ...] = ()
    vary: _Vary = field(default_factory=dict)
    recover: bool = True

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> "Campaign":
        """Return the campaign; one without scenarios has one in which nothing goes wrong."""
        if values.get("scenario", 0) is None:
            robots = tuple(_robots(reading))
            values["scenario"] = (ScenarioChoice("nothing", robots=robots, motors=reading.read.get("motors")),)
        campaign: Campaign = judged(cls, values, reading.findings)
        with reading.findings.collecting():
            times = Counter(choice.name for choice in campaign.scenario)
            if twice := min((name for name in times if times[name] > 1), default=None):
                raise InputError(f"scenario: two are called {twice!r}")
        with reading.findings.collecting():
            for choice in campaign.scenario:
                choice.check_loop(campaign)
        if not reading.findings.messages:
            with reading.findings.collecting():
                campaign.check_every_robot("motion", campaign.motion)
                campaign.check_every_robot("scenario", campaign.scenario)
        return campaign

    def check_every_robot(self, what: str, choices: Iterable[DrawnMotion | ScenarioChoice]) -> None:
        """Raise InputError for a robot that has none of the choices."""
        for name in self.robots:
            if not any(name in choice.robots and choice.weight > 0 for choice in choices):
                raise InputError(f"{what}: there is none for {name}")

    @property
    def seeds(self) -> range:
        """The seeds of all runs."""
        return range(self.first_seed, self.first_seed + self.runs)


def read_campaign(sources: Sources) -> tuple[Campaign, set[str]]:
    """Return a campaign and the names of the files that it names.

    Raises:
        InputError: something in it is wrong; the messages name file and key.
    """
    with prefixed(f"{sources.name}: "):
        return parse_campaign(sources)


def parse_campaign(sources: Sources) -> tuple[Campaign, set[str]]:
    """Do the same as `read_campaign`; its messages do not name the file."""
    findings, shared = Findings(), CampaignReading(sources)
    campaign = read_model(Campaign, toml_table(sources.text).values, findings, shared)
    findings.raise_first()
    return campaign, shared.files
