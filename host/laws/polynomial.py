"""Polynomials from rest to rest: the cubic, whose acceleration jumps at both ends, and the quintic, where it is 0.

    cubic      s = S (3 u^2 - 2 u^3)                u = t / T    peaks: 1.5 S/T and 6 S/T^2 (at the ends)
    quintic    s = S (10 u^3 - 15 u^4 + 6 u^5)                   peaks: 15/8 S/T and 10/sqrt(3) S/T^2

Source: J. J. Craig, "Introduction to Robotics: Mechanics and Control", section 7.3.
"""

from dataclasses import dataclass
from math import sqrt
from typing import Self

import numpy as np

from host.laws.law import require_duration, rounded_up_s
from host.trajectory import FloatArray

_QUINTIC_ACCELERATION = 10.0 / sqrt(3.0)


@dataclass(frozen=True, slots=True)
class Cubic:
    """The shortest polynomial from rest to rest.

    Attributes:
        distance: S, in any unit.
        duration_s: T, a whole number of milliseconds.

    Raises:
        InputError: a duration that is not.
    """

    distance: float
    duration_s: float

    def __post_init__(self) -> None:
        require_duration(self.duration_s)

    @classmethod
    def fastest(cls, distance: float, speed_max: float, acceleration_max: float) -> Self:
        """The shortest one that exceeds neither limit."""
        size = abs(distance)
        return cls(distance, rounded_up_s(max(1.5 * size / speed_max, sqrt(6.0 * size / acceleration_max))))

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
        """Its second derivative."""
        return 6.0 * self.distance / self.duration_s**2 * (1.0 - 2.0 * t_s / self.duration_s)


@dataclass(frozen=True, slots=True)
class Quintic:
    """The smooth polynomial: speed and acceleration are 0 at both ends.

    Attributes:
        distance: S, in any unit.
        duration_s: T, a whole number of milliseconds.

    Raises:
        InputError: a duration that is not.
    """

    distance: float
    duration_s: float

    def __post_init__(self) -> None:
        require_duration(self.duration_s)

    @classmethod
    def fastest(cls, distance: float, speed_max: float, acceleration_max: float) -> Self:
        """The shortest one that exceeds neither limit."""
        size = abs(distance)
        by_acceleration_s = sqrt(_QUINTIC_ACCELERATION * size / acceleration_max)
        return cls(distance, rounded_up_s(max(15.0 / 8.0 * size / speed_max, by_acceleration_s)))

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
        return 30.0 * self.distance / self.duration_s * (u * (1.0 - u)) ** 2

    def acceleration(self, t_s: FloatArray) -> FloatArray:
        """Its second derivative, exactly 0 at both ends."""
        u = t_s / self.duration_s
        return 60.0 * self.distance / self.duration_s**2 * np.asarray(u * (1.0 - u) * (1.0 - 2.0 * u))
