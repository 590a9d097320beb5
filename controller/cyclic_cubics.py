"""Make cubics of set-points: fit a parabola through three of them, then keep an axis' speed and position limits.

Positions are in units, velocities in 1/64 unit per ms, as on the wire. These are functions of numbers alone, without
CANopen or an axis.
"""

from typing import NamedTuple

from steptwin.controller.kernel import way_q16
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS

_PER_UNIT_PER_US = 1000 * VELOCITY_PER_UNIT_PER_MS


class Knot(NamedTuple):
    """The position and the velocity at which two cubics meet."""

    position_units: int
    velocity: int


class Cubic(NamedTuple):
    """A cubic, which begins at the position and the velocity at which the previous cubic ended."""

    displacement_units: int
    end_velocity: int


def parabola(points_units: tuple[int, int, int], after_us: int, period_us: int) -> Knot:
    """Return where the parabola through the last three set-points, newest first, is `after_us` after the newest.

    With the points p0, p1, p2 a period T apart, a time r after p0 the parabola is at
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
    """Return the highest velocity at a knot, `room_units` from a soft limit, that keeps cubics within the limit.

    A cubic of at most `duration_us` stays between p0, p0 + v0 T/3, p1 - v1 T/3 and p1 (see `soft_limits.hull`).
    """
    return 3 * room_units * _PER_UNIT_PER_US // duration_us


def slowed(wanted: Cubic, start_velocity: int, limit: int, room: int, ticks: int, microsteps: int) -> Cubic:
    """Return the cubic nearest to the wanted one that keeps the speed limit L and the end velocity's limit `room`.

    |v0|, |3D/T - v0 - v1| and |v1| bound the speed of a cubic. First D is limited to what any v1 can reach. Then v1
    becomes the velocity nearest to the wanted one that keeps the middle bound. All values are in Q16 steps over the
    duration of the cubic, as the kernel computes them.
    """
    middle_q16 = 3 * microsteps << 2
    """Share of one unit of D in the middle bound."""
    velocity_q16 = ticks * microsteps
    """Share of a velocity of 64, one unit per ms, in a bound (see `way_q16`)."""
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
    """Divide, rounding to the nearest integer."""
    return (2 * numerator + denominator) // (2 * denominator)
