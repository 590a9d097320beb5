"""The trapezoid of speed: constant acceleration, constant speed, constant deceleration."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.planning.laws.times import check_duration, check_ramp, shortest_ms, with_slack


@dataclass(frozen=True, slots=True)
class Trapezoid:
    """The law with the speed v = S / (T - t1) between two ramps of constant acceleration v / t1.

        s = v t^2 / (2 t1)              0 <= t <= t1
        s = v (t - t1 / 2)              t1 <= t <= T - t1
        s = S - v (T - t)^2 / (2 t1)    T - t1 <= t <= T

    Source: A. Jiang, L. Guo, X. Tan, "Development of Prototype of a New Intelligent Warehouse Robot", 2019, corrected:
    the paper prints the first branch twice as large, so that it jumps at t1, and repeats the second branch as the
    third, which ends beyond S.

    Attributes:
        distance: S, in any unit, may be negative; velocities are in that unit per second.
        duration_s: T, a whole number of milliseconds above 0; a time out of its range raises InputError.
        ramp_s: t1, a whole number of milliseconds, up to half of T.
    """

    distance: float
    duration_s: float
    ramp_s: float

    def __post_init__(self) -> None:
        check_duration(self.duration_s)
        check_ramp("ramp_s", self.ramp_s, "duration_s", self.duration_s)

    @classmethod
    def fastest(cls, distance: float, speed_max: float, acceleration_max: float) -> Self:
        """Return the shortest law within both limits; if the distance is short, its ramps meet."""
        size = abs(distance)
        by_speed_ms = 1e3 * size / with_slack("speed_max", speed_max)
        by_acceleration_ms2 = 1e6 * size / with_slack("acceleration_max", acceleration_max)
        duration_ms, ramp_ms = shortest_ms(by_speed_ms, lambda ramp_ms: by_acceleration_ms2 / ramp_ms, 1)
        return cls(distance, duration_ms / 1000, ramp_ms / 1000)

    @property
    def speed(self) -> float:
        """v, the velocity between the ramps; it has the sign of S."""
        return self.distance / (self.duration_s - self.ramp_s)

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """Times between start and end at which the acceleration jumps; a single time if the ramps meet."""
        ramp_ms, duration_ms = whole_ms("ramp_s", self.ramp_s), whole_ms("duration_s", self.duration_s)
        return tuple(ms / 1000 for ms in sorted({ramp_ms, duration_ms - ramp_ms}))

    def position(self, t_s: FloatArray) -> FloatArray:
        """Return the distance covered at times of shape (n,) in [0, T]."""
        v, left_s = self.speed, self.duration_s - t_s
        speeding_up = v * t_s**2 / (2.0 * self.ramp_s)
        steady = v * (t_s - self.ramp_s / 2.0)
        slowing_down = self.distance - v * left_s**2 / (2.0 * self.ramp_s)
        return np.where(t_s < self.ramp_s, speeding_up, np.where(left_s < self.ramp_s, slowing_down, steady))

    def time_of(self, part: float) -> float:
        """Return the time in seconds at which a part of the distance, from 0 to 1, is covered."""
        ramp_part = self.ramp_s / (2.0 * (self.duration_s - self.ramp_s))
        if part < ramp_part:
            return float(self.ramp_s * (part / ramp_part) ** 0.5)
        if 1.0 - part < ramp_part:
            return float(self.duration_s - self.ramp_s * ((1.0 - part) / ramp_part) ** 0.5)
        return part * (self.duration_s - self.ramp_s) + self.ramp_s / 2.0

    def velocity(self, t_s: FloatArray) -> FloatArray:
        """Return the first derivative, exactly 0 at both ends."""
        from_end_s = np.minimum(t_s, self.duration_s - t_s)
        return self.speed * np.clip(from_end_s / self.ramp_s, 0.0, 1.0)

    def acceleration(self, t_s: FloatArray) -> FloatArray:
        """Return the second derivative; at a jump the value after it, but at the end the value before."""
        jumps_s = self.breakpoints_s  # t1 and T - t1, free of the rounding error of a subtraction
        after_start = (t_s < jumps_s[0]).astype(np.float64)
        before_end = (t_s >= jumps_s[-1]).astype(np.float64)
        return self.speed / self.ramp_s * (after_start - before_end)
