"""What every method makes: the edges of one axis' CLK and DIR pins, in counts of the board's 72 MHz timer."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steptwin.bench.loads import Int64Array
from steptwin.bench.pulses.motions import PlannedMotion

Int8Array = NDArray[np.int8]


@dataclass(frozen=True, slots=True, eq=False)
class AxisPulses:
    """One axis' edges; t = 0 is count 0, and DIR is low before its first edge.

    Attributes:
        rise_counts: shape (steps,), sorted: each CLK rise.
        fall_counts: shape (steps,): the fall that ends each pulse.
        dir_counts: shape (d,), sorted: each change of DIR.
        dir_levels: shape (d,): the level after it; high counts up.
    """

    rise_counts: Int64Array
    fall_counts: Int64Array
    dir_counts: Int64Array
    dir_levels: Int8Array

    @classmethod
    def of(cls, rises: Int64Array, direction: Int64Array, steplen_counts: int) -> "AxisPulses":
        """From rises, and DIR edges as 2 * counts + level; pulses of one length, cut short only by the next rise."""
        falls = rises + steplen_counts
        falls[:-1] = np.minimum(falls[:-1], rises[1:])
        return cls(rises, falls, direction >> 1, (direction & 1).astype(np.int8))

    @property
    def signs(self) -> Int8Array:
        """Shape (steps,): +1 or -1, by the level of DIR at each rise."""
        levels = np.concatenate((np.zeros(1, np.int8), self.dir_levels))
        at_rise = levels[np.searchsorted(self.dir_counts, self.rise_counts, side="right")]
        return (2 * at_rise - 1).astype(np.int8)


class Placed(NamedTuple):
    """What a method made of a motion, axis by axis, and how long the placing took on this machine."""

    axes: list[AxisPulses]
    wall_s: float


@dataclass(frozen=True, slots=True)
class Method:
    """One way to make step pulses."""

    key: str
    """A short name without spaces."""
    title: str
    place: Callable[[PlannedMotion], Placed]
