"""Time laws: the distance covered from rest to rest, as a function of time, in whole milliseconds."""

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, floor, isfinite, sqrt
from typing import ClassVar, Final, Protocol, Self

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.common.errors import InputError


class Law(Protocol):
    """Distance, velocity and acceleration as functions of time, from 0 to a whole number of milliseconds.

    The classmethod `fastest` of each law chooses the shortest one within limits in the distance's unit. It raises
    InputError for a limit that is not above 0, or so low that the motion would take days.
    """

    @property
    def distance(self) -> float:
        """Distance covered, in any unit, which may be negative; velocities are in that unit per second."""
        ...

    @property
    def duration_s(self) -> float:
        """Duration, a whole number of milliseconds."""
        ...

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """Times in between when acceleration or jerk jumps, whole milliseconds: each needs a PVT point."""
        ...

    def position(self, t_s: FloatArray) -> FloatArray:
        """Return the distance covered at times of shape (n,) in [0, duration_s]; exactly `distance` at the end."""
        ...

    def velocity(self, t_s: FloatArray) -> FloatArray:
        """Return the first derivative, exactly 0 at both ends."""
        ...

    def acceleration(self, t_s: FloatArray) -> FloatArray:
        """Return the second derivative; at a jump the value after it, but at the end the value before."""
        ...


LONGEST_MS: Final = 10**9
"""Longest motion chosen, more than eleven days: much longer ones in seconds could not hold whole milliseconds."""

_TIME_S: Final = 1e-9
_HALVINGS: Final = 64
"""Number of bisections for the time of a law at a position: a fraction of a timer's count."""

_SLACK: Final = 1e-12
"""Relative tolerance of limits; otherwise a rounding error would lengthen round times by 1 ms."""


def check_duration(duration_s: float) -> None:
    """Raise InputError unless a duration is a whole number of milliseconds above 0."""
    if whole_ms("duration_s", duration_s) <= 0:
        raise InputError(f"duration_s: {duration_s:g} s is not above 0 s")


def check_ramp(ramp: str, ramp_s: float, whole: str, whole_s: float) -> None:
    """Raise InputError unless a ramp is a whole number of milliseconds above 0 and at most half of the whole."""
    if not 0 < 2 * whole_ms(ramp, ramp_s) <= whole_ms(whole, whole_s):
        raise InputError(f"{ramp}: {ramp_s:g} s is not above 0 and at most {whole_s / 2:g} s, half of {whole}")


def with_slack(what: str, limit: float) -> float:
    """Return a limit plus the slack for rounding errors; raise InputError unless it is finite and above 0."""
    allowed = limit * (1.0 + _SLACK)
    if not (isfinite(allowed) and limit > 0):
        raise InputError(f"{what}: {limit:g} is not a finite number above 0")
    return allowed


def rounded_up_ms(least_ms: float) -> int:
    """Return a time rounded up to whole milliseconds, at least 1; raise InputError above LONGEST_MS."""
    if not least_ms <= LONGEST_MS:
        raise InputError(
            f"within its limits the motion lasts {least_ms / 1000:g} s, it must be at most {LONGEST_MS // 1000} s"
        )
    return max(1, ceil(least_ms))


def shortest_ms(by_speed_ms: float, by_ramp_ms: Callable[[int], float], shortest_ramp_ms: int) -> tuple[int, int]:
    """Return duration T and ramp t1 of the shortest motion with two equal ramps; raise InputError above LONGEST_MS.

    T - t1 is S / v. It has three lower bounds: the speed's, the acceleration's, which falls with a longer ramp, and the
    ramp itself, since the ramps must not overlap. While the acceleration's bound is the largest, a longer ramp saves at
    least as much time as it takes; after that, every further millisecond of the ramp is lost. So the best ramp is the
    first one for which the acceleration's bound is not the largest, or is 1 ms shorter.

    Args:
        by_speed_ms: Least T - t1 that keeps the limit of the speed.
        by_ramp_ms: Function that returns the least T - t1 that lets a ramp of that duration keep its limits.
        shortest_ramp_ms: Shortest ramp that the law allows.
    """

    def acceleration_is_slack(ramp_ms: int) -> bool:
        return by_ramp_ms(ramp_ms) <= max(by_speed_ms, ramp_ms)

    first_ms = bisect_left(range(LONGEST_MS), True, lo=shortest_ramp_ms, key=acceleration_is_slack)
    ramps_ms = first_ms, max(first_ms - 1, shortest_ramp_ms)
    least_ms = [ramp_ms + max(by_speed_ms, by_ramp_ms(ramp_ms), ramp_ms) for ramp_ms in ramps_ms]
    duration_ms = rounded_up_ms(min(least_ms))
    return duration_ms, next(ramp_ms for ramp_ms, ms in zip(ramps_ms, least_ms, strict=True) if ms <= duration_ms)


def time_at(law: Law, position: float) -> float:
    """Return the first time in seconds when a monotonic law is at a position."""
    return time_after(lambda t_s: abs(float(law.position(np.array([t_s]))[0])) < abs(position), law.duration_s)


def time_after(is_before: Callable[[float], bool], duration_s: float) -> float:
    """Return the end of the time from 0 for which a condition holds, by bisection."""
    low_s, high_s = 0.0, duration_s
    for _ in range(_HALVINGS):
        if high_s - low_s <= _TIME_S:
            break
        middle_s = (low_s + high_s) / 2.0
        low_s, high_s = (middle_s, high_s) if is_before(middle_s) else (low_s, middle_s)
    return high_s


@dataclass(frozen=True, slots=True)
class _Polynomial:
    """The parts that both polynomials from rest to rest share.

        cubic      s = S (3 u^2 - 2 u^3)                 u = t / T    peaks 3/2 S/T, and 6 S/T^2 at the ends
        quintic    s = S (10 u^3 - 15 u^4 + 6 u^5)                    peaks 15/8 S/T, and 10/sqrt(3) S/T^2

    The acceleration of the cubic jumps at both ends, that of the quintic is 0 there.

    Source: J. J. Craig, "Introduction to Robotics: Mechanics and Control", section 7.3.

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


@dataclass(frozen=True, slots=True)
class Trapezoid:
    """The law with the speed v = S / (T - t1) between two ramps of constant acceleration v / t1.

        s = v t^2 / (2 t1)              0 <= t <= t1
        s = v (t - t1 / 2)              t1 <= t <= T - t1
        s = S - v (T - t)^2 / (2 t1)    T - t1 <= t <= T

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
        """Times between start and end when the acceleration jumps; a single time if the ramps meet."""
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
        """Return the time in seconds when a part of the distance, from 0 to 1, is covered."""
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
        """Times between start and end when the jerk jumps; one time for both ends of a phase that vanishes."""
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
