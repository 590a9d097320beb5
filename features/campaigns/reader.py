"""Read a campaign's TOML file. Everything that it can draw is tried once, so that a mistake is told before any run."""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from random import Random
from typing import Any, Final

from steptwin.features.campaigns.campaign import (
    RUNS_MAX,
    Campaign,
    CampaignMotion,
    JobMotion,
    MotionChoice,
    RandomMoves,
    ScenarioChoice,
    Sources,
)
from steptwin.features.campaigns.trial import placed, random_moves
from steptwin.features.campaigns.values import Template, drawn, read_template
from steptwin.features.campaigns.variations import VARIATIONS, Setup
from steptwin.features.faults.scenario import scenario_of
from steptwin.features.motors.limits import motor_limits
from steptwin.features.motors.options import MotorsTurn
from steptwin.features.motors.turning import check_described
from steptwin.host.common.bad_input import known, prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import NAME_CHARS_MAX, SCENARIO_BYTES_MAX
from steptwin.host.common.findings import Findings
from steptwin.host.common.own_files import read_text
from steptwin.host.common.tables import Table, integer_from, toml_table
from steptwin.host.planning.jobs import job_fields, make_job
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import SUFFIX as PROGRAM_SUFFIX
from steptwin.host.planning.programs import compile_program, read_program
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.planning.trajectory_file import SUFFIXES, is_trajectory_file, read_trajectory
from steptwin.host.robots import SUFFIX as ROBOT_SUFFIX
from steptwin.host.robots import load_robot, load_robot_file
from steptwin.host.robots.robot import Robot

_SEED_MAX: Final = 1 << 53
"""Greatest first seed: every program that reads the results holds such a number exactly."""
_MOVES: Final = 1
_REACH: Final = 0.1
"""Random moves without these keys: one move, each joint by up to a tenth of its range."""
_SCENARIO_KEYS: Final = ("name", "weight", "robots", "file", "vary", "motors")
"""Keys of a scenario that are the campaign's, not those of a file of faults."""
_MOTION_KEYS: Final[Mapping[str, tuple[str, ...]]] = {
    "job": ("options",),
    "moves": ("reach",),
    "file": (),
}
"""The key that says what a motion is, and the further keys of each."""


@dataclass(slots=True)
class _Reader:
    """A campaign that is being read."""

    sources: Sources
    robots: Mapping[str, Robot] = field(default_factory=dict)
    motors: MotorsTurn | None = None
    """When the motors of runs turn whose scenario does not say it."""
    files: set[str] = field(default_factory=set)
    planned: dict[str, Plan] = field(default_factory=dict)
    """A motion of each robot, where scenarios are placed."""

    def campaign(self) -> Campaign:
        """Return the campaign; raise InputError with everything that is wrong in it."""
        table, findings = toml_table(self.sources.text), Findings()
        values = table.read(
            {"runs": integer_from(1, RUNS_MAX), "robots": Table.elements, "motion": Table.elements},
            {
                "first_seed": integer_from(0, _SEED_MAX),
                "scenario": Table.elements,
                "vary": lambda table, key: table.values[key],
                "recover": Table.truth,
                "motors": _motors,
            },
        )
        self.robots, self.motors = self._robots(values["robots"]), values["motors"]
        motions = table.each("motion", self._motion, findings)
        scenarios = table.each("scenario", self._scenario, findings) if "scenario" in table else ()
        times = Counter(choice.name for choice in scenarios)
        if twice := min((name for name in times if times[name] > 1), default=None):
            findings.add(f"scenario: two are called {twice!r}")
        vary: Mapping[str, Template] = {}
        with findings.collecting():
            vary = self._vary(values["vary"])
        campaign = Campaign(
            runs=values["runs"],
            first_seed=values["first_seed"] or 0,
            robots=self.robots,
            motions=motions,
            scenarios=scenarios or (ScenarioChoice("nothing", {}, tuple(self.robots), 1.0, motors=self.motors),),
            vary=vary,
            recover=values["recover"] is not False,
            motors=self.motors,
        )
        for choice in scenarios:
            with findings.collecting():
                self._check_loop(choice, campaign)
        findings.raise_first()
        self._check_every_robot("motion", campaign.motions)
        self._check_every_robot("scenario", campaign.scenarios)
        return campaign

    def _check_loop(self, scenario: ScenarioChoice, campaign: Campaign) -> None:
        """Raise InputError for a scenario with motors in the loop which some of its runs cannot have."""
        if scenario.motors is not MotorsTurn.IN_LOOP:
            return
        with prefixed(f"scenario {scenario.name}: "):
            for name in scenario.robots:
                check_described(self.robots[name])
            if {**campaign.vary, **scenario.vary}.get("crystal_ppm", 0) != 0:
                raise InputError("motors in the loop need exact crystals: give it vary = { crystal_ppm = 0 }")

    def _robots(self, names: list[object]) -> dict[str, Robot]:
        if not names:
            raise InputError("robots: names none")
        robots = {}
        for name in names:
            if not isinstance(name, str):
                raise InputError(f"robots: {name!r} is not a text")
            with prefixed("robots: "):
                robots[name] = self._robot(name)
        return robots

    def _robot(self, name: str) -> Robot:
        if not name.endswith(ROBOT_SUFFIX):
            return load_robot(name)
        self.files.add(name)
        return load_robot_file(self.sources.path(name))

    def _chosen_robots(self, table: Table) -> tuple[str, ...]:
        """Return the robots that a motion or a scenario is for: all, unless it names some."""
        if "robots" not in table:
            return tuple(self.robots)
        return tuple(known("robots: robot", name, self.robots) for name in table.elements("robots"))

    def _check_every_robot(self, what: str, choices: tuple[MotionChoice, ...] | tuple[ScenarioChoice, ...]) -> None:
        for name in self.robots:
            if not any(name in choice.robots and choice.weight > 0 for choice in choices):
                raise InputError(f"{what}: there is none for {name}")

    # --- motions

    def _motion(self, table: Table) -> MotionChoice:
        kinds = [key for key in _MOTION_KEYS if key in table]
        if len(kinds) != 1:
            raise InputError(f"one of {', '.join(_MOTION_KEYS)} says what the motion is")
        table.check_keys([kinds[0], *_MOTION_KEYS[kinds[0]], "robots", "weight"])
        robots, weight = self._chosen_robots(table), _weight(table)
        read: Mapping[str, Callable[[Table, tuple[str, ...]], JobMotion | RandomMoves | CampaignMotion]] = {
            "job": self._job,
            "moves": self._moves,
            "file": self._file,
        }
        return MotionChoice(read[kinds[0]](table, robots), robots, weight)

    def _job(self, table: Table, robots: tuple[str, ...]) -> JobMotion:
        job = table.text("job")
        options = _template(table, "options") if "options" in table else {}
        if not isinstance(options, dict):
            raise InputError("options: is not a table")
        for name in robots:
            with prefixed(f"{name}: "):
                known = [option.name for option in job_fields(self.robots[name], job)]
            for option in options:
                if option not in known:
                    raise unknown("options: option", option, known)
            if options:
                robot = self.robots[name]
                texts = {option: str(drawn(value, Random(name), robot)) for option, value in options.items()}
                with prefixed(f"{name}: "):
                    make_job(robot, job, texts)
        return JobMotion(job, options)

    def _moves(self, table: Table, _: tuple[str, ...]) -> RandomMoves:
        moves = _template(table, "moves")
        reach = _template(table, "reach") if "reach" in table else _REACH
        for name, robot in self.robots.items():
            count, part = drawn(moves, Random(name), robot), drawn(reach, Random(name), robot)
            if isinstance(count, bool) or not isinstance(count, int) or count < 1:
                raise InputError(f"moves: {count!r} is not a whole number of at least 1")
            if isinstance(part, bool) or not isinstance(part, int | float) or not 0 < part <= 1:
                raise InputError(f"reach: {part!r} is not a part of the joints' ranges, above 0 and up to 1")
        return RandomMoves(moves, reach)

    def _file(self, table: Table, robots: tuple[str, ...]) -> CampaignMotion:
        name = table.text("file")
        self.files.add(name)
        return CampaignMotion(name, {robot: self._trajectory(name, self.robots[robot]) for robot in robots})

    def _trajectory(self, name: str, robot: Robot) -> Trajectory:
        path = self.sources.path(name)
        with prefixed(f"{robot.name}: "):
            if is_trajectory_file(name):
                return read_trajectory(path, robot)
            if name.endswith(PROGRAM_SUFFIX):
                return compile_program(read_program(path), robot, drives=motor_limits).trajectory
        endings = ", ".join(SUFFIXES)
        raise InputError(f"file: {name} is neither a trajectory ({endings}) nor a program ({PROGRAM_SUFFIX})")

    # --- what goes wrong, and what varies

    def _scenario(self, table: Table) -> ScenarioChoice:
        robots, weight = self._chosen_robots(table), _weight(table)
        name = table.name("name", NAME_CHARS_MAX)
        vary = self._vary(table.values.get("vary"))
        motors = _motors(table, "motors") if "motors" in table else self.motors
        own = {key: value for key, value in table.values.items() if key not in _SCENARIO_KEYS}
        if "file" in table:
            if own:
                raise InputError(f"{next(iter(own))}: the file has the scenario")
            file = table.text("file")
            self.files.add(file)
            own = read_scenario_table(self.sources.path(file))
        template = read_template(own)
        self._check_scenario(name, template, robots, turning=motors is MotorsTurn.IN_LOOP)
        return ScenarioChoice(name, template, robots, weight, vary, motors)

    def _check_scenario(self, name: str, template: Template, robots: tuple[str, ...], *, turning: bool) -> None:
        """Read what a scenario draws, once for each robot, with instants in a motion of a second."""
        for robot_name in robots:
            robot = self.robots[robot_name]
            table = placed(drawn(template, Random(robot_name), robot), self._some_motion(robot_name))
            if table.get("fault"):
                findings = Findings()
                with prefixed(f"{robot_name}: "):
                    scenario = scenario_of(table | {"name": name}, robot, findings)
                    findings.raise_first()
                    for fault in scenario.faults:
                        fault.fault.check_motors(turning=turning)
            elif table:
                raise InputError(f"fault: is missing, but there is {next(iter(table))}")

    def _some_motion(self, robot_name: str) -> Plan:
        """Return a motion of a robot, planned once: a campaign has up to twenty thousand scenarios."""
        if robot_name not in self.planned:
            robot = self.robots[robot_name]
            self.planned[robot_name] = plan(robot, random_moves(robot, 1, _REACH, Random(robot_name)))
        return self.planned[robot_name]

    def _vary(self, values: object) -> dict[str, Template]:
        if values is None:
            return {}
        if not isinstance(values, dict):
            raise InputError("vary: is not a table")
        templates = {}
        for name, value in values.items():
            if name not in VARIATIONS:
                raise unknown("vary: parameter", name, VARIATIONS)
            with prefixed(f"vary.{name}: "):
                templates[name] = read_template(value)
                for robot_name, robot in self.robots.items():
                    VARIATIONS[name](Setup(robot), drawn(templates[name], Random(robot_name), robot))
        return templates


def read_campaign(sources: Sources) -> tuple[Campaign, set[str]]:
    """Return a campaign and the names of the files that it names.

    Raises:
        InputError: something in it is wrong; the messages name file and key.
    """
    with prefixed(f"{sources.name}: "):
        return parse_campaign(sources)


def parse_campaign(sources: Sources) -> tuple[Campaign, set[str]]:
    """Do the same as `read_campaign`; its messages do not name the file."""
    reader = _Reader(sources)
    return reader.campaign(), reader.files


def read_scenario_table(path: str) -> dict[str, Any]:
    """Return the table of a scenario's file, to be read for a robot later; raise InputError if it is not TOML."""
    with prefixed(f"{path}: "):
        table = dict(toml_table(read_text(path, SCENARIO_BYTES_MAX)).values)
    table.pop("name", None)
    return table


def _motors(table: Table, key: str) -> MotorsTurn | None:
    """Read when motors turn: true stands for after the run."""
    if isinstance(table.values[key], bool):
        return MotorsTurn.AFTER if table.truth(key) else None
    text = table.text(key)
    if text != MotorsTurn.IN_LOOP:
        raise InputError(f'{key}: {text!r} is none of true, false and "{MotorsTurn.IN_LOOP}"')
    return MotorsTurn.IN_LOOP


def _weight(table: Table) -> float:
    return table.number("weight", 0) if "weight" in table else 1.0


def _template(table: Table, key: str) -> Any:
    with prefixed(f"{key}: "):
        return read_template(table.values[key])
