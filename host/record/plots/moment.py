"""Choose the part of a run that a picture of single edges shows."""

from dataclasses import dataclass

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.verify import Comparison
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True)
class Moment:
    """An instant in motion time and the span shown around it, half of the span on each side."""

    at_s: float
    span_s: float

    @property
    def from_s(self) -> float:
        """Beginning of the part."""
        return self.at_s - self.span_s / 2.0

    @property
    def to_s(self) -> float:
        """End of the part."""
        return self.at_s + self.span_s / 2.0

    @property
    def label(self) -> str:
        """Label of the axis of `shown_ms`."""
        return around(self.at_s, decimals=6)

    def shown_ms(self, times_s: FloatArray) -> FloatArray:
        """Return motion times in milliseconds relative to the instant."""
        shown: FloatArray = 1e3 * (times_s - self.at_s)
        return shown


@dataclass(frozen=True, slots=True)
class View:
    """The part of a run that a user asks for; None leaves the choice to the picture."""

    at_s: float | None = None
    span_s: float | None = None

    def moment(self, comparison: Comparison, intervals: int) -> Moment:
        """Return the part to show: by default around the fastest pulses, `intervals` of their intervals long.

        Pulses count whether the driver accepts them or not. At an instant that the user asks for, the axis that is
        fastest there decides the span, which is never longer than the whole motion.
        """
        duration_s = comparison.expected.trajectory.duration_s
        if self.at_s is None:
            interval_s, at_s = _fastest(comparison)
        else:
            interval_s, at_s = _shortest_at(comparison, self.at_s), self.at_s
        return Moment(at_s, min(intervals * interval_s, duration_s) if self.span_s is None else self.span_s)


def around(at_s: float, decimals: int = 4) -> str:
    """Return the label of an axis of time that zooms in on an instant and shows milliseconds from it."""
    return f"around t = {at_s:.{decimals}f} s, in ms"


def interval_around(times_s: FloatArray, at_s: float) -> float | None:
    """Return the length of the interval around an instant; None before the first time and after the last."""
    after = int(np.searchsorted(times_s, at_s))
    return float(times_s[after] - times_s[after - 1]) if 0 < after < times_s.size else None


def pulse_times(comparison: Comparison, axis: int) -> FloatArray:
    """Return when STEP rose, from the motion's start on, whether the driver counted the pulse or not."""
    rises = comparison.evidence.axes[axis].clk_rise_counts - comparison.evidence.start_counts
    times_s: FloatArray = rises[rises >= 0] / COUNTS_PER_SECOND
    return times_s


def _fastest(comparison: Comparison) -> tuple[float, float]:
    """Return the shortest interval of any axis and its middle; the whole motion if no axis has an interval."""
    duration_s = comparison.expected.trajectory.duration_s
    found = [_shortest(comparison, i) for i in range(len(comparison.joint_names))]
    return min((one for one in found if one), default=(duration_s, duration_s / 2.0))


def _shortest_at(comparison: Comparison, at_s: float) -> float:
    """Return the shortest interval of all axes at an instant; the whole motion if no axis has an interval."""
    times = [pulse_times(comparison, i) for i in range(len(comparison.joint_names))]
    intervals_s = [_interval_s(time_s, at_s) for time_s in times if time_s.size > 1]
    return min(intervals_s, default=comparison.expected.trajectory.duration_s)


def _shortest(comparison: Comparison, axis: int) -> tuple[float, float] | None:
    """Return one axis' shortest interval between pulses without a change of DIR, and its middle."""
    times_s = pulse_times(comparison, axis)
    turns_s = (comparison.evidence.axes[axis].dir_edge_counts - comparison.evidence.start_counts) / COUNTS_PER_SECOND
    same_way = np.flatnonzero(np.diff(np.searchsorted(turns_s, times_s)) == 0)
    if same_way.size == 0:
        return None
    intervals_s = np.diff(times_s)
    first = int(same_way[np.argmin(intervals_s[same_way])])
    return float(intervals_s[first]), float(times_s[first : first + 2].mean())


def _interval_s(times_s: FloatArray, at_s: float) -> float:
    """Return the interval between the two pulses around an instant, or the nearest interval."""
    first = int(np.clip(np.searchsorted(times_s, at_s) - 1, 0, times_s.size - 2))
    return float(times_s[first + 1] - times_s[first])
