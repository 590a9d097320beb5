"""Keeps an axis' segment queue filled, a little ahead of time, with the segments of a profile.

The queue is kept short, so that a new profile begins as soon as the segment in execution ends. Whoever else makes the
axis move (a stop ramp) takes it away by `abandon`; the feed then waits for standstill.
"""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from steptwin.controller.kernel import STEP_Q16
from steptwin.controller.motion import Motion, Refusal
from steptwin.controller.profile import GRAIN_MS, Limits, Profile, Segment, move, stop
from steptwin.controller.stops import HALTS, Ramp
from steptwin.protocol import od
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.objects import UNITS_PER_FULL_STEP
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS

AHEAD_MS = 48
"""How much motion waits behind the segment in execution, at least."""
PERIOD_US = 16_000
"""How often the queue is filled up: it holds three times that."""

_VELOCITY_MARGIN = 3 * VELOCITY_PER_UNIT_PER_MS // GRAIN_MS + 8
"""What the rounding to units may add to a velocity: the kernel refuses segments beyond the axis' limit."""


class _Piece(NamedTuple):
    """What is remembered of a segment until it is done."""

    duration_ms: int
    start_velocity: int
    end_velocity: int
    end_acceleration: int


class ProfileFeed:
    """One axis' way from profiles to segments; shared by the modes that move by profiles."""

    def __init__(
        self,
        axis: int,
        motion: Motion,
        dictionary: ObjectDictionary,
        now_us: Callable[[], int],
        close_records: Callable[[], None],
        refused: Callable[[], None],
    ) -> None:
        self._axis = axis
        self._motion = motion
        self._dictionary = dictionary
        self._now_us = now_us
        self._close_records = close_records
        self._refused = refused
        self._profile = Profile([])
        self._pieces: deque[_Piece] = deque()
        """The segment in execution, if any, and those that wait behind it."""
        self.active = False
        """Whether the motion of the axis is a profile's."""
        self.due_us: int | None = None
        """When `fill` wants to be called next."""

    @property
    def free(self) -> bool:
        """Whether a profile may begin: the axis stands or moves by a profile."""
        return self.active or not self._motion.running(self._axis)

    @property
    def steady_velocity(self) -> int | None:
        """The demanded velocity in 1/64 unit per ms while it does not change."""
        if not self._motion.running(self._axis):
            return 0
        waiting = self._motion.queued(self._axis)
        if not self.active or waiting >= len(self._pieces):
            return None
        piece = self._pieces[-1 - waiting]
        return piece.end_velocity if piece.start_velocity == piece.end_velocity else None

    def take_over(self) -> int:
        """Drop all that waits, records as well; return where a profile will begin: where the running segment ends."""
        self._close_records()
        self._motion.drop_queued(self._axis)
        self._forget_done()
        return self._motion.tail_units(self._axis)

    def limits(self, velocity: int) -> Limits | None:
        """What the objects allow now, for a speed in 1/64 unit per ms; None if the axis is too slow for profiles."""
        get = self._dictionary.get
        config = self._motion.config(self._axis)
        units_q16 = UNITS_PER_FULL_STEP * config.rate_limit_q16_per_ms // config.microsteps
        fastest = units_q16 * VELOCITY_PER_UNIT_PER_MS // STEP_Q16 - _VELOCITY_MARGIN
        if fastest < 1:
            return None
        return Limits(
            velocity=max(1, min(velocity, fastest)),
            acceleration=min(get(od.PROFILE_ACCELERATION), get(od.MAX_ACCELERATION)),
            deceleration=min(get(od.PROFILE_DECELERATION), get(od.MAX_DECELERATION)),
            jerk=get(od.PROFILE_JERK) if get(od.MOTION_PROFILE_TYPE) else 0,
        )

    def move_to(self, target_units: int, limits: Limits) -> None:
        """From where a profile may begin to rest at a target."""
        distance = target_units - self.take_over()
        self._begin(move(distance, self._motion.tail_velocity(self._axis), self._acceleration, limits))

    def halt(self, limits: Limits) -> None:
        """To rest by the ramp that 0x605D asks for: the limits' own, which is 0x6084, or the quick stop's."""
        ramp = HALTS[self._dictionary.get(od.HALT_OPTION)]
        quick = ramp is Ramp.QUICK_STOP
        self.stop(limits._replace(deceleration=self._dictionary.get(od.QUICK_STOP_DECELERATION)) if quick else limits)

    def stop(self, limits: Limits) -> None:
        """To rest as soon as the limits allow."""
        self.take_over()
        self._begin(stop(self._motion.tail_velocity(self._axis), self._acceleration, limits))

    @property
    def _acceleration(self) -> int:
        return self._pieces[-1].end_acceleration if self._pieces else 0

    def _forget_done(self) -> None:
        """Keep the pieces that wait and the one in execution."""
        kept = self._motion.queued(self._axis) + int(self._motion.running(self._axis))
        while len(self._pieces) > kept:
            self._pieces.popleft()

    def _begin(self, profile: Profile) -> None:
        self._profile = profile
        self.fill()
        if self._profile is not profile:  # a segment was refused and the drive is stopping by itself
            return
        if self._motion.queued(self._axis) and not self._motion.running(self._axis):
            self._motion.start(self._axis)
        self.active = self._motion.running(self._axis)
        if not self.active:
            self.due_us = None

    def poll(self, now_us: int) -> None:
        """Queue more segments if it is time."""
        if self.due_us is not None and self.due_us <= now_us:
            self.fill()

    def fill(self) -> None:
        """Queue segments until enough motion waits."""
        self._forget_done()
        self.due_us = self._now_us() + PERIOD_US
        waiting_ms = sum(piece.duration_ms for piece in self._pieces) - PERIOD_US // 1000
        while waiting_ms < AHEAD_MS and (segment := self._profile.next_segment()):
            if not self._queue(segment):
                return
            waiting_ms += segment.duration_ms

    def _queue(self, segment: Segment) -> bool:
        start_velocity = self._motion.tail_velocity(self._axis)
        displacement, end_velocity, duration_ms, acceleration = segment
        if self._motion.push(self._axis, displacement, end_velocity, duration_ms) is not Refusal.ACCEPTED:
            self._refused()
            return False
        self._pieces.append(_Piece(duration_ms, start_velocity, end_velocity, acceleration))
        return True

    def finished(self) -> bool:
        """The axis has run out of segments; False if new ones have come in just that tick and it goes on."""
        if self.active and self._motion.start(self._axis):
            return False
        self.abandon()
        return True

    def abandon(self) -> None:
        """Someone else moves the axis, or it stands."""
        self._profile = Profile([])
        self._pieces.clear()
        self.active = False
        self.due_us = None
