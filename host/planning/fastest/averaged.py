"""The parameter of a path as a function of time, averaged over a time that bounds its jerk."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.laws import time_after


@dataclass(frozen=True, slots=True, eq=False)
class Averaged:
    """The moving average over `average_s` of a parameter that is a parabola between knots, and stretched a little.

    The average is continuous in its acceleration; where the parameter's acceleration is at most a, its jerk is at most
    2 a / average_s. Its duration is that of the parameter plus `average_s`, rounded up to a whole millisecond: that is
    the stretch. Made by `of`.

    Attributes:
        times_s: shape (n,), the knots before averaging, rising from 0.
        s: shape (n,), the parameter at the knots.
        speeds: shape (n,), its speed at the knots; 0 at both ends.
        areas: shape (n,), the integral of the parameter up to the knots.
        average_s: time over which it is averaged, above 0.
        duration_s: duration, a whole number of milliseconds.
    """

    times_s: FloatArray
    s: FloatArray
    speeds: FloatArray
    areas: FloatArray
    average_s: float
    duration_s: float

    @classmethod
    def of(cls, s: FloatArray, squares: FloatArray, average_s: float, slower: float = 1.0) -> Self:
        """Return the average for squares of the speed at places, both of shape (n,); the square is even in between.

        The places do not fall. `slower` is a further stretch, at least 1.
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
        duration_s = np.ceil(1000.0 * slower * (times_s[-1] + average_s) - 1e-6) / 1000.0
        return cls(times_s, own_s, speeds, areas, average_s, float(duration_s))

    def at(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the parameter and its speed at times of shape (n,) in [0, duration_s]."""
        shrink = (self.times_s[-1] + self.average_s) / self.duration_s
        late = t_s * shrink
        early = late - self.average_s
        (area, s), (area_before, s_before) = self._raw(late), self._raw(early)
        value = (area - area_before) / self.average_s
        value = np.where(t_s <= 0.0, self.s[0], np.where(t_s >= self.duration_s, self.s[-1], value))
        return value, (s - s_before) / self.average_s * shrink

    def time_at(self, s: float) -> float:
        """Return the time in seconds at which the parameter is first at a value; it rises everywhere in between."""
        return time_after(lambda t_s: float(self.at(np.array([t_s]))[0][0]) < s, self.duration_s)

    def _raw(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the integral of the parameter, and the parameter, at times before averaging; both ends stand."""
        inside = np.clip(t_s, 0.0, self.times_s[-1])
        i = np.clip(np.searchsorted(self.times_s, inside, side="right") - 1, 0, len(self.times_s) - 2)
        dt_s = inside - self.times_s[i]
        u = (self.speeds[i + 1] - self.speeds[i]) / (self.times_s[i + 1] - self.times_s[i])
        s = self.s[i] + dt_s * (self.speeds[i] + dt_s * u / 2.0)
        area = self.areas[i] + dt_s * (self.s[i] + dt_s * (self.speeds[i] / 2.0 + dt_s * u / 6.0))
        area += self.s[0] * np.minimum(t_s, 0.0) + self.s[-1] * np.maximum(t_s - self.times_s[-1], 0.0)
        return area, s
