"""Generate motion profiles: from any velocity to a stop at a target, or through one target to a stop at the next.

A profile is a sequence of ramps: acceleration to the peak velocity, cruise, and deceleration. Linear and jerk-limited
ramps are planned alike; they differ only in the time of a velocity change. Whole milliseconds rarely give the exact
distance, so the last ramp corrects it: it is stretched to cover at least the distance, and the excess is subtracted
along a smoothstep. So the profile ends exactly at the target.

A passed target is reached with an exact velocity. Instead of the last ramp, the cruise before the target corrects the
distance: it becomes longer, and the excess is subtracted along a smoothstep.

A jerk-limited motion that begins in motion first reduces the acceleration to 0. An axis that already brakes must keep
its deceleration if it has to stop: it enters the stop ramp at the point with its velocity and acceleration.

The functions use numbers only: no CANopen, no axis, no clock.

Accuracy: `Profile` rounds positions to units and velocities to 1/64 unit per ms. On a segment of T ms, T >= GRAIN_MS,
that changes speeds by less than 3 / T + 1/64 units per ms and accelerations by less than (6 / T + 1/16) / T units per
ms^2; `_unbend` may add 1/64 unit per ms. Apart from rounding, speed and acceleration keep their limits, with two
exceptions. First, a new target may leave hardly more than the shortest stopping distance: a stop there in T ms takes up
to (1 + 3 / T) times the deceleration. With even less distance, the axis overshoots and returns. Second, if a
jerk-limited ramp has constant acceleration for less than GRAIN_MS, the cubic of one segment spans a bend of the
acceleration and exceeds it by at most 2/9.
"""

from collections.abc import Callable
from typing import NamedTuple

from steptwin.controller.modes.ramps import (
    FRACTION_BITS,
    GRAIN_MS,
    PER_UNIT_BITS,
    PIECE_MS,
    EnteredRamp,
    Profile,
    Ramp,
    rounded,
)

_SLACK_MS = 4
"""Extra time of the last ramp; with it, subtracting the excess distance keeps the deceleration."""


class Limits(NamedTuple):
    """Limits of a motion.

    Attributes:
        velocity: highest speed in 1/64 unit per ms, at least 1.
        acceleration: in units/s^2, at least 1.
        deceleration: in units/s^2, at least 1.
        jerk: in units/s^3; 0 for linear ramps.
    """

    velocity: int
    acceleration: int
    deceleration: int
    jerk: int = 0


class Passing(NamedTuple):
    """How the axis passes a target and stops at the next one.

    Attributes:
        velocity: requested speed at the target, in 1/64 unit per ms.
        onward_units: travel from the target to the next one, where the axis stops.
        limits: limits of the motion after the target.
    """

    velocity: int
    onward_units: int
    limits: Limits


def move(distance_units: int, velocity: int, acceleration: int, limits: Limits) -> Profile:
    """Return the profile that stops after a distance, from an initial velocity and acceleration.

    A jerk-limited motion first reduces the acceleration to 0. If the axis already brakes, and would then be too fast to
    stop in the distance, it continues to brake.
    """
    distance = distance_units << PER_UNIT_BITS
    entry = _unbend(velocity, acceleration, limits)
    if _brakes(velocity, acceleration, limits) and _overruns(distance, velocity, entry, limits):
        entry = _brake_before(distance, velocity, acceleration, limits)
    return _begun_with(entry, _ramps_to(distance - entry.remaining, entry.ramp.to_velocity, limits))


def move_through(
    distance_units: int, velocity: int, acceleration: int, limits: Limits, passing: Passing
) -> Profile | None:
    """Return the profile that passes a target after a distance and stops at the next one.

    It passes the target at the requested velocity, or as fast as the limits and both distances allow. Return None if
    the axis must stop at the target: the next one is not farther in the same direction, or both are too close.
    """
    entry = _unbend(velocity, acceleration, limits)
    distance = (distance_units << PER_UNIT_BITS) - entry.remaining
    ramps = _ramps_through(distance, entry.ramp.to_velocity, limits, passing)
    return None if ramps is None else _begun_with(entry, ramps)


def stop(velocity: int, acceleration: int, limits: Limits, end_units: int | None = None) -> Profile:
    """Return the shortest profile to a stop; it ends at a whole unit.

    An axis that already brakes continues to brake, but not beyond `end_units`, the end of its present profile.
    """
    if _brakes(velocity, acceleration, limits):
        entry = _brake_on(velocity, acceleration, limits)
        return _begun_with(entry if end_units is None else _within(end_units << PER_UNIT_BITS, entry), [])
    entry = _unbend(velocity, acceleration, limits)
    return _begun_with(entry, [_ramp(entry.ramp.to_velocity, 0, limits.deceleration, limits.jerk)])


def _begun_with(entry: EnteredRamp, ramps: list[Ramp]) -> Profile:
    return Profile([entry.ramp, *ramps], entry.skipped_ms)


def _unbend(velocity: int, acceleration: int, limits: Limits) -> EnteredRamp:
    """Return the ramp to acceleration 0: the second half of a ramp without constant acceleration.

    With the jerk of the present ramp, it takes no longer than the rest of that ramp. With a lower jerk it would exceed
    that ramp's velocities; then the velocity limit has priority over the jerk limit.
    """
    if not limits.jerk or not acceleration:
        return EnteredRamp(Ramp(velocity, velocity, 0), 0)
    steep = abs(acceleration)
    room = max(0, limits.velocity - (velocity if acceleration > 0 else -velocity))
    jerk = limits.jerk << (6 + FRACTION_BITS)  # units/s^3 to 2^-16 of 1/64 unit per ms^3, without the 10^-9
    half_ms = min(-(-steep * 1_000_000_000 // jerk), (room << (FRACTION_BITS + 1)) // steep)
    half_ms = max(GRAIN_MS, half_ms)
    change = rounded(acceleration * half_ms, FRACTION_BITS + 1)
    return EnteredRamp(Ramp(velocity - change, velocity + change, 2 * half_ms, half_ms), half_ms)


def _brakes(velocity: int, acceleration: int, limits: Limits) -> bool:
    """Return whether a jerk-limited motion already slows down."""
    return limits.jerk > 0 and velocity * acceleration < 0


def _overruns(distance: int, velocity: int, entry: EnteredRamp, limits: Limits) -> bool:
    """Return whether a braking axis is too fast after `entry` to stop in a distance in 1/128 unit.

    This includes an entry that reverses the axis before the distance is reached.
    """
    sign = 1 if velocity > 0 else -1
    left, speed = sign * (distance - entry.remaining), sign * entry.ramp.to_velocity
    if speed < 0:
        return left > 0
    return left < _ramp(speed, 0, limits.deceleration, limits.jerk).distance


def _brake_before(distance: int, velocity: int, acceleration: int, limits: Limits) -> EnteredRamp:
    """Return the slowest stop ramp of a braking axis within a distance in 1/128 unit; else the shortest one."""
    sign = 1 if velocity > 0 else -1

    def at(less: int) -> EnteredRamp:
        return _brake_on(velocity, acceleration, limits._replace(deceleration=limits.deceleration - less))

    return _within(
        distance, at(_highest(0, limits.deceleration - 1, lambda less: sign * at(less).remaining <= sign * distance))
    )


def _within(distance: int, entry: EnteredRamp) -> EnteredRamp:
    """Correct a stop ramp that exceeds a distance in 1/128 unit by less than the travel in one millisecond.

    Such an excess comes from whole milliseconds. With more excess the axis cannot stop there.
    """
    ramp, skipped_ms = entry
    excess = entry.remaining - distance
    if excess * ramp.from_velocity <= 0 or abs(excess) > abs(2 * ramp.from_velocity):
        return entry
    cube = ramp.duration_ms**3
    left = cube - skipped_ms**2 * (3 * ramp.duration_ms - 2 * skipped_ms)
    return entry._replace(ramp=ramp._replace(surplus=-(excess * cube // left)))


def _brake_on(velocity: int, acceleration: int, limits: Limits) -> EnteredRamp:
    """Return the remaining stop ramp of a braking axis.

    It keeps the deceleration limit, or the present deceleration if that is higher and cannot fall at once. The axis
    never reverses: if the deceleration cannot fall to 0 within the jerk before standstill, this has priority.
    """
    if velocity < 0:
        entry = _brake_on(-velocity, -acceleration, limits)
        return entry._replace(ramp=entry.ramp.mirrored())
    steep = -(acceleration * 1_000_000 >> (6 + FRACTION_BITS))  # in units/s^2, rounded up
    rate = max(limits.deceleration, steep)
    jerk = -(-rate * 1000 // _blend_ms(rate, limits.jerk))  # as low as whole milliseconds make it
    blended_ms = -(-steep * 1000 // jerk)
    ramp = _ramp(velocity - (-jerk * blended_ms**2 * 64 // 2_000_000_000), 0, rate, jerk)
    # A ramp of J ms of blend and T of duration has the axis' acceleration a and velocity v after s ms of its blend if
    # s^2 / 2 + s v / a = J (T - J). Whole milliseconds meet a nearly, and v exactly by the velocity it comes from.
    whole = 2 * ramp.blend_ms * (ramp.duration_ms - ramp.blend_ms)
    quotient = -(velocity << (2 * FRACTION_BITS)) // acceleration
    root = _root_up(quotient**2 + (whole << (2 * FRACTION_BITS)))
    if root - quotient > ramp.blend_ms << FRACTION_BITS and ramp.duration_ms == 2 * ramp.blend_ms:
        half_ms = max(GRAIN_MS, (velocity << (FRACTION_BITS + 1)) // -acceleration)
        return EnteredRamp(Ramp(2 * velocity, 0, 2 * half_ms, half_ms), half_ms)
    skipped_ms = min(ramp.blend_ms, rounded(root - quotient, FRACTION_BITS))
    return EnteredRamp(ramp._replace(from_velocity=velocity * whole // (whole - skipped_ms**2)), skipped_ms)


def _ramps_to(distance: int, velocity: int, limits: Limits) -> list[Ramp]:
    """Return the ramps from a velocity, at acceleration 0, to a stop after a distance in 1/128 unit; any signs."""
    if distance < 0 or (distance == 0 and velocity < 0):
        return [ramp.mirrored() for ramp in _ramps_to(-distance, -velocity, limits)]
    halt = _ramp(velocity, 0, limits.deceleration, limits.jerk)
    # Moving away from the target, or too fast to stop before it: first stop, then return.
    if velocity < 0 or (velocity > 0 and distance <= velocity * (halt.duration_ms - 1)):
        return [halt, *_ramps_to(distance - halt.distance, 0, limits)]
    return _approach(distance, velocity, limits) if distance else []


def _approach(distance: int, velocity: int, limits: Limits) -> list[Ramp]:
    """Return the ramps to a target ahead, far enough to stop there."""
    peak = _peak(distance, velocity, limits)
    if peak == 0:  # no room for a ramp to a peak: brake at once, or creep
        return [_brake(velocity, distance, limits) if velocity else _creep(distance, limits)]
    change = _ramp_to_peak(velocity, peak, limits)
    left = distance - change.distance
    cruise_ms = (left - _braking_distance(peak, limits)) // (2 * peak)
    cruise = Ramp(peak, peak, cruise_ms if cruise_ms >= GRAIN_MS else 0)
    return [change, cruise, _brake(peak, left - cruise.distance, limits)]


def _ramps_through(distance: int, velocity: int, limits: Limits, passing: Passing) -> list[Ramp] | None:
    """Return the ramps through a target, at a distance in 1/128 unit, to a stop at the next; None if impossible."""
    if passing.onward_units < 0:
        mirrored = _ramps_through(-distance, -velocity, limits, passing._replace(onward_units=-passing.onward_units))
        return None if mirrored is None else [ramp.mirrored() for ramp in mirrored]
    halt = _ramp(velocity, 0, limits.deceleration, limits.jerk)
    if velocity < 0:  # moving away from both targets: first stop, then return
        ramps = _ramps_through(distance - halt.distance, 0, limits, passing)
        return None if ramps is None else [halt, *ramps]
    if distance <= velocity * max(halt.duration_ms - 1, 0):  # behind the axis, or too close to stop there
        return None
    onward = passing.onward_units << PER_UNIT_BITS

    def has_room(at: int) -> bool:
        # Within the limits before the target, too: a halt just before it must end before the next one.
        stops = max(_braking_distance(at, passing.limits), _braking_distance(at, limits)) <= onward
        return stops and _reach_passing(velocity, at, at, limits) <= distance

    at = _highest(0, min(passing.velocity, limits.velocity), has_room)
    if at == 0:
        return None
    peak = _highest(at, limits.velocity, lambda peak: _reach_passing(velocity, peak, at, limits) <= distance)
    change, last = _ramp_to_peak(velocity, peak, limits), _ramp_to_peak(peak, at, limits)
    left = distance - change.distance - last.distance
    cruise_ms = -(-left // (2 * peak))
    cruise = Ramp(peak, peak, cruise_ms, surplus=left - 2 * peak * cruise_ms)
    return [change, cruise, last, *_ramps_to(onward, at, passing.limits)]


def _reach_passing(velocity: int, peak: int, at: int, limits: Limits) -> int:
    """Return the distance of the ramps to a peak and from it to a velocity, with the shortest cruise between them."""
    ramps = _ramp_to_peak(velocity, peak, limits).distance + _ramp_to_peak(peak, at, limits).distance
    return ramps + 2 * peak * _shortest_cruise_ms(peak, limits)


def _shortest_cruise_ms(velocity: int, limits: Limits) -> int:
    """Return the shortest cruise in which the travel of one millisecond can be subtracted within the limits.

    The subtraction needs an acceleration of at most 6 D / T^2, which begins at once. With a jerk limit, it must not
    exceed what the jerk allows within one segment.
    """
    rate = min(limits.acceleration, limits.deceleration)
    if limits.jerk:
        rate = max(1, min(rate, limits.jerk * PIECE_MS // 1000))
    return max(GRAIN_MS, _root_up(-(-6 * velocity * 1_000_000 // (rate << 6))))


def _peak(distance: int, velocity: int, limits: Limits) -> int:
    """Return the highest velocity from which the axis can stop within the distance; 0 if there is none."""
    low = limits.velocity if velocity > limits.velocity else max(velocity, 1)
    if _reach(velocity, low, limits) > distance:
        return 0
    return _highest(low, limits.velocity, lambda peak: _reach(velocity, peak, limits) <= distance)


def _highest(low: int, high: int, fits: Callable[[int], bool]) -> int:
    """Return the highest velocity for which `fits` is true, by bisection; it must be true for `low`."""
    high += 1
    while high - low > 1:
        middle = (low + high) // 2
        if fits(middle):
            low = middle
        else:
            high = middle
    return low


def _reach(velocity: int, peak: int, limits: Limits) -> int:
    """Return the distance of the ramp to a peak and of the stop from it."""
    return _ramp_to_peak(velocity, peak, limits).distance + _braking_distance(peak, limits)


def _ramp_to_peak(velocity: int, peak: int, limits: Limits) -> Ramp:
    rate = limits.acceleration if peak > velocity else limits.deceleration
    return _ramp(velocity, peak, rate, limits.jerk)


def _braking_distance(velocity: int, limits: Limits) -> int:
    return velocity * (_ramp(velocity, 0, limits.deceleration, limits.jerk).duration_ms + _SLACK_MS)


def _brake(velocity: int, distance: int, limits: Limits) -> Ramp:
    """Return the stop ramp with an exact distance: brake longer, then subtract the excess distance.

    The distance may be shorter than that of the shortest ramp by the travel of one millisecond.
    """
    shortest = _ramp(velocity, 0, limits.deceleration, limits.jerk)
    duration_ms = max(shortest.duration_ms, -(-distance // velocity))
    return shortest._replace(duration_ms=duration_ms, surplus=distance - velocity * duration_ms)


def _creep(distance: int, limits: Limits) -> Ramp:
    """Return the ramp over a very short distance from standstill: only a smoothstep, with acceleration 6 D / T^2."""
    rate = min(limits.acceleration, limits.deceleration)
    shortest_ms = _root_up(-(-6 * distance * 1_000_000 // (rate << PER_UNIT_BITS)))
    return Ramp(0, 0, max(2 * GRAIN_MS, shortest_ms), surplus=distance)


def _ramp(from_velocity: int, to_velocity: int, acceleration: int, jerk: int) -> Ramp:
    """Return the shortest ramp of whole milliseconds, at least GRAIN_MS, that keeps acceleration and jerk.

    With a duration of T ms and a blend of J ms, the acceleration is |dv| / (T - J), and the jerk is that divided by J.
    """
    change = abs(to_velocity - from_velocity)
    if change == 0:
        return Ramp(from_velocity, to_velocity, 0)
    linear_ms = -(-change * 1_000_000 // (acceleration << 6))
    if not jerk:
        return Ramp(from_velocity, to_velocity, max(GRAIN_MS, linear_ms))
    blend_ms = _blend_ms(acceleration, jerk)
    if blend_ms <= linear_ms:  # the acceleration reaches its limit
        return Ramp(from_velocity, to_velocity, linear_ms + blend_ms, blend_ms)
    blend_ms = max(GRAIN_MS, _root_up(-(-change * 1_000_000_000 // (jerk << 6))))
    return Ramp(from_velocity, to_velocity, 2 * blend_ms, blend_ms)


def _blend_ms(acceleration: int, jerk: int) -> int:
    """Return the time in which the acceleration rises to its limit."""
    return max(GRAIN_MS, -(-acceleration * 1000 // jerk))


def _root_up(square: int) -> int:
    """Return the square root of a positive integer, rounded up, by Newton's method from above."""
    root = 1 << ((square.bit_length() + 1) // 2)
    while (better := (root + square // root) >> 1) < root:
        root = better
    return root if root * root >= square else root + 1
