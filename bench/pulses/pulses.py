"""Describe what every method makes: CLK and DIR edges of each axis, in counts of the board's 72 MHz timer."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from steptwin.bench.pulses.motions import PlannedMotion
from steptwin.host.common.arrays import Int8Array, Int64Array


@dataclass(frozen=True, slots=True, eq=False)
class AxisPulses:
    """Edges of one axis; t = 0 is count 0, and DIR is low before its first edge.

    Attributes:
        rise_counts: CLK rises, sorted, shape (steps,).
        fall_counts: the fall that ends each pulse, shape (steps,).
        dir_counts: changes of DIR, sorted, shape (d,).
        dir_levels: level after each change, shape (d,); high counts up.
    """

    rise_counts: Int64Array
    fall_counts: Int64Array
    dir_counts: Int64Array
    dir_levels: Int8Array

    @classmethod
    def of(cls, rises: Int64Array, direction: Int64Array, steplen_counts: int) -> "AxisPulses":
        """Make pulses of one length, shortened only by the next rise; `direction` holds 2 * counts + level."""
        falls = rises + steplen_counts
        falls[:-1] = np.minimum(falls[:-1], rises[1:])
        return cls(rises, falls, direction >> 1, (direction & 1).astype(np.int8))

    @property
    def signs(self) -> Int8Array:
        """+1 or -1 for each step, by the level of DIR at its rise, shape (steps,)."""
        levels = np.concatenate((np.zeros(1, np.int8), self.dir_levels))
        at_rise = levels[np.searchsorted(self.dir_counts, self.rise_counts, side="right")]
        return (2 * at_rise - 1).astype(np.int8)


class Placed(NamedTuple):
    """Pulses of each axis that a method made of a motion, and the time that placing them took on this machine."""

    axes: list[AxisPulses]
    wall_s: float


@dataclass(frozen=True, slots=True)
class Method:
    """One way of making step pulses."""

    key: str
    """A short name without spaces."""
    title: str
    place: Callable[[PlannedMotion], Placed]
