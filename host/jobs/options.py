"""From texts on the command line to a job's options: a frozen dataclass of enums and ranged numbers."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import Enum
from math import isfinite
from typing import Any, TypeVar

from host.errors import InputError
from host.inputs import unknown

Options = TypeVar("Options")


@dataclass(frozen=True, slots=True)
class Range:
    """The values that a number may take, ends included."""

    lower: float
    upper: float
    unit: str

    def check(self, name: str, value: float) -> None:
        """InputError, naming the range, for a value outside."""
        if not self.lower <= value <= self.upper:
            limits = f"{self.lower:g}..{self.upper:g} {self.unit}"
            raise InputError(f"option {name}: {value:.9g} {self.unit} is outside {limits}")


def number(default: float, lower: float, upper: float, unit: str) -> Any:
    """A dataclass field for a number with a range. (Any, as `dataclasses.field` pretends its default's type.)"""
    return field(default=default, metadata={"range": Range(lower, upper, unit)})


def parse_options(options: type[Options], texts: Mapping[str, str]) -> Options:
    """The dataclass from its fields' texts; a field's default says whether it is an enum or a number.

    Raises:
        InputError: an unknown name, with the nearest ones, or a bad value, with the choices or the range.
    """
    known = {field.name: field for field in fields(options)}  # type: ignore[arg-type]
    values: dict[str, Enum | float] = {}
    for name, text in texts.items():
        if name not in known:
            raise unknown("option", name, known)
        default = known[name].default
        if isinstance(default, Enum):
            values[name] = _choice(name, text, type(default))
        else:
            values[name] = _number(name, text, known[name].metadata["range"])
    return options(**values)


def _choice(name: str, text: str, choices: type[Enum]) -> Enum:
    names = [str(choice.value) for choice in choices]
    if text not in names:
        raise InputError(f"option {name}: {text!r} is none of {', '.join(names)}")
    return choices(text)


def _number(name: str, text: str, allowed: Range) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise InputError(
            f"option {name}: {text!r} is no number of {allowed.unit} in {allowed.lower:g}..{allowed.upper:g}"
        )
    allowed.check(name, value)
    return value
