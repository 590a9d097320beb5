"""The times of laws: check them, or choose them for the shortest motion within limits, in whole milliseconds."""

from bisect import bisect_left
from collections.abc import Callable
from math import ceil, isfinite
from typing import Final, Protocol

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
        """Times in between at which acceleration or jerk jumps, whole milliseconds: each needs a PVT point."""
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

_SLACK: Final = 1e-12
"""Part of a limit by which it may be exceeded: without it a rounding error would lengthen round times by 1 ms."""


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
        by_speed_ms: Least T - t1 at which the speed keeps its limit.
        by_ramp_ms: Function that returns the least T - t1 at which a ramp of that duration keeps its limits.
        shortest_ramp_ms: Shortest ramp that the law allows.
    """

    def acceleration_is_slack(ramp_ms: int) -> bool:
        return by_ramp_ms(ramp_ms) <= max(by_speed_ms, ramp_ms)

    first_ms = bisect_left(range(LONGEST_MS), True, lo=shortest_ramp_ms, key=acceleration_is_slack)
    ramps_ms = first_ms, max(first_ms - 1, shortest_ramp_ms)
    least_ms = [ramp_ms + max(by_speed_ms, by_ramp_ms(ramp_ms), ramp_ms) for ramp_ms in ramps_ms]
    duration_ms = rounded_up_ms(min(least_ms))
    return duration_ms, next(ramp_ms for ramp_ms, ms in zip(ramps_ms, least_ms, strict=True) if ms <= duration_ms)
