"""Read a job's options from texts: a frozen dataclass of enums, places, points and numbers with ranges.

A number's default may depend on the robot: a length grows with its reach, for example.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import Field, dataclass, field, fields
from enum import Enum
from reprlib import repr as short
from typing import Any, TypeVar

from steptwin.host.common.bad_input import nearest_within, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import decimal, finite_number
from steptwin.host.robots.robot import Robot

Options = TypeVar("Options")
Choice = TypeVar("Choice")


@dataclass(frozen=True, slots=True)
class OptionRange:
    """Allowed values of a number, with both ends."""

    lower: float
    upper: float
    unit: str

    def __str__(self) -> str:
        return f"{self.lower:g}..{self.upper:g} {self.unit}"


@dataclass(frozen=True, slots=True)
class OptionField:
    """An option for a form: a choice, or a number with its range.

    Attributes:
        name: name of the option.
        default: its default for the robot, a number unless there are choices.
        choices: names to choose from; empty for a number and a point.
        allowed: range of a number; None for a choice and a point.
        whole: True for a whole number.
        form: notation of a value in place of a point's default; empty for others.
    """

    name: str
    default: str | float
    choices: tuple[str, ...] = ()
    allowed: OptionRange | None = None
    whole: bool = False
    form: str = ""

    def is_default(self, text: str) -> bool:
        """Return whether a form's text is the option's default."""
        try:
            return text == self.default or decimal(text) == self.default
        except ValueError:
            return False

    def __str__(self) -> str:
        if isinstance(self.default, str):
            return f"{self.default} ({self.form or ', '.join(self.choices)})"
        return f"{self.default:g} ({self.allowed})"


Fitting = Callable[[Robot], float]
"""A default that depends on the robot."""


def number(default: float, lower: float, upper: float, unit: str, fitting: Fitting | None = None) -> Any:
    """Return a dataclass field for a number with a range, a whole number if the default is an int.

    `fitting` returns the default for a robot.
    """
    return field(default=default, metadata={"range": OptionRange(lower, upper, unit), "fitting": fitting})


Point = tuple[float, float] | None
"""x and y in mm; None for the preset point that the option's default names."""

POINT_FORM = "or X,Y in mm"


def point(preset: str) -> Any:
    """Return a dataclass field for a point; None stands for the preset."""
    return field(default=None, metadata={"preset": preset})


def place(default: str, choices: Callable[[Robot], Iterable[str]]) -> Any:
    """Return a dataclass field for one of a robot's places, returned by `choices`."""
    return field(default=default, metadata={"places": choices})


def joint_position(default: float, joint: str) -> Any:
    """Return a dataclass field for a joint's position, with the robot's limits as range.

    A default outside the limits becomes the nearest limit.
    """
    return field(default=default, metadata={"joint": joint})


def parse_options(options: type[Options], texts: Mapping[str, str], robot: Robot) -> Options:
    """Return the options from their texts; defaults determine the types.

    A default place is checked like a given one, since the robot file may lack it. Raise InputError for an unknown name,
    with the nearest ones, or an invalid value, with the choices or the range.
    """
    known = _fields(options)
    texts = {name.replace("-", "_"): text for name, text in texts.items()}
    for name in texts:
        if name not in known:
            raise unknown("option", name, known)
    places = {name: str(option.default) for name, option in known.items() if "places" in option.metadata}
    values = {name: _value(known[name], text, robot) for name, text in (places | texts).items()}
    fitting = {name: _default(option, robot) for name, option in known.items() if _is_number(option)}
    return options(**{known[name].name: value for name, value in (fitting | values).items()})


def option_fields(options: type[Any], robot: Robot) -> tuple[OptionField, ...]:
    """Return the options with their defaults and valid values for a robot."""
    return tuple(_form_field(option, robot) for option in fields(options))


def describe_options(options: type[Any], robot: Robot) -> dict[str, str]:
    """Return each option's default and valid values as text."""
    return {field.name: str(field) for field in option_fields(options, robot)}


def place_options(options: type[Any]) -> list[str]:
    """Return the names of the options with defaults that depend on the robot: the places of a job."""
    return [name for name, option in _fields(options).items() if option.metadata.get("fitting")]


def _is_number(option: Field[Any]) -> bool:
    return isinstance(option.default, int | float)


def _default(option: Field[Any], robot: Robot) -> float:
    """Return a number's default for a robot."""
    default = option.default
    if not isinstance(default, int | float):
        raise TypeError(option.name)
    if fitting := option.metadata.get("fitting"):
        return float(fitting(robot))
    if "joint" in option.metadata:
        joint = robot.joint(option.metadata["joint"])
        return min(max(default, joint.lower), joint.upper)
    return default


def _fields(options: type[Any]) -> dict[str, Field[Any]]:
    return {_name(option): option for option in fields(options)}


def _name(option: Field[Any]) -> str:
    """Return an option's name; `from`, a Python keyword, is the field `from_`."""
    return option.name.removesuffix("_")


def _form_field(option: Field[Any], robot: Robot) -> OptionField:
    name = _name(option)
    if isinstance(option.default, Enum):
        return OptionField(name, str(option.default.value), tuple(_choices(option.default)))
    if isinstance(option.default, str):
        return OptionField(name, option.default, tuple(_places(option, robot)))
    if "preset" in option.metadata:
        return OptionField(name, option.metadata["preset"], form=POINT_FORM)
    whole = isinstance(option.default, int)
    return OptionField(name, _default(option, robot), allowed=_range(option, robot), whole=whole)


def _value(option: Field[Any], text: str, robot: Robot) -> Enum | str | float | Point:
    name = _name(option)
    if isinstance(option.default, Enum):
        return chosen(name, text, _choices(option.default))
    if isinstance(option.default, str):
        return chosen(name, text, _places(option, robot))
    if "preset" in option.metadata:
        return None if text == option.metadata["preset"] else _point(name, text, option.metadata["preset"])
    value = _number(name, text, _range(option, robot))
    if isinstance(option.default, int):
        return _whole(name, value)
    return value


def _point(name: str, text: str, preset: str) -> tuple[float, float]:
    try:
        x_mm, y_mm = map(finite_number, text.split(","))
    except (InputError, ValueError):
        raise InputError(f"option {name}: {short(text)} is not a point (valid: {preset} {POINT_FORM})") from None
    return x_mm, y_mm


def _places(option: Field[Any], robot: Robot) -> dict[str, str]:
    return {name: name for name in option.metadata["places"](robot)}


def chosen(name: str, text: str, choices: Mapping[str, Choice]) -> Choice:
    """Return the choice of an option's text; raise InputError, with the choices, for another text."""
    if text not in choices:
        raise InputError(f"{unknown(f'option {name}:', text, choices)} (valid: {', '.join(choices)})")
    return choices[text]


def _whole(name: str, value: float) -> int:
    if value != int(value):
        raise InputError(f"option {name}: {value:.9g} is not a whole number")
    return int(value)


def _choices(default: Enum) -> dict[str, Enum]:
    return {str(choice.value): choice for choice in type(default)}


def _number(name: str, text: str, allowed: OptionRange) -> float:
    try:
        value = decimal(text)
    except ValueError:
        raise InputError(f"option {name}: {text!r} is not a number (valid: {allowed})") from None
    if not allowed.lower <= value <= allowed.upper:
        near = nearest_within(value, allowed.lower, allowed.upper, allowed.unit)
        raise InputError(f"option {name}: {value:.9g} {allowed.unit} is outside {allowed}{near}")
    return value


def _range(option: Field[Any], robot: Robot) -> OptionRange:
    if "joint" not in option.metadata:
        allowed: OptionRange = option.metadata["range"]
        return allowed
    joint = robot.joint(option.metadata["joint"])
    return OptionRange(joint.lower, joint.upper, joint.unit)
