"""The counted motion: a driver's accepted steps as a counter over the trajectory's time."""

from dataclasses import dataclass

import numpy as np

from host.trajectory import FloatArray
from host.verify.evidence import COUNTS_PER_SECOND, AxisEvidence, Int8Array, Int64Array


@dataclass(frozen=True, slots=True)
class CountedSteps:
    """One axis' accepted steps since the trajectory's t = 0.

    Attributes:
        time_s: shape (steps,), the trajectory's time of each.
        signs: shape (steps,), +1 or -1.
        counters: shape (steps + 1,), the driver's count before each step, then after the last.
    """

    time_s: FloatArray
    signs: Int8Array
    counters: Int64Array

    @property
    def start_steps(self) -> int:
        """The driver's count at t = 0."""
        return int(self.counters[0])

    @property
    def end_steps(self) -> int:
        """The driver's count after the last step."""
        return int(self.counters[-1])

    def before(self, t_s: FloatArray) -> Int64Array:
        """The count just before each instant."""
        count: Int64Array = self.counters[np.searchsorted(self.time_s, t_s, side="left")]
        return count

    def after(self, t_s: FloatArray) -> Int64Array:
        """The count just after each instant."""
        count: Int64Array = self.counters[np.searchsorted(self.time_s, t_s, side="right")]
        return count


def counted_steps(axis: AxisEvidence, start_counts: int) -> CountedSteps:
    """The steps that belong to the trajectory; earlier ones only set where it starts."""
    first = int(np.searchsorted(axis.step_counts, start_counts, side="left"))
    signs = axis.step_signs[first:]
    start = axis.start_steps + int(axis.step_signs[:first].sum(dtype=np.int64))
    counters = start + np.concatenate(([0], np.cumsum(signs, dtype=np.int64)))
    return CountedSteps((axis.step_counts[first:] - start_counts) / COUNTS_PER_SECOND, signs, counters)
