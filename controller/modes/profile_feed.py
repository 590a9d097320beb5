"""Keep an axis' segment queue filled, a little ahead of time, with the segments of a profile.

The queue is kept short: a new profile drops it and begins when the segment in execution ends. Another motion, such as a
stop ramp of the drive, takes the axis from the feed by `abandon`; the next profile then waits for standstill.
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
"""Motion that waits behind the segment in execution, at least."""
PERIOD_US = 16_000
"""Time between two fillings; AHEAD_MS is three times as long."""

_VELOCITY_MARGIN = 3 * VELOCITY_PER_UNIT_PER_MS // GRAIN_MS + 8
"""Most that rounding to units adds to a velocity: profiles stay this far below the limit, which the kernel enforces."""


class _Piece(NamedTuple):
    """A queued segment: what the feed must know of it until it has been executed."""

    duration_ms: int
    start_velocity: int
    end_velocity: int
    end_acceleration: int


class ProfileFeed:
    """Turns one axis' profiles into queued segments; the modes that move by profiles share it."""

    def __init__(self, context: AxisContext, records: Interpolation) -> None:
        self._context = context
        self._motion = context.motion
        self._dictionary = context.dictionary
        self._records = records
        self._profile = Profile([])
        self._end_units = 0
        """Where the profile comes to rest."""
        self._pieces: deque[_Piece] = deque()
        """The segment in execution, if any, then those that wait behind it."""
        self.active: bool = False
        """True while the axis moves by a profile."""
        self.due_us: int | None = None
        """Time of the next call of `poll`; None if there is nothing to queue."""

    @property
    def free(self) -> bool:
        """True if a profile may begin: the axis stands, or moves by a profile."""
        return self.active or not self._motion.running

    @property
    def steady_velocity(self) -> int | None:
        """Demanded velocity in 1/64 unit per ms while it is constant; None while it changes."""
        if not self._motion.running:
            return 0
        waiting = self._motion.queued
        if not self.active or waiting >= len(self._pieces):
            return None
        piece = self._pieces[-1 - waiting]
        return piece.end_velocity if piece.start_velocity == piece.end_velocity else None

    def take_over(self) -> int:
        """Drop all segments that wait, PVT records as well; return where the running one ends and a profile begins."""
        self._records.close()
        self._forget_done()
        while len(self._pieces) > int(self._motion.running):
            self._pieces.pop()
        self._motion.drop_queued()
        return self._motion.tail_units

    def limits(self, velocity: int) -> Limits | None:
        """Return the limits that the objects set now, for a speed in 1/64 unit per ms.

        None if the axis is too slow for profiles: less than the rounding margin remains of its velocity limit.
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
        """Return the velocity in 1/64 unit per ms that profiles may have within a step rate; below 1: none."""
        units_q16 = UNITS_PER_FULL_STEP * rate_q16_per_ms // self._motion.config.microsteps
        return units_q16 * VELOCITY_PER_UNIT_PER_MS // STEP_Q16 - _VELOCITY_MARGIN

    def move_to(self, target_units: int, limits: Limits) -> None:
        """Move to rest at a target, from where the running segment ends; the speed limit may be lower by now."""
        limits = self._within_speed(limits)
        distance = target_units - self.take_over()
        self._begin(move(distance, self._motion.tail_velocity, self._acceleration, limits))

    def move_through(self, target_units: int, limits: Limits, passing: Passing) -> bool:
        """Move through a target to rest at the next one; change nothing and return False if it must stop there."""
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
        """Come to rest by the halt option code (605Dh): with the limits' own deceleration or that of a quick stop."""
        quick = HALTS[self._dictionary.get(od.HALT_OPTION)] is StopKind.QUICK_STOP
        self.stop(limits._replace(deceleration=self._dictionary.get(od.QUICK_STOP_DECELERATION)) if quick else limits)

    def stop(self, limits: Limits) -> None:
        """Come to rest as soon as the limits allow."""
        from_units = self.take_over()
        end_units = self._end_units - from_units if self.active else None
        self._begin(stop(self._motion.tail_velocity, self._acceleration, limits, end_units))

    @property
    def _acceleration(self) -> int:
        return self._pieces[-1].end_acceleration if self._pieces else 0

    def _forget_done(self) -> None:
        """Forget the segments that have been executed."""
        kept = self._motion.queued + int(self._motion.running)
        while len(self._pieces) > kept:
            self._pieces.popleft()

    def _begin(self, profile: Profile) -> None:
        self._profile = profile
        self._end_units = self._motion.tail_units + profile.way_units
        self.fill()
        if self._profile is not profile:  # a segment was refused, and the drive has taken the axis away
            return
        if self._motion.queued and not self._motion.running:
            self._motion.start()
        self.active = self._motion.running
        if not self.active:
            self.due_us = None

    def poll(self, now_us: int) -> None:
        """Queue more segments if it is due."""
        if self.due_us is not None and self.due_us <= now_us:
            self.fill()

    def fill(self) -> None:
        """Queue segments until enough motion waits."""
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
        """Handle the end of all segments; return False if a new profile was queued in that very tick and goes on."""
        if self.active and self._motion.start():
            return False
        self.abandon()
        return True

    def abandon(self) -> None:
        """Drop the profile: the axis stands, or the drive moves it otherwise."""
        self._profile = Profile([])
        self._pieces.clear()
        self.active = False
        self.due_us = None
