"""The counted motion: a driver's accepted steps as a counter over the trajectory's time."""

from dataclasses import dataclass

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.verify.evidence import AxisEvidence, Int8Array, Int64Array
from steptwin.protocol.timer import COUNTS_PER_SECOND


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

    def around(self, t_s: FloatArray) -> Int64Array:
        """The counts just before each of n sorted instants and just after it, shape (2, n).

        The steps are looked up in the instants, not these in the steps: where the instants are all axes' steps, those
        of one are far fewer.
        """
        first, last = np.searchsorted(self.time_s, t_s[0], "left"), np.searchsorted(self.time_s, t_s[-1], "right")
        steps_s = self.time_s[first:last]
        seen_at = [np.searchsorted(t_s, steps_s, side) for side in ("right", "left")]
        made = np.cumsum([np.bincount(at, minlength=t_s.size)[: t_s.size] for at in seen_at], axis=1)
        counts: Int64Array = self.counters[first + made]
        return counts


def counted_steps(axis: AxisEvidence, start_counts: int) -> CountedSteps:
    """The steps that belong to the trajectory; earlier ones only set where it starts."""
    first = int(np.searchsorted(axis.step_counts, start_counts, side="left"))
    signs = axis.step_signs[first:]
    start = axis.start_steps + int(axis.step_signs[:first].sum(dtype=np.int64))
    counters = start + np.concatenate(([0], np.cumsum(signs, dtype=np.int64)))
    return CountedSteps((axis.step_counts[first:] - start_counts) / COUNTS_PER_SECOND, signs, counters)
