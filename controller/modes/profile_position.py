"""Profile position mode (CiA 402-2, "profile position mode"): set-points by handshake, from standstill or in motion.

A rising bit 4 of the controlword gives a set-point: the target position (607Ah), with the present profile objects. Bit
12 of the statusword acknowledges it and falls with bit 4. One further set-point may wait; bit 12 then stays until it
begins. Without bit 5 a new set-point waits until the present one is reached. With bit 5 it replaces the present and the
waiting one at once. With bit 6 the target is relative. The positioning option code (60F2h) selects the base of a
relative target, and the direction in which an endless rotary axis turns.

The axis stops at each target. There are two exceptions, both for a waiting set-point in the direction of motion:

- Bit 9 was set in the controlword of the waiting set-point: the axis passes the present target at its profile velocity
  (6081h).
- The present set-point has an end velocity (6082h) other than 0: the axis passes the present target at this velocity.

In both the axis passes only as fast as the velocity limits and both distances allow: it must be able to stop at the
waiting target. Without a waiting set-point the axis stops at the target even if the end velocity is not 0, because it
must not run away. When the axis passes, bit 12 falls, and the waiting set-point becomes the present one.

A target beyond the soft limits (607Dh) or the i32 range is moved to the limit; bit 11 shows this until the next
set-point begins. Halt (bit 8) stops the axis as the halt option code (605Dh) selects, with the profile or the quick
stop deceleration. When the bit falls, the motion to the target continues.

Bits 1 and 0 of the positioning option code select the base of a relative target: 0 is the last target, or the position
demand if there is none since the axis was stopped or enabled; 1 the position demand (6062h); 2 the position actual
value (6064h). They are read together with the set-point. Bits 7 and 6 select how an endless rotary axis reaches an
absolute target: 0 as on a linear axis, 1 in negative direction only, 2 in positive direction only, 3 by the shortest
travel (positive for half a turn). The position range limit (607Bh), both ends included, defines one turn. By default it
is the whole i32 range; then there are no turns, and the direction has no effect. It never affects relative targets. The
position demand and the position actual value are not wrapped at a turn.
"""

from enum import IntEnum
from typing import Final, NamedTuple

from steptwin.controller.modes.drive_mode import DriveMode
from steptwin.controller.modes.profile import Limits, Passing
from steptwin.controller.modes.profile_feed import ProfileFeed
from steptwin.controller.node.axis_context import AxisContext
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, Status
from steptwin.protocol.entry import DataType
from steptwin.protocol.od import WINDOW_OFF
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError


class RelativeTo(IntEnum):
    """Bits 1 and 0 of the positioning option code."""

    LAST_TARGET = 0
    DEMAND = 1
    ACTUAL = 2


class TurnDirection(IntEnum):
    """Bits 7 and 6 of the positioning option code."""

    STRAIGHT = 0
    NEGATIVE = 1
    POSITIVE = 2
    SHORTEST = 3


_DIRECTION_SHIFT: Final = 6
_TWO_BITS: Final = 3


def travel_units(from_units: int, target_units: int, turn_units: int, direction: TurnDirection) -> int:
    """Return the travel to a target on an endless rotary axis; `turn_units` is one turn."""
    ahead_units = (target_units - from_units) % turn_units
    behind_units = ahead_units - turn_units if ahead_units else 0
    if direction is TurnDirection.STRAIGHT:
        return target_units - from_units
    if direction is TurnDirection.NEGATIVE:
        return behind_units
    if direction is TurnDirection.POSITIVE or 2 * ahead_units <= turn_units:
        return ahead_units
    return behind_units


class Positioning:
    """Computes the position to which one axis moves from its target position."""

    def __init__(self, context: AxisContext) -> None:
        self._motion = context.motion
        self._dictionary = context.dictionary
        self._zero_is_off = context.dictionary.traits.zero_limits_off
        context.dictionary.bind(self)

    def check_low(self, low: int) -> None:
        """Refuse a range that is not longer than a position."""
        self._check(low, self._dictionary.get(od.POSITION_RANGE_MAX))

    def check_high(self, high: int) -> None:
        """Refuse a range that is not longer than a position."""
        self._check(self._dictionary.get(od.POSITION_RANGE_MIN), high)

    def _check(self, low: int, high: int) -> None:
        if low >= high and not (self._zero_is_off and 0 in (low, high)):
            raise SdoAbortError(AbortCode.MAX_BELOW_MIN)

    def target_units(self, *, relative: bool, last_target_units: int | None, from_units: int) -> int:
        """Return the position that the target position (607Ah) means.

        `from_units` is the start of the motion to it: the previous target, or the position demand.
        """
        wanted_units, option = self._dictionary.get(od.TARGET_POSITION), self._dictionary.get(od.POSITIONING_OPTION)
        if relative:
            return wanted_units + self._base_units(RelativeTo(option & _TWO_BITS), last_target_units)
        low, high = self._dictionary.get(od.POSITION_RANGE_MIN), self._dictionary.get(od.POSITION_RANGE_MAX)
        if (low, high) == (DataType.INTEGER32.low, DataType.INTEGER32.high) or low >= high:
            return wanted_units
        return from_units + travel_units(
            from_units, wanted_units, high - low + 1, TurnDirection(option >> _DIRECTION_SHIFT)
        )

    def _base_units(self, base: RelativeTo, last_target_units: int | None) -> int:
        if base is RelativeTo.ACTUAL:
            return self._motion.counter_units
        if base is RelativeTo.DEMAND or last_target_units is None:
            return self._motion.demand_units
        return last_target_units


_PASSING_LOOK_US = 1_000
"""Period of the check whether a target has been passed."""


class _SetPoint(NamedTuple):
    target_units: int
    limits: Limits | None
    at_limit: bool
    end_velocity: int
    """Speed at the target if another set-point waits, in 1/64 unit per ms."""
    on_set_point: bool
    """True if the axis must pass the previous target at profile velocity."""

    def passing(self, following: "_SetPoint") -> Passing | None:
        """Return how the axis must pass this set-point's target; None if it must stop there."""
        if self.limits is None or following.limits is None:
            return None
        velocity = self.limits.velocity if following.on_set_point else self.end_velocity
        return Passing(velocity, following.target_units - self.target_units, following.limits) if velocity else None


class ProfilePosition(DriveMode):
    """Accepts set-points by handshake; the feed makes the motion."""

    def __init__(self, context: AxisContext, feed: ProfileFeed) -> None:
        super().__init__(context)
        self._limits = context.limits
        self._positioning = Positioning(context)
        self._feed = feed
        self._active: _SetPoint | None = None
        """Present set-point; a halt does not end it."""
        self._next: _SetPoint | None = None
        """Waiting set-point."""
        self._passing = 0
        """Direction in which the axis will pass the active target, 1 or -1; 0 if it will stop there."""
        self._passing_look_us: int | None = None
        self._last_target_units: int | None = None
        self._at_limit = False
        self._acknowledged = False
        self._halted = False
        self._settled_us: int | None = None
        """Instant when bit 10 rises if the axis stays in the position window; None once it has risen."""

    @property
    def due_us(self) -> int | None:
        """End of the position window time (6068h), or time of the next check whether a target has been passed."""
        return self._settled_us if self._passing_look_us is None else self._passing_look_us

    def poll(self, now_us: int) -> None:
        """End the position window time if it is over; check whether a target has been passed."""
        if self._settled_us is not None and self._settled_us <= now_us:
            self._settled_us = None
        if self._passing_look_us is not None and self._passing_look_us <= now_us:
            self._note_passed()

    def control(self, controlword: int, previous: int) -> None:
        """Obey the bits for a new set-point and for halt."""
        if controlword & ~previous & Control.START:
            self._take(controlword)
        self._set_halt(bool(controlword & Control.HALT))
        if not controlword & Control.START and self._next is None:
            self._acknowledged = False

    def _take(self, controlword: int) -> None:
        at_once = bool(controlword & Control.CHANGE_AT_ONCE)
        if self._next and not at_once:
            return  # no acknowledgement: the host must wait until bit 12 falls
        waits = self._active is not None and not at_once
        set_point = self._set_point(controlword, waits=waits)
        self._acknowledged = True
        self._last_target_units = set_point.target_units
        if waits:
            self._next = set_point
            if self._feed.active and not self._halted:
                self._go_through()
            return
        self._next = None
        self._begin(set_point, halted=bool(controlword & Control.HALT))

    def _set_point(self, controlword: int, *, waits: bool) -> _SetPoint:
        last_target = self._last_target_units
        wanted = self._positioning.target_units(
            relative=bool(controlword & Control.RELATIVE),
            last_target_units=last_target,
            from_units=last_target if waits and last_target is not None else self._motion.demand_units,
        )
        target = self._limits.clamped(wanted)
        velocity = self._dictionary.get(od.PROFILE_VELOCITY) * VELOCITY_PER_UNIT_PER_MS // 1000
        limits = self._feed.limits(velocity)
        end_velocity = self._dictionary.get(od.END_VELOCITY) * VELOCITY_PER_UNIT_PER_MS // 1000
        on_set_point = bool(controlword & Control.CHANGE_ON_SET_POINT)
        return _SetPoint(target, limits, target != wanted or limits is None, end_velocity, on_set_point)

    def _begin(self, set_point: _SetPoint, *, halted: bool) -> None:
        self._stop_passing()
        self._active = set_point
        self._at_limit = set_point.at_limit
        if not halted:
            self._go()

    def _go(self) -> None:
        """Move to the active set-point. If a ramp of the drive moves the axis, wait for `finished`."""
        self._note_passed()
        if self._active is None or not self._feed.free or self._go_through():
            return
        if self._active.limits:
            self._feed.move_to(self._active.target_units, self._active.limits)
        if not self._motion.running:
            self._reached()

    def _go_through(self) -> bool:
        """Move through the active target to the waiting one; return False if the axis must stop at the active one."""
        self._stop_passing()
        passing = self._active.passing(self._next) if self._active and self._next else None
        if passing is None or self._active is None or self._active.limits is None:
            return False
        self._passing = 1 if passing.onward_units > 0 else -1  # before the feed: a fault there resets this
        self._passing_look_us = self._context.now_us + _PASSING_LOOK_US
        if self._feed.move_through(self._active.target_units, self._active.limits, passing):
            return True
        self._stop_passing()
        return False

    def _stop_passing(self) -> None:
        self._passing, self._passing_look_us = 0, None

    def _note_passed(self) -> None:
        """Make the waiting set-point the active one if the axis has passed the active target."""
        if self._passing_look_us is None or self._active is None:
            return
        self._passing_look_us = self._context.now_us + _PASSING_LOOK_US
        if (self._motion.demand_units - self._active.target_units) * self._passing < 0:
            return
        self._stop_passing()
        self._active, self._next = self._next, None
        self._at_limit = self._active is not None and self._active.at_limit
        self._acknowledged = self._starts

    @property
    def _starts(self) -> bool:
        return bool(self._dictionary.get(od.CONTROLWORD) & Control.START)

    def _reached(self) -> None:
        """End the active set-point and begin a waiting one."""
        self._active = None
        self._settled_us = self._context.now_us + 1000 * self._dictionary.get(od.POSITION_WINDOW_TIME_MS)
        set_point, self._next = self._next, None
        if set_point:
            self._acknowledged = self._starts
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
        """Handle standstill: at the target, in a halt, or after a ramp of the drive."""
        was_moving = self._feed.active
        self._note_passed()
        if not self._feed.finished():
            return
        self._stop_passing()
        if self._halted:
            return
        if was_moving:
            self._reached()
        else:
            self._go()

    def interrupted(self) -> None:
        """Forget all set-points, because the drive stops or leaves OPERATION ENABLED."""
        self._feed.abandon()
        self._stop_passing()
        self._active = self._next = None
        self._last_target_units = self._settled_us = None
        self._at_limit = self._acknowledged = self._halted = False

    def target_reached(self) -> bool:
        """Return bit 10: all set-points have been reached; in a halt, the axis is at standstill."""
        at_standstill = not self._motion.running
        return at_standstill and (self._halted or (self._active is None and self._in_window()))

    def _in_window(self) -> bool:
        """Return whether the axis has been within the position window (6067h) for the position window time (6068h)."""
        window, target_units = self._dictionary.get(od.POSITION_WINDOW), self._last_target_units
        if target_units is None or window == WINDOW_OFF:
            return True
        return self._settled_us is None and abs(target_units - self._motion.counter_units) <= window

    def status_bits(self) -> int:
        """Return bits 11, internal limit, and 12, set-point acknowledge."""
        bits = Status.INTERNAL_LIMIT if self._at_limit else 0
        return bits | (Status.SET_POINT_ACKNOWLEDGED if self._acknowledged else 0)
