"""Profile position mode (CiA 402-2, "profile position mode"): set-points by handshake, from rest or on the fly.

Controlword bit 4, rising, gives a set-point: 0x607A with the profile objects as they are then. The statusword's bit 12
acknowledges it and falls with bit 4, unless the one place for a further set-point is taken: then only when that
set-point's turn comes. Without bit 5 a set-point waits until the one in progress is reached, with it the new one
replaces both at once. With bit 6 the target counts from the target before it (0x60F2 = 0), or from where the axis
stands if there is none since it was stopped or enabled. Bit 9, passing a set-point without stopping, is not supported.

A target beyond the soft limits 0x607D or the range of a position is moved to the limit and bit 11 says so until the
next set-point begins. Halt (bit 8) ramps to rest by 0x605D, within the profile deceleration or the quick stop's; its
release goes on.
"""

from collections.abc import Callable
from typing import NamedTuple

from steptwin.controller.modes import Mode
from steptwin.controller.motion import Motion
from steptwin.controller.profile import Limits
from steptwin.controller.profile_feed import ProfileFeed
from steptwin.controller.soft_limits import SoftLimits
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, Status
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.objects import WINDOW_OFF
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS


class _SetPoint(NamedTuple):
    target_units: int
    limits: Limits | None
    at_limit: bool


class ProfilePosition(Mode):
    """The mode's handshake; the motion itself is the feed's."""

    def __init__(
        self,
        axis: int,
        motion: Motion,
        dictionary: ObjectDictionary,
        feed: ProfileFeed,
        now_us: Callable[[], int],
    ) -> None:
        super().__init__(axis, motion)
        self._dictionary = dictionary
        self._limits = SoftLimits(dictionary)
        self._feed = feed
        self._now_us = now_us
        self._active: _SetPoint | None = None
        """The set-point in progress; it stays while a halt interrupts it."""
        self._next: _SetPoint | None = None
        self._last_target_units: int | None = None
        self._at_limit = False
        self._acknowledged = False
        self._halted = False
        self._settled_us: int | None = None
        """Until when the axis must stand at its target before that is said, if it must still."""

    @property
    def due_us(self) -> int | None:
        """When the axis has stood at its target for long enough."""
        return self._settled_us

    def poll(self, now_us: int) -> None:
        """Nothing is left to wait for once the position window time is over."""
        if self._settled_us is not None and self._settled_us <= now_us:
            self._settled_us = None

    def control(self, controlword: int, previous: int) -> None:
        """Obey set-point and halt bits."""
        if controlword & ~previous & Control.START:
            self._take(controlword)
        self._set_halt(bool(controlword & Control.HALT))
        if not controlword & Control.START and self._next is None:
            self._acknowledged = False

    def _take(self, controlword: int) -> None:
        at_once = bool(controlword & Control.CHANGE_AT_ONCE)
        if self._next and not at_once:
            return
        set_point = self._set_point(relative=bool(controlword & Control.RELATIVE))
        self._acknowledged = True
        self._last_target_units = set_point.target_units
        if self._active and not at_once:
            self._next = set_point
            return
        self._next = None
        self._begin(set_point, halted=bool(controlword & Control.HALT))

    def _set_point(self, *, relative: bool) -> _SetPoint:
        wanted = self._dictionary.get(od.TARGET_POSITION)
        if relative:
            last = self._last_target_units
            wanted += self._motion.demand_units(self._axis) if last is None else last
        target = self._limits.clamped(wanted)
        velocity = self._dictionary.get(od.PROFILE_VELOCITY) * VELOCITY_PER_UNIT_PER_MS // 1000
        limits = self._feed.limits(velocity)
        return _SetPoint(target, limits, target != wanted or limits is None)

    def _begin(self, set_point: _SetPoint, *, halted: bool) -> None:
        self._active = set_point
        self._at_limit = set_point.at_limit
        if not halted:
            self._go()

    def _go(self) -> None:
        """Move to the active set-point; while someone else's ramp moves the axis, its end will call again."""
        if self._active is None or not self._feed.free:
            return
        if self._active.limits:
            self._feed.move_to(self._active.target_units, self._active.limits)
        if not self._motion.running(self._axis):
            self._reached()

    def _reached(self) -> None:
        """The next set-point, which may be where the axis stands already, begins."""
        self._active = None
        self._settled_us = self._now_us() + 1000 * self._dictionary.get(od.POSITION_WINDOW_TIME_MS)
        set_point, self._next = self._next, None
        if set_point:
            self._acknowledged = bool(self._dictionary.get(od.CONTROLWORD) & Control.START)
            self._begin(set_point, halted=False)

    def _set_halt(self, halted: bool) -> None:
        if halted is self._halted:
            return
        self._halted = halted
        if not halted:
            self._go()
        elif self._feed.active and self._active and self._active.limits:
            self._feed.halt(self._active.limits)

    def finished(self) -> None:
        """The axis stands: at the target, at the end of a halt, or after a ramp that was not the mode's."""
        was_moving = self._feed.active
        if not self._feed.finished() or self._halted:
            return
        if was_moving:
            self._reached()
        else:
            self._go()

    def interrupted(self) -> None:
        """The drive was stopped or switched off: no set-point outlives that."""
        self._feed.abandon()
        self._active = self._next = None
        self._last_target_units = self._settled_us = None
        self._at_limit = self._acknowledged = self._halted = False

    def target_reached(self) -> bool:
        """Bit 10: no set-point is left to reach; during halt, standstill."""
        standing = not self._motion.running(self._axis)
        return standing and (self._halted or (self._active is None and self._in_window()))

    def _in_window(self) -> bool:
        """Whether the axis has been near its target, by 0x6067, for as long as 0x6068 asks for."""
        window, target_units = self._dictionary.get(od.POSITION_WINDOW), self._last_target_units
        if target_units is None or window == WINDOW_OFF:
            return True
        return self._settled_us is None and abs(target_units - self._motion.counter_units(self._axis)) <= window

    def status_bits(self) -> int:
        """Bits 11, internal limit, and 12, set-point acknowledge."""
        bits = Status.INTERNAL_LIMIT if self._at_limit else 0
        return bits | (Status.SETPOINT_ACKNOWLEDGED if self._acknowledged else 0)
