"""Read tables of TOML and JSON documents that may contain anything.

A reader asks for each value by its key and type. The InputError for a wrong value begins with the key, as in
`joints.th1.microsteps: 8.5 is not a whole number`.
"""

import json
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from enum import StrEnum
from math import inf
from reprlib import repr as short
from typing import Final, TypeVar

from steptwin.host.common.bad_input import nearest_within, outside, prefixed, printable, shortened, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import LARGEST

Choice = TypeVar("Choice", bound=StrEnum)
Made = TypeVar("Made")


_KEY_PARTS_MAX: Final = 16
"""Parts of a dotted key, as in joints.th1.link.length_mm: the time to read a key rises with the cube of them."""
_LONG_KEY: Final = re.compile(rf"""(?:\.[ \t]*+(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+){{{_KEY_PARTS_MAX}}}""")


def toml_table(text: str) -> "Table":
    """Return the table of a TOML text; raise InputError for any other text."""
    if deep := _LONG_KEY.search(text):
        line = text.count("\n", 0, deep.start()) + 1
        raise InputError(f"line {line}: {short(deep[0][1:])} is more than {_KEY_PARTS_MAX} keys joined by points")
    try:
        return Table(tomllib.loads(text), "table")
    except RecursionError as error:
        raise InputError("is not TOML that can be read: brackets within brackets") from error
    except ValueError as error:  # also an integer of thousands of digits
        raise InputError(f"is not TOML: {error}{_line_of(str(error), text)}") from error


_TOML_PLACE: Final = re.compile(r"\(at line (\d+), column \d+\)$")


def _line_of(message: str, text: str) -> str:
    """Return, after a colon, the line of the text that the message of a TOML error names; nothing without one."""
    place = _TOML_PLACE.search(message)
    lines = text.split("\n")
    line = lines[int(place[1]) - 1].strip() if place and int(place[1]) <= len(lines) else ""
    return f": {shortened(printable(line))}" if line else ""


def json_table(text: str) -> "Table":
    """Return the object of a JSON text; raise InputError for any other text."""
    try:
        document = json.loads(text)
    except RecursionError as error:
        raise InputError("is not JSON that can be read: brackets within brackets") from error
    except ValueError as error:
        raise InputError(f"is not JSON: {error}") from error
    return Table(document, "JSON object")


def number_at(place: str, value: object) -> float:
    """Return a value as a number; raise InputError, with its place in front, unless it is one up to LARGEST in size."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{place}: {short(value)} is not a number")
    if not abs(value) <= LARGEST:
        raise InputError(f"{place}: {short(value)} is not a finite number up to {LARGEST:g}")
    return float(value)


def check_name(name: str, chars_max: int) -> None:
    """Raise InputError unless a name has at most so many characters, all of them printable."""
    if len(name) > chars_max:
        raise InputError(f"{short(name)} has {len(name)} characters: a name has at most {chars_max}")
    if not name.isprintable():
        raise InputError(f"{name!r} has characters that cannot be printed")


class Table:
    """A table of a document, whose values are read by key and type.

    Every reading method raises InputError, with the key in front, if the key is missing or its value is of another
    type or out of range.

    Attributes:
        values: the values by key.
    """

    def __init__(self, values: object, kind: str) -> None:
        """Raise InputError unless `values` is a mapping; `kind` names tables in that message."""
        if not isinstance(values, dict):
            raise InputError(f"{short(values)} is not a {kind}")
        self.values: Mapping[str, object] = values
        self._kind = kind

    def __iter__(self) -> Iterator[str]:
        return iter(self.values)

    def __contains__(self, key: str) -> bool:
        """Return whether an optional key is there."""
        return key in self.values

    def text(self, key: str, *, empty: bool = True) -> str:
        """Return a text, which may be empty only if `empty` is true."""
        value = self._take(key)
        if not isinstance(value, str) or not (value or empty):
            raise InputError(f"{key}: {short(value)} is not a text")
        return value

    def number(self, key: str, least: float = -LARGEST, most: float = LARGEST, unit: str = "") -> float:
        """Return a finite number from `least` to `most`, at most LARGEST in size; `unit` is for the message."""
        value = number_at(key, self._take(key))
        if value < least and most == LARGEST:
            raise InputError(f"{key}: {value:g}{f' {unit}' if unit else ''} is below {least:g}")
        if not least <= value <= most:
            nearest_value = nearest_within(value, least, most, unit).rstrip()
            raise InputError(f"{key}: {outside(value, least, most, unit)}{nearest_value}")
        return value

    def integer(self, key: str, largest: float = LARGEST, least: float = -inf) -> int:
        """Return a whole number from `least` on, of at most `largest` in size."""
        value = self._take(key)
        if isinstance(value, bool) or not isinstance(value, int):
            raise InputError(f"{key}: {short(value)} is not a whole number")
        if value < least:
            raise InputError(f"{key}: {short(value)} is below {least:g}")
        if abs(value) > largest:
            limit = largest if isinstance(largest, int) else f"{largest:g}"
            raise InputError(f"{key}: {short(value)} is not a whole number up to {limit}")
        return value

    def truth(self, key: str) -> bool:
        """Return true or false."""
        value = self._take(key)
        if not isinstance(value, bool):
            raise InputError(f"{key}: {short(value)} is neither true nor false")
        return value

    def is_null(self, key: str) -> bool:
        """Return whether a JSON value is null."""
        return self._take(key) is None

    def choice(self, key: str, choices: type[Choice]) -> Choice:
        """Return the member of an enumeration with the text as its value."""
        value = self.text(key)
        if value not in list(choices):
            raise InputError(f"{key}: {value!r} is not one of {', '.join(choices)}")
        return choices(value)

    def elements(self, key: str) -> list[object]:
        """Return the values of a list, unchecked."""
        value = self._take(key)
        if not isinstance(value, list):
            raise InputError(f"{key}: {short(value)} is not a list")
        return value

    def each(self, key: str, make: Callable[["Table"], Made]) -> tuple[Made, ...]:
        """Return `make(table)` for every table in a list."""
        made = []
        for i, value in enumerate(self.elements(key)):
            with prefixed(f"{key}[{i}]: "):
                made.append(make(Table(value, self._kind)))
        return tuple(made)

    @contextmanager
    def section(self, key: str) -> Iterator["Table"]:
        """Enter the table under a key; errors in the block get the key in front."""
        value = self._take(key)
        with prefixed(f"{key}: "):
            table = Table(value, self._kind)
        with prefixed(f"{key}."):
            yield table

    def check_keys(self, allowed: Iterable[str]) -> None:
        """Raise InputError, with the nearest allowed keys, if there are keys that are not allowed."""
        allowed = list(allowed)
        if strange := [key for key in self.values if key not in allowed]:
            raise InputError(*(f"{shortened(key)}: {unknown('key', key, allowed)}" for key in strange))

    def _take(self, key: str) -> object:
        if key not in self.values:
            raise InputError(f"{key}: is missing")
        return self.values[key]
