"""Read numbers in texts from outside, in one notation: ASCII digits, a point, an exponent."""

from reprlib import repr as short
from typing import Final

from steptwin.host.common.errors import InputError

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


def _check_notation(text: str) -> None:
    if "_" in text or not text.isascii():
        raise ValueError(f"{short(text)} is not a number in ASCII digits")
