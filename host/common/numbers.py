"""Read numbers in texts from outside, in one notation: ASCII digits, a point, an exponent."""

import csv
from collections.abc import Iterator, Sequence
from reprlib import repr as short
from typing import Final, TextIO

from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import LINE_CHARS_MAX

LARGEST: Final = 1e9
"""Largest size of a number from outside: no length, time, count or rate of a machine is larger."""


def finite_number(text: str) -> float:
    """Return the number that a text spells; raise InputError unless it is finite and at most LARGEST in size."""
    try:
        value = decimal(text)
    except ValueError:
        raise InputError(f"{short(text)} is not a number") from None
    if not abs(value) <= LARGEST:
        raise InputError(f"{short(text)} is not a finite number up to {LARGEST:g}")
    return value


def decimal(text: str) -> float:
    """Return the number that a text spells, infinite or not a number too.

    Raises:
        ValueError: the text is not a number. Python's `float` also takes `1_0`, and the digits of every script.
    """
    _check_notation(text)
    return float(text)


def whole(text: str, base: int = 10) -> int:
    """Return the whole number that a text spells; base 0 also takes 0x, 0o and 0b. Raises as `decimal` does."""
    _check_notation(text)
    return int(text, base)


DIGITS_MAX: Final = 18
"""Digits of the longest whole number that is read: it fits 64 bits, and Python itself refuses those of thousands."""


def digits_in(text: str) -> int | None:
    """Return the whole number that a text of decimal digits spells; None for any other, and for a very long one."""
    is_number = text.isascii() and text.isdecimal() and len(text) <= DIGITS_MAX
    return int(text) if is_number else None


def _check_notation(text: str) -> None:
    if "_" in text or not text.isascii():
        raise ValueError(f"{short(text)} is not a number in ASCII digits")


def numbered_lines(file: TextIO) -> Iterator[tuple[int, str]]:
    """Yield each line that holds something, with its number; lines that begin with # hold nothing."""
    i = 0
    while line := file.readline(LINE_CHARS_MAX + 1):
        i += 1
        if len(line) > LINE_CHARS_MAX:
            raise InputError(f"line {i}: has more than {LINE_CHARS_MAX} characters")
        if line.strip() and line.strip()[0] != "#":
            yield i, line.removesuffix("\n")


def fields_of(i: int, line: str) -> list[str]:
    """Return the fields of one line; a quoted field that continues in the next line is an error."""
    try:
        (fields,) = csv.reader([line], strict=True)
    except csv.Error as error:
        raise InputError(f"line {i}: is not CSV: {error}") from error
    return [field.strip() for field in fields]


def numbers_of(i: int, fields: Sequence[str], header: Sequence[str]) -> list[float]:
    """Return the numbers in the fields of a line, one for each column of the header."""
    if len(fields) != len(header):
        raise InputError(f"line {i}: {len(fields)} fields, the header has {len(header)}")
    values = []
    for field, name in zip(fields, header, strict=True):
        try:
            values.append(finite_number(field))
        except InputError as error:
            raise InputError(f"line {i}, {name}: {error}") from error
    return values


def check_once(names: Sequence[str]) -> None:
    """Raise InputError, with the first of them, if names of columns appear several times."""
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"column {short(name)} appears {names.count(name)} times")
