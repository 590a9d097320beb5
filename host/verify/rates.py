"""Convert the board's time to the trajectory's, which a pause halts and a change of speed makes slower or faster.

A board records each ramp of the rate at which the time of its interpolating axes passes. The rate is that of the plan
when a motion starts. The trajectory's time is the integral of the rate: by it a motion is compared with its plan,
whatever pauses and speeds it had.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.protocol.od import FULL_RATE_Q16
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True)
class RateRamps:
    """Linear changes of the rate of an axis' time, in order of time; all arrays have shape (n,).

    Attributes:
        counts: instant when each begins.
        from_q16: rate at its beginning; 65 536 is that of the plan.
        to_q16: rate at its end, which stays until the next one.
        lasts_counts: its duration, unless the next one begins earlier.
    """

    counts: Int64Array
    from_q16: Int64Array
    to_q16: Int64Array
    lasts_counts: Int64Array

    def trajectory_s(self, counts: Int64Array, start_counts: int) -> FloatArray:
        """Return the trajectory's time at instants, of any shape; t = 0 is at `start_counts`."""
        began = np.searchsorted(self.counts, start_counts)
        since: FloatArray = (counts - start_counts) / COUNTS_PER_SECOND
        if began == self.counts.size:
            return since
        begin_s = np.append(0.0, (self.counts[began:] - start_counts) / COUNTS_PER_SECOND)
        lasts_s = np.append(0.0, self.lasts_counts[began:] / COUNTS_PER_SECOND)
        from_rate = np.append(1.0, self.from_q16[began:] / FULL_RATE_Q16)
        to_rate = np.append(1.0, self.to_q16[began:] / FULL_RATE_Q16)

        def passed_s(ramp: Int64Array, dt_s: FloatArray) -> FloatArray:
            """Return the trajectory's time that has passed since the beginning of a ramp."""
            ramped_s = np.minimum(dt_s, lasts_s[ramp])
            part = np.divide(ramped_s, lasts_s[ramp], out=np.zeros_like(dt_s), where=lasts_s[ramp] > 0)
            mean = from_rate[ramp] + (to_rate - from_rate)[ramp] * part / 2
            return np.asarray(mean * ramped_s + to_rate[ramp] * (dt_s - ramped_s))

        ramps = np.arange(begin_s.size)
        reached_s = np.append(0.0, np.cumsum(passed_s(ramps[:-1], np.diff(begin_s))))
        at = np.maximum(np.searchsorted(begin_s, since, side="right") - 1, 0)
        return np.asarray(reached_s[at] + passed_s(at, np.asarray(since - begin_s[at])))

    def instant_counts(self, t_s: float, start_counts: int, until_counts: int) -> int:
        """Return the first instant, at most `until_counts`, at which the trajectory has reached a time."""
        low, high = start_counts, until_counts
        while low < high:
            middle = (low + high) // 2
            if float(self.trajectory_s(np.array(middle), start_counts)) < t_s:
                low = middle + 1
            else:
                high = middle
        return low

    def speeds(self, start_counts: int) -> "tuple[SpeedReport, ...]":
        """Return the speeds that a motion has had since its start, with the time when each was begun to be taken."""
        began = int(np.searchsorted(self.counts, start_counts))
        since_s = (self.counts[began:] - start_counts) / COUNTS_PER_SECOND
        times_s = self.trajectory_s(self.counts[began:], start_counts)
        return tuple(
            SpeedReport(round(to * 100 / FULL_RATE_Q16, 2), after_s, t_s, lasts / COUNTS_PER_SECOND)
            for to, after_s, t_s, lasts in zip(
                self.to_q16[began:].tolist(),
                since_s.tolist(),
                times_s.tolist(),
                self.lasts_counts[began:].tolist(),
                strict=True,
            )
        )


@dataclass(frozen=True, slots=True)
class SpeedReport:
    """A change of a motion's speed on the way.

    Attributes:
        percent: the new speed in percent of the planned one; 0 for a pause.
        after_s: time since the motion's start when the change began, by the clock.
        at_s: the trajectory's time then.
        ramp_s: time until the new speed was reached, unless another change came first.
    """

    percent: float
    after_s: float
    at_s: float
    ramp_s: float


_NONE: Final = np.empty(0, dtype=np.int64)
AS_PLANNED: Final = RateRamps(_NONE, _NONE, _NONE, _NONE)
"""Time that has passed as the clock's."""
