"""The jerk-limited law: a trapezoid of speed whose ramps begin and end softly, in seven phases of constant jerk.

A ramp of t1 reaches the speed v = S / (T - t1). Within it acceleration rises for tj, stays at a = v / (t1 - tj), and
falls for tj; jerk is a / tj. The law is a cubic in each phase, and so are its PVT segments: nothing is approximated.

Source: L. Biagiotti, C. Melchiorri, "Trajectory Planning for Automatic Machines and Robots", section 3.4.
"""

from dataclasses import dataclass
from math import sqrt
from typing import Self

import numpy as np

from host.errors import InputError
from host.inputs import whole_ms
from host.laws.law import require_duration, rounded_up_s
from host.trajectory import FloatArray


@dataclass(frozen=True, slots=True)
class SCurve:
    """Symmetric: it slows down as it has speeded up.

    Attributes:
        distance: S, in any unit.
        duration_s: T, a whole number of milliseconds.
        ramp_s: t1, a whole number of milliseconds, up to half of T.
        jerk_s: tj, a whole number of milliseconds, up to half of t1.

    Raises:
        InputError: times that make no such law or fall between two milliseconds.
    """

    distance: float
    duration_s: float
    ramp_s: float
    jerk_s: float

    def __post_init__(self) -> None:
        require_duration(self.duration_s)
        duration_ms, ramp_ms, jerk_ms = self._times_ms
        if not 0 < 2 * ramp_ms <= duration_ms:
            raise InputError(
                f"ramp_s: {self.ramp_s:g} s is not above 0 and at most {self.duration_s / 2:g} s, half of duration_s"
            )
        if not 0 < 2 * jerk_ms <= ramp_ms:
            raise InputError(
                f"jerk_s: {self.jerk_s:g} s is not above 0 and at most {self.ramp_s / 2:g} s, half of ramp_s"
            )

    @classmethod
    def fastest(cls, distance: float, speed_max: float, acceleration_max: float, jerk_max: float) -> Self:
        """The shortest one that exceeds no limit, but for rounding its times up to whole milliseconds.

        Where the distance is too short for the highest speed, or for the highest acceleration, a lower one is reached.
        """
        size = abs(distance)
        jerk_s = min(
            acceleration_max / jerk_max,  # the acceleration is reached, or
            sqrt(speed_max / jerk_max),  # the speed before it, or
            (size / (2.0 * jerk_max)) ** (1.0 / 3.0),  # half of the distance before either: S = 2 j tj^3
        )
        jerk_s = rounded_up_s(jerk_s)
        acceleration = min(acceleration_max, jerk_max * jerk_s)
        speed = min(speed_max, _speed_within(size, acceleration, jerk_s))
        ramp_s = rounded_up_s(max(speed / acceleration + jerk_s, 2.0 * jerk_s))
        reached = min(speed_max, acceleration * (ramp_s - jerk_s))
        duration_s = rounded_up_s(size / reached + ramp_s)
        return cls(distance, max(duration_s, 2.0 * ramp_s), ramp_s, jerk_s)

    @property
    def _times_ms(self) -> tuple[int, int, int]:
        return whole_ms("duration_s", self.duration_s), whole_ms("ramp_s", self.ramp_s), whole_ms("jerk_s", self.jerk_s)

    @property
    def speed(self) -> float:
        """v, the velocity between the ramps, with the sign of S."""
        return self.distance / (self.duration_s - self.ramp_s)

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """Where the jerk jumps between start and end."""
        duration_ms, ramp_ms, jerk_ms = self._times_ms
        first = {jerk_ms, ramp_ms - jerk_ms, ramp_ms}
        return tuple(ms / 1000 for ms in sorted(first | {duration_ms - ms for ms in first}))

    def position(self, t_s: FloatArray) -> FloatArray:
        """Distance covered at times of shape (n,) in [0, T]."""
        left_s = self.duration_s - t_s
        speeding_up = self._ramp(np.minimum(t_s, self.ramp_s), 3)
        slowing_down = self.distance - self._ramp(np.minimum(left_s, self.ramp_s), 3)
        steady = self.speed * (t_s - self.ramp_s / 2.0)
        return np.where(t_s < self.ramp_s, speeding_up, np.where(left_s < self.ramp_s, slowing_down, steady))

    def velocity(self, t_s: FloatArray) -> FloatArray:
        """Its first derivative, exactly 0 at both ends."""
        return self._ramp(np.minimum(np.minimum(t_s, self.duration_s - t_s), self.ramp_s), 2)

    def acceleration(self, t_s: FloatArray) -> FloatArray:
        """Its second derivative, exactly 0 at both ends."""
        left_s = self.duration_s - t_s
        from_end_s = np.minimum(np.minimum(t_s, left_s), self.ramp_s)
        return np.where(t_s <= left_s, 1.0, -1.0) * self._ramp(from_end_s, 1)

    def _ramp(self, t_s: FloatArray, order: int) -> FloatArray:
        """Acceleration (order 1), speed (2) or distance (3) after t of the first ramp: jerk integrated that often.

        The jerk is +j, 0, -j with jumps at 0, tj, t1 - tj and t1: a sum of truncated powers.
        """
        jerk = self.speed / (self.ramp_s - self.jerk_s) / self.jerk_s
        factorial = (1.0, 1.0, 2.0, 6.0)[order]
        jumps = ((0.0, 1.0), (self.jerk_s, -1.0), (self.ramp_s - self.jerk_s, -1.0))
        powers = [sign * np.maximum(t_s - at_s, 0.0) ** order for at_s, sign in jumps]
        return np.asarray(jerk / factorial * np.sum(powers, axis=0))


def _speed_within(distance: float, acceleration: float, jerk_s: float) -> float:
    """The speed of the law without a steady phase: S = v t1 with t1 = v/a + tj, solved for v."""
    half = acceleration * jerk_s / 2.0
    return sqrt(half**2 + distance * acceleration) - half
