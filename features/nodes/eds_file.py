"""Read the text of an EDS or DCF (CiA 306): its sections, and the numbers in them.

Windows programs write EDS files: keys and sections in capital or small letters, one value a line, sometimes after
spaces, and comments after a semicolon.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from steptwin.host.common.bad_input import printable, shortened
from steptwin.host.common.errors import InputError

DIGITS_MAX: Final = 40
"""Longest number in characters; 64 bits have up to 22 in octal."""

_SECTION: Final = re.compile(r"\[\s*([^\[\]]+?)\s*\]")
_COMMENT: Final = re.compile(r"(?:^|\s);.*")
_AROUND_SIGN: Final = re.compile(r"\s*([+-])\s*")
_TERM: Final = re.compile(r"([+-]?)(\$nodeid|0x[0-9a-f]+|0[0-7]*|[1-9][0-9]*)", re.ASCII)
"""A term of a sum: the node id, or a number as C writes it; 0 leads an octal one."""


@dataclass(frozen=True, slots=True)
class EdsSection:
    """A section of the file.

    Attributes:
        name: name in the file.
        values: values by keys in small letters.
    """

    name: str
    values: Mapping[str, str]

    def text(self, key: str) -> str:
        """Return a value, or an empty text."""
        return self.values.get(key.lower(), "")

    def required(self, key: str) -> str:
        """Return a value; raise InputError if it is missing."""
        if value := self.text(key):
            return value
        raise InputError(f"[{self.name}] has no {key}")

    def number(self, key: str, node_id: int = 0) -> int | None:
        """Return a whole number; None if it is missing. Raises InputError for another text."""
        value = self.text(key)
        if not value:
            return None
        try:
            return whole_number(value, node_id)
        except ValueError as error:
            raise self.refused(key, str(error)) from error

    def refused(self, key: str, why: str) -> InputError:
        """Return the error about a value."""
        return InputError(f"[{self.name}] {key}={shortened(printable(self.text(key)))}: {why}")


def whole_number(text: str, node_id: int) -> int:
    """Return the sum of numbers and node ids in a text such as `$NODEID+0x180`.

    Raises:
        ValueError: the text is something else.
    """
    left, total, terms = _AROUND_SIGN.sub(r"\1", text.lower()), 0, 0
    if len(left) > DIGITS_MAX:
        raise ValueError(f"is longer than {DIGITS_MAX} characters")
    while left:
        found = _TERM.match(left)
        if found is None or (terms and not found[1]):
            raise ValueError("is no whole number: these are 8, 0x8, octal 010, and sums with $NODEID")
        size = node_id if found[2] == "$nodeid" else _number(found[2])
        total += -size if found[1] == "-" else size
        left, terms = left[found.end() :], terms + 1
    if not terms:
        raise ValueError("is no whole number")
    return total


def _number(digits: str) -> int:
    if digits.startswith("0x"):
        return int(digits, 16)
    return int(digits, 8 if digits[0] == "0" else 10)


def read_sections(text: str) -> dict[str, EdsSection]:
    """Return the sections of a file by their names in small letters.

    Raises InputError, with the line, for a line without a section, a line that is neither a section nor a value, and a
    repeated one.
    """
    sections: dict[str, EdsSection] = {}
    values: dict[str, str] | None = None
    name = ""
    for number, raw in enumerate(text.split("\n"), 1):
        line = _COMMENT.sub("", raw).strip()
        if not line:
            continue
        if found := _SECTION.fullmatch(line):
            name, values = found[1], {}
            if name.lower() in sections:
                raise InputError(f"line {number}: [{_shown(name)}] is there twice")
            sections[name.lower()] = EdsSection(name, values)
            continue
        key, equals, value = line.partition("=")
        if not equals or values is None:
            where = "before any section" if values is None else f"in [{_shown(name)}]"
            raise InputError(f"line {number}: {_shown(line)!r} {where} is no key with its value")
        key = key.strip().lower()
        if key in values:
            raise InputError(f"line {number}: [{_shown(name)}] has {_shown(key)} twice")
        values[key] = value.strip()
    return sections


def _shown(text: str) -> str:
    return shortened(printable(text))
