"""A path's parameter as a function of time: parabolas between knots, averaged, in runs from rest to rest."""

from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np

from steptwin.features.fastest.shaper import NO_SHAPER, Shaper
from steptwin.host.common.arrays import FloatArray, Int64Array

NO_STOPS: Final = np.zeros(0)
"""The places at which a motion stops on its way, where it does not."""

_HALVINGS: Final = 60
_TIME_S: Final = 1e-9
"""Time within which `times_at` finds an instant, and the halvings after which it has."""


@dataclass(frozen=True, slots=True, eq=False)
class Averaged:
    """The moving average of a parameter that is a parabola between knots, and stretched a little.

    The average is continuous in its acceleration; where the parameter's acceleration is at most a, its jerk is at most
    2 a / average_s. A shaper adds up parts of it. It consists of runs from rest to rest, one without stops. A run lasts
    as long as its parameter, its `average_s` and the last delay of the shaper, rounded up to a whole millisecond: that
    is the stretch. Made by `of`.

    Attributes:
        times_s: shape (n,), the knots before averaging, rising from 0.
        s: shape (n,), the parameter at the knots.
        speeds: shape (n,), its speed at the knots; 0 at both ends of each run.
        areas: shape (n,), the integral of the parameter up to the knots.
        average_s: shape (runs,), times over which they are averaged, above 0.
        rests: shape (runs + 1,), the knots in which runs begin, and the last one.
        begins_s: shape (runs + 1,), whole milliseconds when runs begin, and the end.
        shaper: what the average is shaped by.
    """

    times_s: FloatArray
    s: FloatArray
    speeds: FloatArray
    areas: FloatArray
    average_s: FloatArray
    rests: Int64Array
    begins_s: FloatArray
    shaper: Shaper = NO_SHAPER

    @classmethod
    def of(
        cls,
        s: FloatArray,
        squares: FloatArray,
        average_s: FloatArray | float,
        slower: FloatArray | float = 1.0,
        stops: FloatArray = NO_STOPS,
        shaper: Shaper = NO_SHAPER,
    ) -> Self:
        """Return the average for squares of the speed at places, both of shape (n,); the square is even in between.

        The places do not fall. `slower` is a further stretch of each run, at least 1. `stops` are places at which it
        stops, rising; the squares are 0 there.
        """
        steps, roots = np.diff(s), np.sqrt(squares)
        moved = steps > 0
        dt_s = 2.0 * steps[moved] / (roots[:-1] + roots[1:])[moved]
        keep = np.concatenate([[True], moved])
        own_s, speeds = s[keep], roots[keep]
        times_s = np.concatenate([[0.0], np.cumsum(dt_s)])
        u = np.diff(speeds) / dt_s
        grown = dt_s * (own_s[:-1] + dt_s * (speeds[:-1] / 2.0 + dt_s * u / 6.0))
        areas = np.concatenate([[0.0], np.cumsum(grown)])
        rests = np.concatenate([[0], np.searchsorted(own_s, stops), [len(own_s) - 1]])
        each_s = np.broadcast_to(average_s, len(rests) - 1)
        lasts_ms = np.ceil(1000.0 * slower * (np.diff(times_s[rests]) + each_s + shaper.delays_s[-1]) - 1e-6)
        begins_s = np.concatenate([[0.0], np.cumsum(lasts_ms) / 1000.0])
        return cls(times_s, own_s, speeds, areas, each_s, rests, begins_s, shaper)

    @property
    def duration_s(self) -> float:
        """Duration, a whole number of milliseconds."""
        return float(self.begins_s[-1])

    @property
    def lasts_s(self) -> FloatArray:
        """Shape (runs,), the durations of the runs."""
        return np.diff(self.begins_s)

    @property
    def least_s(self) -> FloatArray:
        """Shape (runs,), the durations before they are stretched."""
        return np.diff(self.times_s[self.rests]) + self.spans_s

    @property
    def spans_s(self) -> FloatArray:
        """Shape (runs,), the times before an instant on which the parameter there depends."""
        return self.average_s + self.shaper.delays_s[-1]

    def at(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the parameter and its speed at times of shape (n,) in [0, duration_s]."""
        run = self.run_at(t_s)
        shrinks = self.least_s / self.lasts_s
        late = (t_s - self.begins_s[run]) * shrinks[run]
        average_s, value, rate = self.average_s[run], np.zeros(len(t_s)), np.zeros(len(t_s))
        for part, delay_s in zip(*self.shaper, strict=True):
            area, s = self._raw(run, late - delay_s)
            area_before, s_before = self._raw(run, late - delay_s - average_s)
            value += part * ((area - area_before) / average_s)
            rate += part * ((s - s_before) / average_s)
        begin, end = self.s[self.rests[run]], self.s[self.rests[run + 1]]
        value = np.where(t_s <= self.begins_s[run], begin, np.where(t_s >= self.begins_s[run + 1], end, value))
        return value, rate * shrinks[run]

    def time_at(self, s: float) -> float:
        """Return the time in seconds when the parameter is first at a value; it rises everywhere in a run."""
        return float(self.times_at(np.array([s]))[0])

    def times_at(self, s: FloatArray) -> FloatArray:
        """Return these times for values of shape (n,), by halving."""
        low_s, high_s = np.zeros(len(s)), np.full(len(s), self.duration_s)
        for _ in range(_HALVINGS):
            if (high_s - low_s <= _TIME_S).all():
                break
            middle_s = (low_s + high_s) / 2.0
            is_before = self.at(middle_s)[0] < s
            low_s, high_s = np.where(is_before, middle_s, low_s), np.where(is_before, high_s, middle_s)
        return high_s

    def run_at(self, t_s: FloatArray) -> Any:
        """Return the runs, the later of two that meet, at times of shape (n,): one number if there is only one run."""
        runs = len(self.begins_s) - 1
        return 0 if runs == 1 else np.clip(np.searchsorted(self.begins_s, t_s, side="right") - 1, 0, runs - 1)

    def _raw(self, run: Any, late_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the integral of the parameter, and the parameter, before averaging; a run stands at both its ends."""
        first, last = self.rests[run], self.rests[run + 1]
        begin_s, end_s = self.times_s[first], self.times_s[last]
        inside = np.clip(begin_s + late_s, begin_s, end_s)
        i = np.clip(np.searchsorted(self.times_s, inside, side="right") - 1, 0, len(self.times_s) - 2)
        dt_s = inside - self.times_s[i]
        u = (self.speeds[i + 1] - self.speeds[i]) / (self.times_s[i + 1] - self.times_s[i])
        s = self.s[i] + dt_s * (self.speeds[i] + dt_s * u / 2.0)
        area = self.areas[i] + dt_s * (self.s[i] + dt_s * (self.speeds[i] / 2.0 + dt_s * u / 6.0))
        area += self.s[first] * np.minimum(late_s, 0.0) + self.s[last] * np.maximum(late_s - (end_s - begin_s), 0.0)
        return area, s
