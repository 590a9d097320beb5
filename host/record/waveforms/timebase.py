"""Time in waveforms: the scale of a file, in whole units of which it gives instants, and the part that is shown."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.verify.evidence import Int64Array
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True)
class TimeScale:
    """The unit of a file's instants. They are rounded to the nearest one, so they are at most half a unit off.

    Attributes:
        vcd: the unit as a VCD file has it.
        units: so many of them last as long as
        counts: so many counts of 72 MHz.
    """

    vcd: str
    units: int
    counts: int

    def rounded(self, counts: Int64Array) -> Int64Array:
        """Instants in units; half a unit is rounded up."""
        units: Int64Array = (2 * self.units * counts + self.counts) // (2 * self.counts)
        return units

    def unit(self, counts: int) -> int:
        """A single instant."""
        return int(self.rounded(np.array([counts], dtype=np.int64))[0])

    def last_counts(self, unit: int) -> int:
        """The last count that is rounded to a unit or to one before it."""
        return -(-self.counts * (2 * unit + 1) // (2 * self.units)) - 1


SCALES: Final = {
    "1us": TimeScale("1 us", 1, 72),
    "100ns": TimeScale("100 ns", 5, 36),
    "10ns": TimeScale("10 ns", 25, 18),
}
"""By their names on the command line. A count lasts 13.9 ns: at 10 ns no two of them share a unit."""

DEFAULT_SCALE: Final = SCALES["1us"]
"""The coarsest: what sigrok takes for a file grows with the units in it, not with the changes."""

COUNTS: Final = TimeScale("", 1, 1)
"""Nothing is rounded."""

NANOSECONDS: Final = TimeScale("1 ns", 125, 9)


@dataclass(frozen=True, slots=True)
class Window:
    """The part of a record that is shown, in counts since power-up.

    Attributes:
        from_counts: where it begins; a change at this very instant is seen in the initial values.
        to_counts: where it ends; a change at this very instant is still shown.
        start_counts: t = 0 of the motion.
    """

    from_counts: int
    to_counts: int
    start_counts: int

    def time_s(self, counts: int) -> float:
        """An instant in the motion's time."""
        return (counts - self.start_counts) / COUNTS_PER_SECOND

    def counts(self, t_s: float) -> int:
        """An instant of the motion's time in counts."""
        return self.start_counts + round(t_s * COUNTS_PER_SECOND)
