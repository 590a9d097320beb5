"""Draw one run of a campaign from its seed alone.

Each quantity has a generator of its own, seeded by the run's seed and the quantity's name. So another parameter in the
campaign does not change the drawn robots, motions and faults.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from random import Random
from typing import Any, Protocol, TypeVar

from steptwin.features.campaigns.campaign import Campaign, RandomMoves
from steptwin.features.campaigns.values import AtPart, PlannedAt, drawn, placed
from steptwin.features.campaigns.variations import Setup, set_up
from steptwin.features.faults.scenario import SEED_MAX, Scenario, scenario_of
from steptwin.features.motors.options import MotorsTurn
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.checks import TooFastError
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan_stretched
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.reader import read_robot
from steptwin.host.robots.robot import Robot


class _Weighted(Protocol):
    @property
    def weight(self) -> float: ...


_Choice = TypeVar("_Choice", bound=_Weighted)


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """A drawn run of a campaign.

    Attributes:
        seed: its seed.
        robot_name: the robot's name in the campaign.
        motion_name: its motion's name.
        options: drawn options of the motion, by name.
        scenario: its scenario's name.
        table: the scenario's table; instants may be fractions of the motion.
        varied: value of each varied parameter.
        setup: the varied robot and the settings of the run.
        motion: the motion.
        slowable: True if it may be slower than drawn.
        recover: True to recover the machine afterwards.
        motors: when its motors turn; None: never.
    """

    seed: int
    robot_name: str
    motion_name: str
    options: Mapping[str, Any]
    scenario: str
    table: Mapping[str, Any]
    varied: Mapping[str, Any]
    setup: Setup
    motion: Motion = field(repr=False)
    slowable: bool = False
    recover: bool = True
    motors: MotorsTurn | None = None

    def plan(self) -> Plan:
        """Plan the motion; raise InputError if the varied robot cannot make it.

        Random moves that are too fast, as with more microsteps, become slower.
        """
        robot, stretch, record_ms = self.setup.robot, self.setup.stretch, self.setup.record_ms
        try:
            return plan_stretched(robot, self.motion, stretch, record_ms)
        except TooFastError:
            if not self.slowable:
                raise
            return plan_stretched(robot, self.motion, None, record_ms)

    def scenario_in(self, plan: Plan) -> Scenario | None:
        """Return the scenario for a planned motion; None without a fault.

        Raises:
            InputError: it is invalid, or the robot lacks the target of a fault.
        """
        if not self.table.get("fault"):
            return None
        findings = Findings()
        with prefixed(f"{self.scenario}: "):
            table = {"seed": self.scenario_seed} | placed(dict(self.table), plan) | {"name": self.scenario}
            scenario = scenario_of(table, self.setup.robot, findings)
            findings.raise_first()
        return scenario

    @property
    def scenario_seed(self) -> int:
        """Seed of the scenario's random parts, unless its table has one."""
        return self.seed % (SEED_MAX + 1)

    def with_table(self, table: Mapping[str, Any]) -> "Trial":
        """Return the run with another scenario."""
        return replace(self, table=table)

    @property
    def parameters(self) -> dict[str, Any]:
        """All drawn values, by a name with their place."""
        return {
            **self.varied,
            **{f"{self.motion_name}.{name}": value for name, value in self.options.items()},
            **dict(_leaves(self.scenario, self.table)),
        }


def draw(campaign: Campaign, seed: int) -> Trial:
    """Draw the run of a seed; raise InputError, with the part of the campaign, if it is impossible."""
    name = _stream(seed, "robot").choice(list(campaign.robots))
    robot = campaign.robots[name]
    chosen = _weighted([each for each in campaign.motion if name in each.robots], _stream(seed, "motion"))
    scenario = _weighted([each for each in campaign.scenario if name in each.robots], _stream(seed, "scenario"))
    varied = {
        parameter: drawn(template, _stream(seed, f"vary.{parameter}"), robot)
        for parameter, template in {**campaign.vary, **scenario.vary}.items()
    }
    setup = set_up(robot, varied)
    with prefixed(f"{chosen}: "):
        options, motion = chosen.drawn_for(name, robot, partial(_stream, seed))
    table = drawn(scenario.table, _stream(seed, f"scenario.{scenario.name}"), robot)
    return Trial(
        seed=seed,
        robot_name=name,
        motion_name=str(chosen),
        options=options,
        scenario=scenario.name,
        table=table,
        varied=varied,
        setup=setup,
        motion=motion,
        slowable=isinstance(chosen, RandomMoves),
        recover=campaign.recover,
        motors=scenario.motors,
    )


def _stream(seed: int, what: str) -> Random:
    return Random(f"{seed} {what}")


def _weighted(choices: Sequence[_Choice], random: Random) -> _Choice:
    return random.choices(choices, [choice.weight for choice in choices])[0]


def _leaves(place: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the scalars of a table, each with its place."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _leaves(f"{place}.{key}", item)
    elif isinstance(value, list):
        for number, item in enumerate(value, start=1):
            yield from _leaves(f"{place}[{number}]", item)
    else:
        yield place, value.part if isinstance(value, AtPart | PlannedAt) else value


def with_varied_file(trial: Trial) -> Trial:
    """Return the run with a robot whose file has the varied values.

    A file may not have speeds beyond the drivers' step rate, as with more microsteps. Such speeds become the highest
    possible ones; the run was no faster.

    Raises:
        InputError: the robot's file has no key for a varied value.
    """
    robot = trial.setup.robot
    text = _varied_text(robot, f"# {robot.name} as drawn for seed {trial.seed} of a campaign\n")
    return replace(trial, setup=replace(trial.setup, robot=replace(robot, toml=text)))


def _varied_text(robot: Robot, head: str) -> str:
    import tomlkit

    if read_robot(robot.toml) == robot:
        return robot.toml
    stated = replace(robot, joints=tuple(_within(joint, robot.board.driver_rate_max_hz) for joint in robot.joints))
    document: Any = tomlkit.parse(robot.toml)
    document["board"]["bitrate"] = stated.board.bitrate
    for joint in stated.joints:
        _state(joint, document["joints"][joint.name])
    if stated.dynamics is not None:
        document["dynamics"]["payload_kg"] = stated.dynamics.payload_kg
    text = head + tomlkit.dumps(document)
    if read_robot(text) != stated:
        raise InputError(f"{robot.name}: its file cannot say what was varied")
    return text


def _within(joint: Joint, rate_max_hz: float) -> Joint:
    """Return a joint with its speed limited to the driver's step rate."""
    if joint.step_rate_max_hz <= rate_max_hz:
        return joint
    fastest = rate_max_hz / joint.transmission.steps_per_unit
    return replace(joint, axis_speed_max=fastest) if joint.axis_speed_max else replace(joint, speed_max=fastest)


def _state(joint: Joint, keys: dict[str, Any]) -> None:
    keys["microsteps"] = joint.transmission.microsteps
    for key in ("speed_max", "acceleration_max", "axis_speed_max", "axis_acceleration_max"):
        if getattr(joint, key) is not None:
            keys[key] = getattr(joint, key)
    if joint.homing is not None:
        keys["homing"]["acceleration"] = joint.homing.acceleration
    if joint.motor is not None:
        keys["motor"]["friction_nm"] = joint.motor.friction_nm
