"""Polynomials from rest to rest: the cubic, whose acceleration jumps at both ends, and the quintic, where it is 0.

    cubic      s = S (3 u^2 - 2 u^3)                 u = t / T    peaks 3/2 S/T, and 6 S/T^2 at the ends
    quintic    s = S (10 u^3 - 15 u^4 + 6 u^5)                    peaks 15/8 S/T, and 10/sqrt(3) S/T^2

Source: J. J. Craig, "Introduction to Robotics: Mechanics and Control", section 7.3.
"""

from dataclasses import dataclass
from math import sqrt
from typing import ClassVar, Self

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.laws.times import check_duration, rounded_up_ms, with_slack


@dataclass(frozen=True, slots=True)
class _Polynomial:
    """The parts that both polynomials share.

    Attributes:
        distance: S, in any unit.
        duration_s: T, a whole number of milliseconds above 0; raises InputError for any other.
    """

    distance: float
    duration_s: float

    breakpoints_s: ClassVar[tuple[float, ...]] = ()
    _SPEED_PEAK: ClassVar[float]
    """Highest speed in S/T."""
    _ACCELERATION_PEAK: ClassVar[float]
    """Highest acceleration in S/T^2."""

    def __post_init__(self) -> None:
        check_duration(self.duration_s)

    @classmethod
    def fastest(cls, distance: float, speed_max: float, acceleration_max: float) -> Self:
        """Return the shortest law within both limits: T is the larger of 3/2 S/v and sqrt(6 S/a) for the cubic.

        For the quintic these are 15/8 S/v and sqrt(10/sqrt(3) S/a). T is rounded up to whole milliseconds.
        """
        by_speed_s = cls._SPEED_PEAK * abs(distance) / with_slack("speed_max", speed_max)
        acceleration_max = with_slack("acceleration_max", acceleration_max)
        by_acceleration_s = sqrt(cls._ACCELERATION_PEAK * abs(distance) / acceleration_max)
        return cls(distance, rounded_up_ms(1000.0 * max(by_speed_s, by_acceleration_s)) / 1000)


class Cubic(_Polynomial):
    """The polynomial of the lowest degree from rest to rest."""

    __slots__ = ()
    _SPEED_PEAK = 1.5
    _ACCELERATION_PEAK = 6.0

    def position(self, t_s: FloatArray) -> FloatArray:
        """Return the distance covered at times of shape (n,) in [0, T]."""
        u = t_s / self.duration_s
        return self.distance * u**2 * (3.0 - 2.0 * u)

    def velocity(self, t_s: FloatArray) -> FloatArray:
        """Return the first derivative, exactly 0 at both ends."""
        u = t_s / self.duration_s
        return 6.0 * self.distance / self.duration_s * u * (1.0 - u)

    def acceleration(self, t_s: FloatArray) -> FloatArray:
        """Return the second derivative, which falls from 6 S/T^2 to -6 S/T^2."""
        u = t_s / self.duration_s
        return 6.0 * self.distance / self.duration_s**2 * (1.0 - 2.0 * u)


class Quintic(_Polynomial):
    """The polynomial of the lowest degree whose acceleration is 0 at both ends, too."""

    __slots__ = ()
    _SPEED_PEAK = 15.0 / 8.0
    _ACCELERATION_PEAK = 10.0 / sqrt(3.0)

    def position(self, t_s: FloatArray) -> FloatArray:
        """Return the distance covered at times of shape (n,) in [0, T]."""
        u = t_s / self.duration_s
        return self.distance * u**3 * (10.0 + u * (6.0 * u - 15.0))

    def velocity(self, t_s: FloatArray) -> FloatArray:
        """Return the first derivative, exactly 0 at both ends."""
        u = t_s / self.duration_s
        return 30.0 * self.distance / self.duration_s * u**2 * (1.0 - u) ** 2

    def acceleration(self, t_s: FloatArray) -> FloatArray:
        """Return the second derivative, exactly 0 at both ends."""
        u = t_s / self.duration_s
        return 60.0 * self.distance / self.duration_s**2 * u * (1.0 - u) * (1.0 - 2.0 * u)
