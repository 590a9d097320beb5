"""The part of a run that a picture of single edges shows."""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from host.trajectory import FloatArray
from host.verify import Comparison

_INTERVALS: Final = 12
"""How many intervals of the fastest axis are shown, unless something else is asked for."""


@dataclass(frozen=True, slots=True)
class Moment:
    """An instant, as time of the motion, and how much is shown around it, half of that on each side."""

    at_s: float
    span_s: float

    @classmethod
    def of_fastest(cls, comparison: Comparison) -> Self:
        """Around the shortest interval between two steps of an axis the same way; without one the whole motion."""
        shortest = [found for i in range(len(comparison.joint_names)) if (found := _shortest(comparison, i))]
        if not shortest:
            duration_s = comparison.plan.trajectory.duration_s
            return cls(duration_s / 2.0, duration_s)
        interval_s, at_s = min(shortest)
        return cls(at_s, _INTERVALS * interval_s)

    @classmethod
    def around(cls, comparison: Comparison, at_s: float) -> Self:
        """Around an instant, with some intervals of the axis that is fastest there, but at most the whole motion."""
        intervals_s = [_interval_s(counted.time_s, at_s) for counted in comparison.counted if counted.time_s.size > 1]
        spans_s = [_INTERVALS * interval_s for interval_s in intervals_s]
        return cls(at_s, min([*spans_s, comparison.plan.trajectory.duration_s]))

    @property
    def from_s(self) -> float:
        """Where the part begins."""
        return self.at_s - self.span_s / 2.0

    @property
    def to_s(self) -> float:
        """Where it ends."""
        return self.at_s + self.span_s / 2.0


def _shortest(comparison: Comparison, axis: int) -> tuple[float, float] | None:
    """One axis' shortest interval and its middle."""
    counted = comparison.counted[axis]
    same_way = np.flatnonzero(counted.signs[1:] == counted.signs[:-1])
    if same_way.size == 0:
        return None
    intervals_s = np.diff(counted.time_s)
    first = int(same_way[np.argmin(intervals_s[same_way])])
    return float(intervals_s[first]), float(counted.time_s[first : first + 2].mean())


def _interval_s(times_s: FloatArray, at_s: float) -> float:
    """The interval between the two steps around an instant; the nearest one before the first and after the last."""
    first = int(np.clip(np.searchsorted(times_s, at_s) - 1, 0, times_s.size - 2))
    return float(times_s[first + 1] - times_s[first])
