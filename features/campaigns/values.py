"""Values that a campaign draws for each run: read from TOML, drawn from a seeded generator.

A drawn value stands where a plain one could: a table with a single key, such as `{ uniform = [0, 1.5] }`. Two kinds can
only be known once the run's motion is planned: an instant as a part of the motion, and a joint's position on the way.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import exp, log
from random import Random
from reprlib import repr as short
from typing import Any, Final, NamedTuple

import numpy as np

from steptwin.host.common.bad_input import known, prefixed
from steptwin.host.common.choices import SWITCHES
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import number_at
from steptwin.host.operate.inputs_outputs import switches_of
from steptwin.host.planning.plan import Plan
from steptwin.host.robots.robot import Robot

Template = Any
"""A value of TOML in which tables of a single key may be drawn: a scalar, a Draw, or a list or dict of templates."""


@dataclass(frozen=True, slots=True)
class Draw:
    """A value that is drawn.

    Attributes:
        how: the key of its table, one of `_DRAWS`.
        source: what it is drawn from: the values to choose from, the least and the greatest value, or the switch that a
            joint must have, by its name in requests; empty for any joint.
    """

    how: str
    source: tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class AtPart:
    """An instant as a part of a motion, in seconds once that is planned."""

    part: float


@dataclass(frozen=True, slots=True)
class PlannedAt:
    """A joint's planned position at a part of a motion."""

    part: float


def drawn(template: Template, random: Random, robot: Robot) -> Any:
    """Return a template with all its draws drawn, in the order that they stand."""
    if isinstance(template, dict):
        return {key: drawn(value, random, robot) for key, value in template.items()}
    if isinstance(template, list):
        return [drawn(value, random, robot) for value in template]
    if isinstance(template, Draw):
        return _DRAWS[template.how].draw(random, robot, *template.source)
    return template


def placed(value: Any, plan: Plan, *, joint: str | None = None) -> Any:
    """Return a drawn table with fractions of the motion converted to seconds, or to positions of the joint there."""
    if isinstance(value, dict):
        beside = value.get("joint", joint)
        return {key: placed(item, plan, joint=beside) for key, item in value.items()}
    if isinstance(value, list):
        return [placed(item, plan) for item in value]
    if isinstance(value, AtPart):
        return round(value.part * plan.motion.duration_s, 4)
    if isinstance(value, PlannedAt):
        if joint is None:
            raise InputError("on_the_way: needs the joint beside it, under the key joint")
        known("joint", joint, plan.robot.joint_names)
        at_s = np.array([value.part * plan.motion.duration_s])
        return round(float(plan.motion.positions(at_s)[0, plan.robot.index_of(joint)]), 4)
    return value


def read_template(value: object) -> Template:
    """Return the template that a value of TOML means; raise InputError, with its place, for a wrong one."""
    if isinstance(value, list):
        made = []
        for number, item in enumerate(value):
            with prefixed(f"[{number}]: "):
                made.append(read_template(item))
        return made
    if not isinstance(value, dict):
        return value
    if len(value) == 1 and (key := next(iter(value))) in _DRAWS:
        with prefixed(f"{key}: "):
            return Draw(key, _DRAWS[key].read(value[key]))
    templates = {}
    for key, item in value.items():
        with prefixed(f"{key}: "):
            templates[key] = read_template(item)
    return templates


def _values(values: object) -> tuple[Template, ...]:
    if not isinstance(values, list) or not values:
        raise InputError(f"{short(values)} is not a list of values to choose from")
    return tuple(read_template(value) for value in values)


def _range(values: object) -> tuple[float, float]:
    if not isinstance(values, list) or len(values) != 2:
        raise InputError(f"{short(values)} is not a list of the least and the greatest value")
    lower, upper = number_at("the least", values[0]), number_at("the greatest", values[1])
    if not lower <= upper:
        raise InputError(f"{upper:g} is below {lower:g}: the least value comes first")
    return lower, upper


def _positive(values: object) -> tuple[float, float]:
    lower, upper = _range(values)
    if not lower > 0:
        raise InputError(f"{lower:g} is not above 0; uniform takes it")
    return lower, upper


def _whole(values: object) -> tuple[int, int]:
    lower, upper = _range(values)
    if lower != int(lower) or upper != int(upper):
        raise InputError(f"{short(values)} are not whole numbers; uniform takes others")
    return int(lower), int(upper)


def _parts(values: object) -> tuple[float, float]:
    lower, upper = _range(values)
    if not 0 <= lower <= upper <= 1:
        raise InputError(f"{short(values)} are not parts of a motion, from 0 to 1")
    return lower, upper


_ANY: Final = {"joint": ()} | {f"joint with {switch}": (switch,) for switch in SWITCHES}


def _joint(random: Random, robot: Robot, switch: str = "") -> str:
    """Return the name of one of the robot's joints; raise InputError if none has the switch."""
    axes = range(len(robot.joints))
    names = [robot.joint_names[axis] for axis in axes if not switch or switch in switches_of(robot, axis)]
    if not names:
        raise InputError(f"any: no joint of {robot.name} has the switch {switch}")
    return random.choice(names)


def _uniform(random: Random, _: Robot, lower: float, upper: float) -> float:
    """Return a number of six significant digits: short to read, and the same when it is read again."""
    return float(f"{random.uniform(lower, upper):.6g}")


def _log_uniform(random: Random, _: Robot, lower: float, upper: float) -> float:
    return float(f"{exp(random.uniform(log(lower), log(upper))):.6g}")


class _Kind(NamedTuple):
    """A kind of draw: how its source is read from TOML, and how a value is drawn from it."""

    read: Callable[[object], tuple[Any, ...]]
    draw: Callable[..., Any]


_DRAWS: Final[Mapping[str, _Kind]] = {
    "choose": _Kind(_values, lambda random, robot, *values: drawn(random.choice(values), random, robot)),
    "uniform": _Kind(_range, _uniform),
    "log_uniform": _Kind(_positive, _log_uniform),
    "whole": _Kind(_whole, lambda random, _, lower, upper: random.randint(lower, upper)),
    "any": _Kind(lambda what: _ANY[known("any", what, _ANY)], _joint),
    "part_of_motion": _Kind(_parts, lambda *drawing: AtPart(_uniform(*drawing))),
    "on_the_way": _Kind(_parts, lambda *drawing: PlannedAt(_uniform(*drawing))),
}
"""The keys that make a table of a single key a draw: one of some values, each as likely; a number between two, or with
each factor as likely, for values over several decades; a whole number, both ends included; the name of a joint; an
instant between two parts of the motion, 0 its start and 1 its end; the position at such an instant of the joint beside
it, under the key `joint`."""
