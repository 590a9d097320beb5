"""Polynomials from rest to rest: the cubic, whose acceleration jumps at both ends, and the quintic, where it is 0.

    cubic      s = S (3 u^2 - 2 u^3)                 u = t / T    peaks 3/2 S/T, and 6 S/T^2 at the ends
    quintic    s = S (10 u^3 - 15 u^4 + 6 u^5)                    peaks 15/8 S/T, and 10/sqrt(3) S/T^2

Source: J. J. Craig, "Introduction to Robotics: Mechanics and Control", section 7.3.
"""

from dataclasses import dataclass
from math import sqrt
from typing import Self

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.laws.times import check_duration, rounded_up_ms, with_slack


@dataclass(frozen=True, slots=True)
class Cubic:
    """The polynomial of the lowest degree from rest to rest.

    Attributes:
        distance: S, in any unit.
        duration_s: T, a whole number of milliseconds.

    Raises:
        InputError: a duration that is not above 0 or falls between two milliseconds.
    """

    distance: float
    duration_s: float

    def __post_init__(self) -> None:
        check_duration(self.duration_s)

    @classmethod
    def fastest(cls, distance: float, speed_max: float, acceleration_max: float) -> Self:
        """The shortest one that exceeds neither limit: T is the larger of 3/2 S/v and sqrt(6 S/a).

        Raises:
            InputError: a limit that is not above 0, or so low that the motion would take days.
        """
        return cls(distance, _shortest_s(distance, speed_max, acceleration_max, 1.5, 6.0))

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """None."""
        return ()

    def position(self, t_s: FloatArray) -> FloatArray:
        """Distance covered at times of shape (n,) in [0, T]."""
        u = t_s / self.duration_s
        return self.distance * u**2 * (3.0 - 2.0 * u)

    def velocity(self, t_s: FloatArray) -> FloatArray:
        """Its first derivative, exactly 0 at both ends."""
        u = t_s / self.duration_s
        return 6.0 * self.distance / self.duration_s * u * (1.0 - u)

    def acceleration(self, t_s: FloatArray) -> FloatArray:
        """Its second derivative, from 6 S/T^2 down to -6 S/T^2."""
        u = t_s / self.duration_s
        return 6.0 * self.distance / self.duration_s**2 * (1.0 - 2.0 * u)


@dataclass(frozen=True, slots=True)
class Quintic:
    """The polynomial of the lowest degree that also begins and ends without acceleration.

    Attributes:
        distance: S, in any unit.
        duration_s: T, a whole number of milliseconds.

    Raises:
        InputError: a duration that is not above 0 or falls between two milliseconds.
    """

    distance: float
    duration_s: float

    def __post_init__(self) -> None:
        check_duration(self.duration_s)

    @classmethod
    def fastest(cls, distance: float, speed_max: float, acceleration_max: float) -> Self:
        """The shortest one that exceeds neither limit: T is the larger of 15/8 S/v and sqrt(10/sqrt(3) S/a).

        Raises:
            InputError: a limit that is not above 0, or so low that the motion would take days.
        """
        return cls(distance, _shortest_s(distance, speed_max, acceleration_max, 15.0 / 8.0, 10.0 / sqrt(3.0)))

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """None."""
        return ()

    def position(self, t_s: FloatArray) -> FloatArray:
        """Distance covered at times of shape (n,) in [0, T]."""
        u = t_s / self.duration_s
        return self.distance * u**3 * (10.0 + u * (6.0 * u - 15.0))

    def velocity(self, t_s: FloatArray) -> FloatArray:
        """Its first derivative, exactly 0 at both ends."""
        u = t_s / self.duration_s
        return 30.0 * self.distance / self.duration_s * u**2 * (1.0 - u) ** 2

    def acceleration(self, t_s: FloatArray) -> FloatArray:
        """Its second derivative, exactly 0 at both ends."""
        u = t_s / self.duration_s
        return 60.0 * self.distance / self.duration_s**2 * u * (1.0 - u) * (1.0 - 2.0 * u)


def _shortest_s(
    distance: float, speed_max: float, acceleration_max: float, speed_peak: float, acceleration_peak: float
) -> float:
    """The least T in whole milliseconds for a law whose peaks are given in S/T and S/T^2."""
    by_speed_s = speed_peak * abs(distance) / with_slack("speed_max", speed_max)
    by_acceleration_s = sqrt(acceleration_peak * abs(distance) / with_slack("acceleration_max", acceleration_max))
    return rounded_up_ms(1000.0 * max(by_speed_s, by_acceleration_s)) / 1000
