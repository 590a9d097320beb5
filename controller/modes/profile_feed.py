"""Keep an axis' segment queue filled with the next segments of a profile.

The queue is short: a new profile drops it and begins at the end of the present segment. Before another motion, such as
a stop ramp, the drive calls `abandon`; the next profile then waits for standstill.
"""

from collections import deque
from typing import NamedTuple

from steptwin.controller.modes.interpolation import Interpolation
from steptwin.controller.modes.profile import Limits, Passing, move, move_through, stop
from steptwin.controller.modes.ramps import GRAIN_MS, Profile, Segment
from steptwin.controller.motion.axis_motion import Refusal
from steptwin.controller.motion.kernel import STEP_Q16
from steptwin.controller.node.axis_context import AxisContext
from steptwin.controller.node.stops import HALTS, StopKind
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.od import UNITS_PER_FULL_STEP
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS

AHEAD_MS = 48
"""Least duration of motion in the queue behind the present segment."""
PERIOD_US = 16_000
"""Period in which the queue is filled; AHEAD_MS is three times as long."""

_VELOCITY_MARGIN = 3 * VELOCITY_PER_UNIT_PER_MS // GRAIN_MS + 8
"""Bound of the velocity that rounding to units adds: profiles stay below the kernel's limit by this margin."""


class _Piece(NamedTuple):
    """Data of a queued segment, kept until it has been executed."""

    duration_ms: int
    start_velocity: int
    end_velocity: int
    end_acceleration: int


class ProfileFeed:
    """Queues the segments of one axis' profiles; shared by the modes that use profiles."""

    def __init__(self, context: AxisContext, records: Interpolation) -> None:
        self._context = context
        self._motion = context.motion
        self._dictionary = context.dictionary
        self._records = records
        self._profile = Profile([])
        self._end_units = 0
        """End position of the profile."""
        self._pieces: deque[_Piece] = deque()
        """Present segment, if any, then the waiting ones."""
        self.active: bool = False
        """True while the axis moves by a profile."""
        self.due_us: int | None = None
        """Time of the next call of `poll`; None if there is nothing to queue."""

    @property
    def free(self) -> bool:
        """True if a profile may begin: the axis is at standstill, or moves by a profile."""
        return self.active or not self._motion.running

    @property
    def steady_velocity(self) -> int | None:
        """Demanded velocity in 1/64 unit per ms if it is constant; None while it changes."""
        if not self._motion.running:
            return 0
        waiting = self._motion.queued
        if not self.active or waiting >= len(self._pieces):
            return None
        piece = self._pieces[-1 - waiting]
        return piece.end_velocity if piece.start_velocity == piece.end_velocity else None

    def take_over(self) -> int:
        """Drop all waiting segments, PVT records included; return where the running one ends and a profile begins."""
        self._records.close()
        self._forget_done()
        while len(self._pieces) > int(self._motion.running):
            self._pieces.pop()
        self._motion.drop_queued()
        return self._motion.tail_units

    def limits(self, velocity: int) -> Limits | None:
        """Return the limits from the present objects, for a speed in 1/64 unit per ms.

        Return None if the velocity limit is not above the rounding margin: the axis is then too slow for profiles.
        """
        get = self._dictionary.get
        fastest = self._fastest(self._motion.config.rate_limit_q16_per_ms)
        if fastest < 1:
            return None
        return Limits(
            velocity=max(1, min(velocity, fastest)),
            acceleration=min(get(od.PROFILE_ACCELERATION), get(od.MAX_ACCELERATION)),
            deceleration=min(get(od.PROFILE_DECELERATION), get(od.MAX_DECELERATION)),
            jerk=get(od.PROFILE_JERK) if get(od.MOTION_PROFILE_TYPE) else 0,
        )

    def _fastest(self, rate_q16_per_ms: int) -> int:
        """Return the highest velocity of profiles within a step rate, in 1/64 unit per ms; below 1 if there is none."""
        units_q16 = UNITS_PER_FULL_STEP * rate_q16_per_ms // self._motion.config.microsteps
        return units_q16 * VELOCITY_PER_UNIT_PER_MS // STEP_Q16 - _VELOCITY_MARGIN

    def move_to(self, target_units: int, limits: Limits) -> None:
        """Move to a target and stop there, from the end of the running segment; apply the present speed limit."""
        limits = self._within_speed(limits)
        distance = target_units - self.take_over()
        self._begin(move(distance, self._motion.tail_velocity, self._acceleration, limits))

    def move_through(self, target_units: int, limits: Limits, passing: Passing) -> bool:
        """Move through a target and stop at the next one; return False, with no change, if that is impossible."""
        from_units, velocity = self._motion.running_end
        self._forget_done()
        acceleration = self._pieces[-1 - self._motion.queued].end_acceleration if self._motion.running else 0
        passing = passing._replace(limits=self._within_speed(passing.limits))
        profile = move_through(target_units - from_units, velocity, acceleration, self._within_speed(limits), passing)
        if profile is None:
            return False
        self.take_over()
        self._begin(profile)
        return True

    def _within_speed(self, limits: Limits) -> Limits:
        fastest = max(1, self._fastest(self._motion.rate_limit_q16_per_ms))
        return limits._replace(velocity=min(limits.velocity, fastest))

    def halt(self, limits: Limits) -> None:
        """Stop as the halt option code (605Dh) selects: with the deceleration of `limits` or of a quick stop."""
        quick = HALTS[self._dictionary.get(od.HALT_OPTION)] is StopKind.QUICK_STOP
        self.stop(limits._replace(deceleration=self._dictionary.get(od.QUICK_STOP_DECELERATION)) if quick else limits)

    def stop(self, limits: Limits) -> None:
        """Stop as soon as the limits allow."""
        from_units = self.take_over()
        end_units = self._end_units - from_units if self.active else None
        self._begin(stop(self._motion.tail_velocity, self._acceleration, limits, end_units))

    @property
    def _acceleration(self) -> int:
        return self._pieces[-1].end_acceleration if self._pieces else 0

    def _forget_done(self) -> None:
        """Remove the executed segments from `_pieces`."""
        kept = self._motion.queued + int(self._motion.running)
        while len(self._pieces) > kept:
            self._pieces.popleft()

    def _begin(self, profile: Profile) -> None:
        self._profile = profile
        self._end_units = self._motion.tail_units + profile.travel_units
        self.fill()
        if self._profile is not profile:  # a segment was refused, and the drive has abandoned the profile
            return
        if self._motion.queued and not self._motion.running:
            self._motion.start()
        self.active = self._motion.running
        if not self.active:
            self.due_us = None

    def poll(self, now_us: int) -> None:
        """Queue more segments if that is due."""
        if self.due_us is not None and self.due_us <= now_us:
            self.fill()

    def fill(self) -> None:
        """Queue segments until AHEAD_MS of motion waits."""
        self._forget_done()
        self.due_us = self._context.now_us + PERIOD_US
        waiting_ms = sum(piece.duration_ms for piece in self._pieces) - PERIOD_US // 1000
        while waiting_ms < AHEAD_MS and (segment := self._profile.next_segment()):
            if not self._queue(segment):
                return
            waiting_ms += segment.duration_ms

    def _queue(self, segment: Segment) -> bool:
        start_velocity = self._motion.tail_velocity
        displacement, end_velocity, duration_ms, acceleration = segment
        if self._motion.push(displacement, end_velocity, duration_ms) is not Refusal.ACCEPTED:
            self._context.trip(ErrorCode.SEGMENT_REFUSED)
            return False
        self._pieces.append(_Piece(duration_ms, start_velocity, end_velocity, acceleration))
        return True

    def finished(self) -> bool:
        """Handle the end of all segments; return False if a new profile was queued in the same tick and continues."""
        if self.active and self._motion.start():
            return False
        self.abandon()
        return True

    def abandon(self) -> None:
        """Drop the profile: the axis is at standstill, or the drive makes another motion."""
        self._profile = Profile([])
        self._pieces.clear()
        self.active = False
        self.due_us = None
