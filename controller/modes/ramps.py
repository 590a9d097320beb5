"""Velocity ramps, and profiles of several ramps, cut into segments of whole milliseconds.

A ramp connects two velocities in whole milliseconds. It is symmetric in time, so for any shape it covers the distance
(v0 + v1) T / 2. Velocities are integers in 1/64 unit per ms, as on the wire. Distances are integers in 1/128 unit,
which makes (v0 + v1) T / 2 an integer.
"""

from collections import deque
from typing import NamedTuple

GRAIN_MS = 8
"""Shortest segment. In a shorter one, rounding to units would cause a noticeable jerk."""
PIECE_MS = 16
"""Longest segment. A new set-point must wait until the present segment ends."""

PER_UNIT_BITS = 7
"""Binary places of distances: 1/128 unit."""
FRACTION_BITS = 16
"""Additional binary places of distances and velocities within a ramp."""


class Segment(NamedTuple):
    """One cubic for the kernel; `end_acceleration` is in 2^-16 of 1/64 unit per ms^2."""

    displacement_units: int
    end_velocity: int
    duration_ms: int
    end_acceleration: int


class Ramp(NamedTuple):
    """A change of velocity; the acceleration rises and falls linearly, for `blend_ms` at each end.

    `surplus` is an additional distance in 1/128 unit, covered along the smoothstep 3 x^2 - 2 x^3. It is negative if the
    stretched last ramp would overshoot.
    """

    from_velocity: int
    to_velocity: int
    duration_ms: int
    blend_ms: int = 0
    surplus: int = 0

    @property
    def distance(self) -> int:
        """Distance of the whole ramp, in 1/128 unit."""
        return (self.from_velocity + self.to_velocity) * self.duration_ms + self.surplus

    @property
    def _change(self) -> int:
        return self.to_velocity - self.from_velocity

    @property
    def _divisor(self) -> int:
        """Time that the change of velocity would take with the highest acceleration alone."""
        return self.duration_ms - self.blend_ms

    def position(self, t_ms: int) -> int:
        """Return the distance after `t_ms`, in 2^-16 of 1/128 unit."""
        left_ms, blend, divisor = self.duration_ms - t_ms, self.blend_ms, self._divisor
        if t_ms < blend:  # the acceleration rises: a cubic in the time since the start
            plain = (2 * self.from_velocity * t_ms << FRACTION_BITS) + (
                (self._change * t_ms**3 << FRACTION_BITS) // (3 * blend * divisor)
            )
        elif left_ms < blend:  # the acceleration falls: the same cubic, back from the end
            plain = ((self.distance - self.surplus - 2 * self.to_velocity * left_ms) << FRACTION_BITS) + (
                (self._change * left_ms**3 << FRACTION_BITS) // (3 * blend * divisor)
            )
        else:  # constant acceleration, after the distance of the first blend
            bent = blend * blend + 3 * t_ms * (t_ms - blend)
            plain = (2 * self.from_velocity * t_ms << FRACTION_BITS) + (
                (self._change * bent << FRACTION_BITS) // (3 * divisor)
            )
        smooth = t_ms * t_ms * (3 * self.duration_ms - 2 * t_ms)
        return plain + (self.surplus * smooth << FRACTION_BITS) // self.duration_ms**3

    def velocity(self, t_ms: int) -> int:
        """Return the velocity after `t_ms`, in 2^-16 of 1/64 unit per ms."""
        left_ms, blend, divisor = self.duration_ms - t_ms, self.blend_ms, self._divisor
        change = self._change << FRACTION_BITS
        if t_ms < blend:
            plain = (self.from_velocity << FRACTION_BITS) + change * t_ms * t_ms // (2 * blend * divisor)
        elif left_ms < blend:
            plain = (self.to_velocity << FRACTION_BITS) - change * left_ms * left_ms // (2 * blend * divisor)
        else:
            plain = (self.from_velocity << FRACTION_BITS) + change * (2 * t_ms - blend) // (2 * divisor)
        return plain + (self.surplus * 3 * t_ms * left_ms << FRACTION_BITS) // self.duration_ms**3

    def acceleration(self, t_ms: int) -> int:
        """Return the acceleration after `t_ms`, in 2^-16 of 1/64 unit per ms^2; 0 for a linear ramp."""
        if self.blend_ms == 0:
            return 0
        left_ms = self.duration_ms - t_ms
        change = self._change << FRACTION_BITS
        if min(t_ms, left_ms) < self.blend_ms:
            return change * min(t_ms, left_ms) // (self.blend_ms * self._divisor)
        return change // self._divisor

    def piece_ms(self, t_ms: int) -> int:
        """Return the duration of the segment that begins after `t_ms`; segments should not span a bend of acceleration.

        There are two exceptions. If the two bends are too close for a segment between them, two segments meet in the
        middle of the ramp, and each spans a bend. If a bend is too close for a segment that ends there, it is spanned.
        """
        between_ms = self.duration_ms - 2 * self.blend_ms
        if self.blend_ms == 0:
            knots: tuple[int, ...] = (self.duration_ms,)
        elif 0 < between_ms < GRAIN_MS:
            knots = (self.duration_ms // 2, self.duration_ms)
        else:
            knots = (self.blend_ms, self.blend_ms + between_ms, self.duration_ms)
        left_ms = next(knot for knot in knots if knot >= t_ms + GRAIN_MS) - t_ms
        if left_ms <= PIECE_MS:
            return left_ms
        return PIECE_MS if left_ms >= 2 * PIECE_MS else left_ms // 2  # halves: no short segment is left over

    def mirrored(self) -> "Ramp":
        """Return the same ramp in the other direction."""
        return self._replace(from_velocity=-self.from_velocity, to_velocity=-self.to_velocity, surplus=-self.surplus)


class EnteredRamp(NamedTuple):
    """A ramp that the axis enters after `skipped_ms`, where velocity and acceleration match its own."""

    ramp: Ramp
    skipped_ms: int

    @property
    def remaining(self) -> int:
        """Distance of the remaining ramp, in 1/128 unit."""
        if not self.ramp.duration_ms:
            return 0
        covered = (self.ramp.distance << FRACTION_BITS) - self.ramp.position(self.skipped_ms)
        return rounded(covered, FRACTION_BITS)


class Profile:
    """Yields the segments of a sequence of ramps. It rounds positions, not displacements: errors do not add up."""

    def __init__(self, ramps: list[Ramp], skipped_ms: int = 0) -> None:
        self._ramps = deque(ramp for ramp in ramps if ramp.duration_ms)
        self._elapsed_ms = skipped_ms
        self._ramp_start = -self._ramps[0].position(skipped_ms) if self._ramps else 0
        self._units = 0
        whole = sum(ramp.distance for ramp in self._ramps) << FRACTION_BITS
        self.travel_units: int = rounded(self._ramp_start + whole, PER_UNIT_BITS + FRACTION_BITS)
        """Distance of the whole profile."""

    def next_segment(self) -> Segment | None:
        """Return the next segment; None at the end."""
        if not self._ramps:
            return None
        ramp = self._ramps[0]
        duration_ms = ramp.piece_ms(self._elapsed_ms)
        self._elapsed_ms += duration_ms
        position = self._ramp_start + ramp.position(self._elapsed_ms)
        units = rounded(position, PER_UNIT_BITS + FRACTION_BITS)
        velocity = rounded(ramp.velocity(self._elapsed_ms), FRACTION_BITS)
        segment = Segment(units - self._units, velocity, duration_ms, ramp.acceleration(self._elapsed_ms))
        self._units = units
        if self._elapsed_ms == ramp.duration_ms:
            self._ramps.popleft()
            self._elapsed_ms = 0
            self._ramp_start = position
        return segment


def rounded(value: int, bits: int) -> int:
    """Round a fixed-point value to the nearest integer."""
    return (value + (1 << (bits - 1))) >> bits
