"""Read in which units an axis takes and reports positions: a master may have chosen them (CiA 402-2, factor group).

StepTwin's commands count in wire units, those of an axis after power-up. A board whose units are others is not set back
by them: the master that has chosen them may still be there.
"""

from typing import Final, NamedTuple

from steptwin.host.client.axis import AxisClient
from steptwin.host.common.errors import DeviceFaultError
from steptwin.protocol import od
from steptwin.protocol.cia402 import INCREMENTS, SI_UNITS
from steptwin.protocol.dictionary import FACTORS


class AxisUnits(NamedTuple):
    """The factor objects of an axis: gear ratio (6091h), feed constant (6092h) and SI unit (60A8h) of positions.

    The factors are in the order of `FACTORS`.
    """

    motor_revolutions: int
    shaft_revolutions: int
    feed: int
    feed_revolutions: int
    si_unit: int

    @property
    def are_wire_units(self) -> bool:
        """True if the unit is the wire unit, whatever its name."""
        wire = od.UNITS_PER_REVOLUTION * self.motor_revolutions * self.feed_revolutions
        return wire == self.shaft_revolutions * self.feed

    def __str__(self) -> str:
        gear = f"gear {self.motor_revolutions}:{self.shaft_revolutions}"
        return f"{gear}, feed {self.feed}:{self.feed_revolutions}, in {_unit_text(self.si_unit)}"


WIRE_UNITS: Final = AxisUnits(1, 1, od.UNITS_PER_REVOLUTION, 1, INCREMENTS << 16)
"""The units of an axis after power-up."""


def read_units(axis: AxisClient) -> AxisUnits:
    """Read an axis' units; one that has no such objects counts in wire units and cannot do otherwise."""
    try:
        return AxisUnits(*map(axis.read, (*FACTORS, od.SI_UNIT_POSITION)))
    except DeviceFaultError:
        return WIRE_UNITS


def _unit_text(word: int) -> str:
    """Return the unit that 60A8h names, such as "10^-3 deg"."""
    prefix, unit = (word >> 24 ^ 0x80) - 0x80, SI_UNITS.get(word >> 16 & 0xFF, f"unit 0x{word:08X}")
    return f"10^{prefix} {unit}" if prefix else unit
