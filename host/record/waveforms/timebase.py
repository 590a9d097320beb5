"""Hold the time scale of a waveform file and the window of the record that it shows."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.common.arrays import Int64Array
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True)
class TimeScale:
    """Unit of the instants in a file; instants are rounded to the nearest unit, so they are at most half a unit off.

    A number of units lasts exactly as long as a number of counts: 5 units of 100 ns are 36 counts of 72 MHz.

    Attributes:
        vcd: the unit in the syntax of VCD files.
        units: number of units in `counts` counts.
        counts: number of counts of 72 MHz in `units` units.
    """

    vcd: str
    units: int
    counts: int

    def rounded(self, counts: Int64Array) -> Int64Array:
        """Return instants in units; half a unit is rounded up."""
        units: Int64Array = (2 * self.units * counts + self.counts) // (2 * self.counts)
        return units

    def unit(self, counts: int) -> int:
        """Return one instant in units."""
        return int(self.rounded(np.array([counts], dtype=np.int64))[0])

    def last_counts(self, unit: int) -> int:
        """Return the last count that is rounded to the unit or to an earlier one."""
        return -(-self.counts * (2 * unit + 1) // (2 * self.units)) - 1


SCALES: Final = {
    "1us": TimeScale("1 us", 1, 72),
    "100ns": TimeScale("100 ns", 5, 36),
    "10ns": TimeScale("10 ns", 25, 18),
}
"""Time scales by their names on the command line, the coarsest first: sigrok's time and memory for a file grow with the
units in it, not with the changes. A count lasts 13.9 ns: at 10 ns no two counts share a unit."""

COUNTS: Final = TimeScale("", 1, 1)
"""The scale without rounding."""

NANOSECONDS: Final = TimeScale("1 ns", 125, 9)


@dataclass(frozen=True, slots=True)
class Window:
    """The part of a record that a file shows, in counts since power-up.

    Attributes:
        from_counts: beginning; a change at this instant is part of the initial values.
        to_counts: end; a change at this instant is still shown.
        start_counts: instant of the motion's t = 0.
    """

    from_counts: int
    to_counts: int
    start_counts: int

    def time_s(self, counts: int) -> float:
        """Return an instant in the motion's time."""
        return (counts - self.start_counts) / COUNTS_PER_SECOND

    def counts(self, t_s: float) -> int:
        """Return an instant of the motion's time in counts."""
        return self.start_counts + round(t_s * COUNTS_PER_SECOND)
