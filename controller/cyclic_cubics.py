"""From set-points to cubics: the parabola through three of them, and what an axis' speed and its limits leave of it.

Positions are units, velocities 1/64 unit per ms, as on the wire. Nothing here knows CANopen or an axis.
"""

from typing import NamedTuple

from steptwin.controller.kernel import way_q16
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS

_PER_UNIT_PER_US = 1000 * VELOCITY_PER_UNIT_PER_MS


class Knot(NamedTuple):
    """Where two cubics meet, and how fast the axis is there."""

    position_units: int
    velocity: int


class Cubic(NamedTuple):
    """From where and as fast as the one before it ended."""

    displacement_units: int
    end_velocity: int


def parabola(points_units: tuple[int, int, int], after_us: int, period_us: int) -> Knot:
    """Where the parabola through the last three set-points, the newest first, is so long after the newest.

    With the points p0, p1, p2 a period T apart, a time r after p0 it is at
    p0 + ((3 p0 - 4 p1 + p2) r/T + (p0 - 2 p1 + p2) (r/T)^2) / 2.
    """
    p0, p1, p2 = points_units
    slope, bend = 3 * p0 - 4 * p1 + p2, p0 - 2 * p1 + p2
    divisor = 2 * period_us * period_us
    return Knot(
        p0 + _rounded((slope * period_us + bend * after_us) * after_us, divisor),
        _rounded((slope * period_us + 2 * bend * after_us) * _PER_UNIT_PER_US, divisor),
    )


def highest_velocity(room_units: int, duration_us: int) -> int:
    """At a knot so far from a soft limit, for cubics up to so long: none that meets there leads beyond the limit.

    A cubic stays between p0, p0 + v0 T/3, p1 - v1 T/3 and p1 (see `soft_limits.hull`).
    """
    return 3 * room_units * _PER_UNIT_PER_US // duration_us


def slowed(wanted: Cubic, start_velocity: int, limit: int, room: int, ticks: int, microsteps: int) -> Cubic:
    """The nearest cubic that keeps the limit L of speed, which |v0|, |3D/T - v0 - v1| and |v1| bound, and |v1| <= room.

    D is cut to what is possible at all; then v1 is the nearest to the wanted one that leaves enough for the middle. All
    is reckoned as the kernel does it, in Q16 steps over the cubic.
    """
    middle_q16 = 3 * microsteps << 2
    """Of a unit of D."""
    velocity_q16 = ticks * microsteps
    """Of a velocity of 64, as `way_q16` has it."""
    most = min(limit, room)
    limit_q16, most_q16 = way_q16(limit, ticks, microsteps), way_q16(most, ticks, microsteps)
    start_q16 = way_q16(start_velocity, ticks, microsteps)
    farthest = (limit_q16 + most_q16 + start_q16) // middle_q16
    farthest_back = (limit_q16 + most_q16 - start_q16) // middle_q16
    displacement_units = max(-farthest_back, min(wanted.displacement_units, farthest))
    chord_q16 = displacement_units * middle_q16 - start_q16
    lowest = -(-(chord_q16 - limit_q16 << 6) // velocity_q16)
    highest = (chord_q16 + limit_q16 << 6) // velocity_q16
    velocity = max(lowest, min(wanted.end_velocity, highest))
    return Cubic(displacement_units, max(-most, min(velocity, most)))


def _rounded(numerator: int, denominator: int) -> int:
    """To the nearest integer."""
    return (2 * numerator + denominator) // (2 * denominator)
