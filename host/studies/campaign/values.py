"""Values that a campaign draws for each run: read from TOML, drawn from a seeded generator.

A drawn value stands where a plain one could: a table with a single key, such as `{ uniform = [0, 1.5] }`. Two kinds can
only be known once the run's motion is planned: an instant as a part of the motion, and a joint's position on the way.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import exp, log
from random import Random
from reprlib import repr as short
from typing import Any, Final, Protocol

from steptwin.host.common.bad_input import known, prefixed
from steptwin.host.common.control import SWITCHES
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import number_at
from steptwin.host.faults.requests import switches_of
from steptwin.host.robots.robot import Robot

Template = Any
"""A value of TOML in which tables of a single key may be drawn: a scalar, a Draw, or a list or dict of templates."""


class Draw(Protocol):
    """A value that is drawn."""

    def drawn(self, random: Random, robot: Robot) -> Any:
        """Return a value for a run with this robot."""
        ...


@dataclass(frozen=True, slots=True)
class Choose:
    """One of some values, each as likely."""

    values: tuple[Template, ...]

    def drawn(self, random: Random, robot: Robot) -> Any:
        """Return one of the values, itself drawn if it is a template."""
        return drawn(random.choice(self.values), random, robot)


@dataclass(frozen=True, slots=True)
class Uniform:
    """A number between two, each as likely."""

    lower: float
    upper: float

    def drawn(self, random: Random, _: Robot) -> float:
        """Return a number of six significant digits: short to read, and the same when it is read again."""
        return _short(random.uniform(self.lower, self.upper))


@dataclass(frozen=True, slots=True)
class LogUniform:
    """A number between two above 0, each factor as likely: for values over several decades."""

    lower: float
    upper: float

    def drawn(self, random: Random, _: Robot) -> float:
        """Return a number of six significant digits."""
        return _short(exp(random.uniform(log(self.lower), log(self.upper))))


@dataclass(frozen=True, slots=True)
class Whole:
    """A whole number from one to another, both included."""

    lower: int
    upper: int

    def drawn(self, random: Random, _: Robot) -> int:
        """Return the number."""
        return random.randint(self.lower, self.upper)


@dataclass(frozen=True, slots=True)
class AnyJoint:
    """The name of one of the robot's joints; with a switch, by its name in requests, of one that has it."""

    switch: str = ""

    def drawn(self, random: Random, robot: Robot) -> str:
        """Return the name; raise InputError if no joint has the switch."""
        axes = range(len(robot.joints))
        names = [robot.joint_names[axis] for axis in axes if not self.switch or self.switch in switches_of(robot, axis)]
        if not names:
            raise InputError(f"any: no joint of {robot.name} has the switch {self.switch}")
        return random.choice(names)


@dataclass(frozen=True, slots=True)
class PartOfMotion:
    """An instant between two parts of the motion, 0 its start and 1 its end."""

    lower: float
    upper: float

    def drawn(self, random: Random, _: Robot) -> "AtPart":
        """Return the instant as a part, to be placed in the motion."""
        return AtPart(_short(random.uniform(self.lower, self.upper)))


@dataclass(frozen=True, slots=True)
class OnTheWay:
    """The position where the joint beside it, under the key `joint`, is at an instant between two parts."""

    lower: float
    upper: float

    def drawn(self, random: Random, _: Robot) -> "PlannedAt":
        """Return the instant as a part, at which the position is looked up."""
        return PlannedAt(_short(random.uniform(self.lower, self.upper)))


@dataclass(frozen=True, slots=True)
class AtPart:
    """An instant as a part of a motion, in seconds once that is planned."""

    part: float


@dataclass(frozen=True, slots=True)
class PlannedAt:
    """A joint's planned position at a part of a motion."""

    part: float


def _short(value: float) -> float:
    return float(f"{value:.6g}")


def drawn(template: Template, random: Random, robot: Robot) -> Any:
    """Return a template with all its draws drawn, in the order that they stand."""
    if isinstance(template, dict):
        return {key: drawn(value, random, robot) for key, value in template.items()}
    if isinstance(template, list):
        return [drawn(value, random, robot) for value in template]
    if isinstance(template, Choose | Uniform | LogUniform | Whole | AnyJoint | PartOfMotion | OnTheWay):
        return template.drawn(random, robot)
    return template


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
            return _DRAWS[key](value[key])
    templates = {}
    for key, item in value.items():
        with prefixed(f"{key}: "):
            templates[key] = read_template(item)
    return templates


def _choose(values: object) -> Choose:
    if not isinstance(values, list) or not values:
        raise InputError(f"{short(values)} is not a list of values to choose from")
    return Choose(tuple(read_template(value) for value in values))


def _range(values: object) -> tuple[float, float]:
    if not isinstance(values, list) or len(values) != 2:
        raise InputError(f"{short(values)} is not a list of the least and the greatest value")
    lower, upper = number_at("the least", values[0]), number_at("the greatest", values[1])
    if not lower <= upper:
        raise InputError(f"{upper:g} is below {lower:g}: the least value comes first")
    return lower, upper


def _log_uniform(values: object) -> LogUniform:
    lower, upper = _range(values)
    if not lower > 0:
        raise InputError(f"{lower:g} is not above 0; uniform takes it")
    return LogUniform(lower, upper)


def _whole(values: object) -> Whole:
    lower, upper = _range(values)
    if lower != int(lower) or upper != int(upper):
        raise InputError(f"{short(values)} are not whole numbers; uniform takes others")
    return Whole(int(lower), int(upper))


def _parts(values: object) -> tuple[float, float]:
    lower, upper = _range(values)
    if not 0 <= lower <= upper <= 1:
        raise InputError(f"{short(values)} are not parts of a motion, from 0 to 1")
    return lower, upper


_ANY: Final = {"joint": AnyJoint()} | {f"joint with {switch}": AnyJoint(switch) for switch in SWITCHES}


def _any(what: object) -> AnyJoint:
    return _ANY[known("any", what, _ANY)]


_DRAWS: Final[Mapping[str, Callable[[object], Draw]]] = {
    "choose": _choose,
    "uniform": lambda values: Uniform(*_range(values)),
    "log_uniform": _log_uniform,
    "whole": _whole,
    "any": _any,
    "part_of_motion": lambda values: PartOfMotion(*_parts(values)),
    "on_the_way": lambda values: OnTheWay(*_parts(values)),
}
"""The keys that make a table of a single key a draw."""
