"""Generate motion profiles: from any velocity to rest at a target, or through one target and to rest at the next.

A profile is handed out as segments of whole milliseconds.

A profile is a sequence of ramps: to the peak velocity, a cruise at the peak, and the brake to rest. Each ramp goes
between two whole velocities in whole milliseconds. A ramp symmetric in time covers (v0 + v1) T / 2 whatever its shape,
so linear and jerk-limited ramps are planned alike; they differ only in how long a change of velocity takes. Whole
milliseconds rarely add up to the exact distance. The last ramp makes up for it: it is stretched until it covers the
distance or a little more, and the excess is subtracted along a smoothstep, so that it ends exactly at the target.

A target on the way is passed at an exact velocity. There is no brake to make up for the milliseconds: the cruise before
it does, as long as this needs, and gives the excess back along a smoothstep.

Velocities are whole multiples of 1/64 unit per ms, as on the wire. Distances are planned in 1/128 unit, so that
(v0 + v1) T / 2 is a whole number. These are functions of numbers alone, without CANopen, an axis or a clock.

Accuracy: `Profile` rounds positions to units and velocities to 1/64 unit per ms. On a segment of T ms, T >= GRAIN_MS,
that changes speeds by less than 3 / T + 1/64 units per ms and accelerations by less than (6 / T + 1/16) / T units per
ms^2; `_unbend` may add 1/64 unit per ms. Apart from rounding, speed and acceleration keep their limits, with two
exceptions. First, a target may be moved nearer during the motion, so that hardly more than the shortest way to stop is
left: stopping there in T ms takes up to (1 + 3 / T) times the deceleration. If even less is left, the axis overshoots
and comes back. Second, where a jerk-limited ramp has constant acceleration for less than GRAIN_MS, one segment's cubic
spans a bend of the acceleration and exceeds it by at most 2/9.
"""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

GRAIN_MS = 8
"""Shortest segment: in a shorter one, rounding to units would be a noticeable jerk."""
PIECE_MS = 16
"""Longest segment: a new set-point must wait for the segment in execution."""

_PER_UNIT_BITS = 7
"""Distances are planned in 1/128 unit."""
_FRACTION_BITS = 16
"""Further binary places of distances and velocities within a ramp."""
_SLACK_MS = 4
"""Extra time planned for the last ramp, so that subtracting the excess distance keeps its deceleration."""


class Limits(NamedTuple):
    """The limits of a motion.

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
    """How a target is passed on the way to the next one.

    Attributes:
        velocity: speed wanted at the target, in 1/64 unit per ms.
        onward_units: the way from the target to the next one, where the axis stops.
        limits: the limits of the motion onward.
    """

    velocity: int
    onward_units: int
    limits: Limits


class Segment(NamedTuple):
    """One cubic for the kernel, and the acceleration at its end, in 2^-16 of 1/64 unit per ms^2."""

    displacement_units: int
    end_velocity: int
    duration_ms: int
    end_acceleration: int


class Ramp(NamedTuple):
    """A change from one velocity to another. The acceleration rises and falls linearly, for `blend_ms` at either end.

    `surplus` is a further distance in 1/128 unit, covered at the same time along the smoothstep 3 x^2 - 2 x^3. It is
    negative where the stretched last ramp would go too far.
    """

    from_velocity: int
    to_velocity: int
    duration_ms: int
    blend_ms: int = 0
    surplus: int = 0

    @property
    def distance(self) -> int:
        """The whole distance covered, in 1/128 unit."""
        return (self.from_velocity + self.to_velocity) * self.duration_ms + self.surplus

    @property
    def _change(self) -> int:
        return self.to_velocity - self.from_velocity

    @property
    def _divisor(self) -> int:
        """The time that the highest acceleration alone would take for the change of velocity."""
        return self.duration_ms - self.blend_ms

    def position(self, t_ms: int) -> int:
        """Return the distance covered after a time, in 2^-16 of 1/128 unit."""
        left_ms, blend, divisor = self.duration_ms - t_ms, self.blend_ms, self._divisor
        if t_ms < blend:  # the acceleration rises: a cubic in the time since the start
            plain = (2 * self.from_velocity * t_ms << _FRACTION_BITS) + (
                (self._change * t_ms**3 << _FRACTION_BITS) // (3 * blend * divisor)
            )
        elif left_ms < blend:  # the acceleration falls: the same cubic, back from the end
            plain = ((self.distance - self.surplus - 2 * self.to_velocity * left_ms) << _FRACTION_BITS) + (
                (self._change * left_ms**3 << _FRACTION_BITS) // (3 * blend * divisor)
            )
        else:  # constant acceleration, after the distance of the first blend
            bent = blend * blend + 3 * t_ms * (t_ms - blend)
            plain = (2 * self.from_velocity * t_ms << _FRACTION_BITS) + (
                (self._change * bent << _FRACTION_BITS) // (3 * divisor)
            )
        smooth = t_ms * t_ms * (3 * self.duration_ms - 2 * t_ms)
        return plain + (self.surplus * smooth << _FRACTION_BITS) // self.duration_ms**3

    def velocity(self, t_ms: int) -> int:
        """Return the velocity after a time, in 2^-16 of 1/64 unit per ms."""
        left_ms, blend, divisor = self.duration_ms - t_ms, self.blend_ms, self._divisor
        change = self._change << _FRACTION_BITS
        if t_ms < blend:
            plain = (self.from_velocity << _FRACTION_BITS) + change * t_ms * t_ms // (2 * blend * divisor)
        elif left_ms < blend:
            plain = (self.to_velocity << _FRACTION_BITS) - change * left_ms * left_ms // (2 * blend * divisor)
        else:
            plain = (self.from_velocity << _FRACTION_BITS) + change * (2 * t_ms - blend) // (2 * divisor)
        return plain + (self.surplus * 3 * t_ms * left_ms << _FRACTION_BITS) // self.duration_ms**3

    def acceleration(self, t_ms: int) -> int:
        """Return the acceleration after a time, in 2^-16 of 1/64 unit per ms^2; 0 for a linear ramp, which may step."""
        if self.blend_ms == 0:
            return 0
        left_ms = self.duration_ms - t_ms
        change = self._change << _FRACTION_BITS
        if min(t_ms, left_ms) < self.blend_ms:
            return change * min(t_ms, left_ms) // (self.blend_ms * self._divisor)
        return change // self._divisor

    def piece_ms(self, t_ms: int) -> int:
        """Return the duration of the segment that begins after a time, so that no segment spans a bend of acceleration.

        There is one exception: if the two bends are too near to each other for a segment between them, the segments
        meet in the middle of the ramp, and each spans a bend.
        """
        between_ms = self.duration_ms - 2 * self.blend_ms
        if self.blend_ms == 0:
            knots: tuple[int, ...] = (self.duration_ms,)
        elif 0 < between_ms < GRAIN_MS:
            knots = (self.duration_ms // 2, self.duration_ms)
        else:
            knots = (self.blend_ms, self.blend_ms + between_ms, self.duration_ms)
        left_ms = next(knot for knot in knots if knot > t_ms) - t_ms
        if left_ms <= PIECE_MS:
            return left_ms
        return PIECE_MS if left_ms >= 2 * PIECE_MS else left_ms // 2  # halves: no short segment is left over

    def mirrored(self) -> "Ramp":
        """Return the same ramp in the other direction."""
        return self._replace(from_velocity=-self.from_velocity, to_velocity=-self.to_velocity, surplus=-self.surplus)


class Profile:
    """Yields the segments of a sequence of ramps. Positions are rounded, not displacements: roundings do not add up."""

    def __init__(self, ramps: list[Ramp], skipped_ms: int = 0) -> None:
        self._ramps = deque(ramp for ramp in ramps if ramp.duration_ms)
        self._elapsed_ms = skipped_ms
        self._ramp_start = -self._ramps[0].position(skipped_ms) if self._ramps else 0
        self._units = 0

    def next_segment(self) -> Segment | None:
        """Return the next segment; None at the end."""
        if not self._ramps:
            return None
        ramp = self._ramps[0]
        duration_ms = ramp.piece_ms(self._elapsed_ms)
        self._elapsed_ms += duration_ms
        position = self._ramp_start + ramp.position(self._elapsed_ms)
        units = _rounded(position, _PER_UNIT_BITS + _FRACTION_BITS)
        velocity = _rounded(ramp.velocity(self._elapsed_ms), _FRACTION_BITS)
        segment = Segment(units - self._units, velocity, duration_ms, ramp.acceleration(self._elapsed_ms))
        self._units = units
        if self._elapsed_ms == ramp.duration_ms:
            self._ramps.popleft()
            self._elapsed_ms = 0
            self._ramp_start = position
        return segment


def move(distance_units: int, velocity: int, acceleration: int, limits: Limits) -> Profile:
    """Return the profile to rest at a distance, from a velocity and an acceleration.

    A jerk-limited motion first brings the acceleration to 0.
    """
    unbend, velocity = _unbend(velocity, acceleration, limits)
    distance = (distance_units << _PER_UNIT_BITS) - _way_of(unbend)
    return _begun_with(unbend, _ramps_to(distance, velocity, limits))


def move_through(
    distance_units: int, velocity: int, acceleration: int, limits: Limits, passing: Passing
) -> Profile | None:
    """Return the profile that passes a target at a distance and comes to rest at the next one.

    It passes the target at the velocity wanted, or as fast as the limits, the way to it and the way onward allow. None
    if it must stop there: the next target is not farther in the same direction, or there is no room to pass.
    """
    unbend, velocity = _unbend(velocity, acceleration, limits)
    distance = (distance_units << _PER_UNIT_BITS) - _way_of(unbend)
    ramps = _ramps_through(distance, velocity, limits, passing)
    return None if ramps is None else _begun_with(unbend, ramps)


def stop(velocity: int, acceleration: int, limits: Limits) -> Profile:
    """Return the shortest profile to rest; it ends at a whole unit."""
    unbend, velocity = _unbend(velocity, acceleration, limits)
    return _begun_with(unbend, [_ramp(velocity, 0, limits.deceleration, limits.jerk)])


def _unbend(velocity: int, acceleration: int, limits: Limits) -> tuple[Ramp | None, int]:
    """Return the way to acceleration 0, and the velocity after it; no ramp if the acceleration needs none.

    The way is the second half of a ramp without constant acceleration, so its caller skips the first half. With the
    jerk of the ramp that it leaves, it takes no longer than the rest of that ramp would. With a lower jerk it would
    lead beyond that ramp's velocities; then the velocity limit has priority over the jerk limit.
    """
    if not limits.jerk or not acceleration:
        return None, velocity
    steep = abs(acceleration)
    room = max(0, limits.velocity - (velocity if acceleration > 0 else -velocity))
    jerk = limits.jerk << (6 + _FRACTION_BITS)  # units/s^3 to 2^-16 of 1/64 unit per ms^3, without the 10^-9
    half_ms = min(-(-steep * 1_000_000_000 // jerk), (room << (_FRACTION_BITS + 1)) // steep)
    half_ms = max(GRAIN_MS, half_ms)
    change = _rounded(acceleration * half_ms, _FRACTION_BITS + 1)
    after = velocity + change
    return Ramp(velocity - change, after, 2 * half_ms, half_ms), after


def _begun_with(unbend: Ramp | None, ramps: list[Ramp]) -> Profile:
    """Return the profile of ramps behind the second half of the ramp that brings the acceleration to 0, if any."""
    return Profile(ramps) if unbend is None else Profile([unbend, *ramps], skipped_ms=unbend.duration_ms // 2)


def _way_of(unbend: Ramp | None) -> int:
    """Return how far the second half of that ramp leads, in 1/128 unit."""
    if unbend is None:
        return 0
    covered = (unbend.distance << _FRACTION_BITS) - unbend.position(unbend.duration_ms // 2)
    return _rounded(covered, _FRACTION_BITS)


def _ramps_to(distance: int, velocity: int, limits: Limits) -> list[Ramp]:
    """Return the ramps from a velocity, at acceleration 0, to rest at a distance in 1/128 unit; both of any sign."""
    if distance < 0 or (distance == 0 and velocity < 0):
        return [ramp.mirrored() for ramp in _ramps_to(-distance, -velocity, limits)]
    halt = _ramp(velocity, 0, limits.deceleration, limits.jerk)
    # Moving away from the target, or too fast to stop before it: first halt, then come back from rest.
    if velocity < 0 or (velocity > 0 and distance <= velocity * (halt.duration_ms - 1)):
        return [halt, *_ramps_to(distance - halt.distance, 0, limits)]
    return _approach(distance, velocity, limits) if distance else []


def _approach(distance: int, velocity: int, limits: Limits) -> list[Ramp]:
    """Return the ramps to a target ahead that is far enough to stop there."""
    peak = _peak(distance, velocity, limits)
    if peak == 0:  # no room for a ramp to a peak: brake at once, or creep
        return [_brake(velocity, distance, limits) if velocity else _creep(distance, limits)]
    change = _ramp_to_peak(velocity, peak, limits)
    left = distance - change.distance
    cruise_ms = (left - _way_to_brake(peak, limits)) // (2 * peak)
    cruise = Ramp(peak, peak, cruise_ms if cruise_ms >= GRAIN_MS else 0)
    return [change, cruise, _brake(peak, left - cruise.distance, limits)]


def _ramps_through(distance: int, velocity: int, limits: Limits, passing: Passing) -> list[Ramp] | None:
    """Return the ramps through a target at a distance in 1/128 unit to rest at the next; None if it must stop there."""
    if passing.onward_units < 0:
        mirrored = _ramps_through(-distance, -velocity, limits, passing._replace(onward_units=-passing.onward_units))
        return None if mirrored is None else [ramp.mirrored() for ramp in mirrored]
    halt = _ramp(velocity, 0, limits.deceleration, limits.jerk)
    if velocity < 0:  # moving away from both targets: first halt, then come back from rest
        ramps = _ramps_through(distance - halt.distance, 0, limits, passing)
        return None if ramps is None else [halt, *ramps]
    if distance <= velocity * max(halt.duration_ms - 1, 0):  # behind the axis, or too near to stop there
        return None
    onward = passing.onward_units << _PER_UNIT_BITS

    def has_room(at: int) -> bool:
        # Within the limits before the target, too: a halt just before it must end before the next one.
        stops = max(_way_to_brake(at, passing.limits), _way_to_brake(at, limits)) <= onward
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
    """Return the distance of the ramps to a peak and on to a velocity, and of the shortest cruise between them."""
    ramps = _ramp_to_peak(velocity, peak, limits).distance + _ramp_to_peak(peak, at, limits).distance
    return ramps + 2 * peak * _shortest_cruise_ms(peak, limits)


def _shortest_cruise_ms(velocity: int, limits: Limits) -> int:
    """Return how long a cruise takes in which a millisecond's way can be given back within the limits.

    Its acceleration is then 6 D / T^2 at most. It begins at once: with a jerk limit, it is no more than that limit
    allows in a segment.
    """
    rate = min(limits.acceleration, limits.deceleration)
    if limits.jerk:
        rate = max(1, min(rate, limits.jerk * PIECE_MS // 1000))
    return max(GRAIN_MS, _root_up(-(-6 * velocity * 1_000_000 // (rate << 6))))


def _peak(distance: int, velocity: int, limits: Limits) -> int:
    """Return the highest velocity that lets the axis still stop at the distance; 0 if none."""
    low = limits.velocity if velocity > limits.velocity else max(velocity, 1)
    if _reach(velocity, low, limits) > distance:
        return 0
    return _highest(low, limits.velocity, lambda peak: _reach(velocity, peak, limits) <= distance)


def _highest(low: int, high: int, fits: Callable[[int], bool]) -> int:
    """Return the highest velocity between two that fits, by bisection; `low` is known to fit."""
    high += 1
    while high - low > 1:
        middle = (low + high) // 2
        if fits(middle):
            low = middle
        else:
            high = middle
    return low


def _reach(velocity: int, peak: int, limits: Limits) -> int:
    """Return the distance of the ramp to a peak and of braking from it."""
    return _ramp_to_peak(velocity, peak, limits).distance + _way_to_brake(peak, limits)


def _ramp_to_peak(velocity: int, peak: int, limits: Limits) -> Ramp:
    rate = limits.acceleration if peak > velocity else limits.deceleration
    return _ramp(velocity, peak, rate, limits.jerk)


def _way_to_brake(velocity: int, limits: Limits) -> int:
    return velocity * (_ramp(velocity, 0, limits.deceleration, limits.jerk).duration_ms + _SLACK_MS)


def _brake(velocity: int, distance: int, limits: Limits) -> Ramp:
    """Return the ramp to rest at an exact distance: brake longer, then subtract the excess distance.

    The distance is at least that of the shortest ramp, less a millisecond's worth.
    """
    shortest = _ramp(velocity, 0, limits.deceleration, limits.jerk)
    duration_ms = max(shortest.duration_ms, -(-distance // velocity))
    return shortest._replace(duration_ms=duration_ms, surplus=distance - velocity * duration_ms)


def _creep(distance: int, limits: Limits) -> Ramp:
    """Return a ramp from rest to rest over a very short distance: a smoothstep alone, with acceleration 6 D / T^2."""
    rate = min(limits.acceleration, limits.deceleration)
    shortest_ms = _root_up(-(-6 * distance * 1_000_000 // (rate << _PER_UNIT_BITS)))
    return Ramp(0, 0, max(2 * GRAIN_MS, shortest_ms), surplus=distance)


def _ramp(from_velocity: int, to_velocity: int, acceleration: int, jerk: int) -> Ramp:
    """Return the shortest ramp, of whole milliseconds and at least GRAIN_MS, that keeps acceleration and jerk.

    With T ms of duration and J ms of blend the acceleration is |dv| / (T - J), and the jerk is that divided by J.
    """
    change = abs(to_velocity - from_velocity)
    if change == 0:
        return Ramp(from_velocity, to_velocity, 0)
    linear_ms = -(-change * 1_000_000 // (acceleration << 6))
    if not jerk:
        return Ramp(from_velocity, to_velocity, max(GRAIN_MS, linear_ms))
    blend_ms = max(GRAIN_MS, -(-acceleration * 1000 // jerk))
    if blend_ms <= linear_ms:  # the acceleration reaches its limit
        return Ramp(from_velocity, to_velocity, linear_ms + blend_ms, blend_ms)
    blend_ms = max(GRAIN_MS, _root_up(-(-change * 1_000_000_000 // (jerk << 6))))
    return Ramp(from_velocity, to_velocity, 2 * blend_ms, blend_ms)


def _root_up(square: int) -> int:
    """Return the square root of a positive integer, rounded up; by Newton's method from above."""
    root = 1 << ((square.bit_length() + 1) // 2)
    while (better := (root + square // root) >> 1) < root:
        root = better
    return root if root * root >= square else root + 1


def _rounded(value: int, bits: int) -> int:
    """Round a fixed-point value to the nearest integer."""
    return (value + (1 << (bits - 1))) >> bits
