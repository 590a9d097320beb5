"""The SI units of a drive (60A8h to 60AAh): words with a power of ten, a unit and a time, as turns of the shaft."""

from collections.abc import Callable, Mapping
from fractions import Fraction
from math import pi
from typing import Final

from steptwin.protocol import od
from steptwin.protocol.dictionary import UserUnit
from steptwin.protocol.entry import EntryUnit

_TAU: Final = Fraction(2 * pi).limit_denominator(10**9)
_INCREMENTS, _REVOLUTIONS, _RADIANS, _DEGREES, _RPM = 0xB5, 0xB4, 0x10, 0x41, 0xC0
_TURNS: Final[Mapping[int, Callable[[int], Fraction]]] = {
    _INCREMENTS: lambda increments: Fraction(1, increments),
    _REVOLUTIONS: lambda _: Fraction(1),
    _RADIANS: lambda _: 1 / _TAU,
    _DEGREES: lambda _: Fraction(1, 360),
    _RPM: lambda _: Fraction(1, 60),
}
"""Turns, or turns per second, of a unit, from the increments in a turn; by the unit's number."""
_SECONDS: Final = {0x00: 1, 0x03: 1, 0x47: 60}
"""Seconds of the time that divides the unit, by its number: none, a second, a minute."""


def turns_of(word: int, increments: int) -> Fraction:
    """Return the turns, per second if the unit has a time, of the unit in a word of 60A8h to 60AAh.

    Raises:
        ValueError: the word names no unit that is known here.
    """
    exponent, unit, time = (word >> 24 ^ 0x80) - 0x80, word >> 16 & 0xFF, word >> 8 & 0xFF
    if unit not in _TURNS or time not in _SECONDS or word & 0xFF:
        raise ValueError(f"0x{word:08X} names no unit of angles")
    return Fraction(10) ** exponent * _TURNS[unit](increments) / _SECONDS[time]


class DriveUnits:
    """The present units of one node.

    Attributes:
        words: word of each unit (60A8h, 60A9h, 60AAh); a unit without a word is the one before it, per second.
        gear: motor turns and shaft turns of the gear (6091h).
        increments: increments of the encoder in a turn of the motor.
    """

    def __init__(self, words: Mapping[EntryUnit, int], gear: tuple[int, int], increments: int) -> None:
        self.words = dict(words)
        self.gear: Final = gear
        self.increments: Final = increments

    def unit(self, role: EntryUnit) -> UserUnit:
        """Return the size of a unit in wire units of its role.

        Raises:
            ValueError: a word names no unit.
        """
        turns = Fraction(0)
        for each in (EntryUnit.POSITION, EntryUnit.VELOCITY, EntryUnit.ACCELERATION, EntryUnit.JERK):
            if each in self.words:
                turns = turns_of(self.words[each], self.increments)
            if each is role:
                break
        wire = turns * od.UNITS_PER_REVOLUTION * Fraction(*self.gear)
        return UserUnit(wire.numerator, wire.denominator)
