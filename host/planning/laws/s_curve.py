"""The jerk-limited law: ramps of speed with trapezoidal acceleration, seven phases of constant jerk in all."""

from dataclasses import dataclass
from math import ceil, floor
from typing import Self

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.planning.laws.times import check_duration, check_ramp, shortest_ms, with_slack
from steptwin.host.planning.laws.trapezoid import Trapezoid


@dataclass(frozen=True, slots=True)
class SCurve:
    """The law whose acceleration is a trapezoid within each ramp: it rises for tj, stays constant and falls for tj.

        v = S / (T - t1)      the speed between the ramps
        a = v / (t1 - tj)     the highest acceleration
        j = a / tj            the jerk while the acceleration rises

    It is a cubic in each phase, so PVT segments represent it exactly.

    Source: L. Biagiotti, C. Melchiorri, "Trajectory Planning for Automatic Machines and Robots", section 3.4.

    Attributes:
        distance: S, in any unit; may be negative.
        duration_s: T, a whole number of milliseconds above 0; a time out of its range raises InputError.
        ramp_s: t1, a whole number of milliseconds, up to half of T.
        jerk_s: tj, a whole number of milliseconds, up to half of t1.
    """

    distance: float
    duration_s: float
    ramp_s: float
    jerk_s: float

    def __post_init__(self) -> None:
        check_duration(self.duration_s)
        check_ramp("ramp_s", self.ramp_s, "duration_s", self.duration_s)
        check_ramp("jerk_s", self.jerk_s, "ramp_s", self.ramp_s)

    @classmethod
    def fastest(cls, distance: float, speed_max: float, acceleration_max: float, jerk_max: float) -> Self:
        """Return the shortest law within all limits.

        If the distance is too short for the highest speed or acceleration, phases vanish: the ramps meet, or the
        acceleration falls as soon as it has risen.
        """
        size = abs(distance)
        acceleration, jerk = with_slack("acceleration_max", acceleration_max), with_slack("jerk_max", jerk_max)
        by_speed_ms = 1e3 * size / with_slack("speed_max", speed_max)
        by_acceleration_ms2, by_jerk_ms3 = 1e6 * size / acceleration, 1e9 * size / jerk

        def best_ms(ramp_ms: int) -> tuple[float, int]:
            """Return the least T - t1 for a ramp, and its tj: a longer one has less jerk and more acceleration."""
            even_ms = min(1e3 * acceleration / jerk, ramp_ms / 2)  # jerk and acceleration need the same T - t1
            choices_ms = {min(max(1, ms), ramp_ms // 2) for ms in (floor(even_ms), ceil(even_ms))}
            return min(
                (max(by_acceleration_ms2 / (ramp_ms - jerk_ms), by_jerk_ms3 / (jerk_ms * (ramp_ms - jerk_ms))), jerk_ms)
                for jerk_ms in choices_ms
            )

        duration_ms, ramp_ms = shortest_ms(by_speed_ms, lambda ramp_ms: best_ms(ramp_ms)[0], 2)
        return cls(distance, duration_ms / 1000, ramp_ms / 1000, best_ms(ramp_ms)[1] / 1000)

    @classmethod
    def at_speed(cls, distance: float, speed: float, ramp_s: float) -> Self:
        """Return the law that gets to a speed in `ramp_s` seconds and covers a distance with it.

        The acceleration rises during the ramp's first half and falls during its second, so its highest value is
        2 v / t and the jerk 4 v / t^2. A short distance has a shorter ramp, and does not reach the speed.
        """
        acceleration = 2.0 * speed / ramp_s
        return cls.fastest(distance, speed, acceleration, 2.0 * acceleration / ramp_s)

    @property
    def speed(self) -> float:
        """v, the velocity between the ramps; it has the sign of S."""
        return self.distance / (self.duration_s - self.ramp_s)

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """Times between start and end at which the jerk jumps; one time for both ends of a phase that vanishes."""
        duration_ms = whole_ms("duration_s", self.duration_s)
        ramp_ms, jerk_ms = whole_ms("ramp_s", self.ramp_s), whole_ms("jerk_s", self.jerk_s)
        first_ms = {jerk_ms, ramp_ms - jerk_ms, ramp_ms}
        return tuple(ms / 1000 for ms in sorted(first_ms | {duration_ms - ms for ms in first_ms}))

    def position(self, t_s: FloatArray) -> FloatArray:
        """Return the distance covered at times of shape (n,) in [0, T]."""
        left_s = self.duration_s - t_s
        covered = self._covered(np.minimum(t_s, left_s))
        return np.where(t_s <= left_s, covered, self.distance - covered)

    def velocity(self, t_s: FloatArray) -> FloatArray:
        """Return the first derivative, exactly 0 at both ends."""
        return self._ramp.position(self._into_ramp_s(t_s))

    def acceleration(self, t_s: FloatArray) -> FloatArray:
        """Return the second derivative, exactly 0 at both ends and between the ramps."""
        return np.where(t_s <= self.duration_s - t_s, 1.0, -1.0) * self._ramp.velocity(self._into_ramp_s(t_s))

    @property
    def _ramp(self) -> Trapezoid:
        """The speed during the first ramp: it follows a trapezoid law whose distance is v."""
        return Trapezoid(self.speed, self.ramp_s, self.jerk_s)

    def _into_ramp_s(self, t_s: FloatArray) -> FloatArray:
        """Return the time since the start in the first ramp, the time to the end in the second, and t1 in between."""
        return np.minimum(np.minimum(t_s, self.duration_s - t_s), self.ramp_s)

    def _covered(self, t_s: FloatArray) -> FloatArray:
        """Return the distance covered at times in the first half.

        If the speed jumped from 0 to v in the middle of the ramp, it would be v (t - t1 / 2) from there on. The ramp
        adds to that, by equal amounts at equal times from its two ends.
        """
        tj = self.jerk_s
        x = np.clip(np.minimum(t_s, self.ramp_s - t_s), 0.0, None)
        added = np.where(x < tj, x**3 / (6.0 * tj), (x**2 - x * tj) / 2.0 + tj**2 / 6.0)
        return self.speed * (np.maximum(t_s - self.ramp_s / 2.0, 0.0) + added / (self.ramp_s - tj))
