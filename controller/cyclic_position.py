"""Cyclic synchronous position mode (CiA 402-2): each SYNC brings a set-point 0x607A, the axis runs through all of them.

A set-point is used when the slot of its SYNC has closed (see `SyncClock`): the cubic that ends there then begins with
the next servo tick and lasts a period T. It begins with the velocity at which the cubic before ended, and ends with
that of the parabola through the last three set-points. For set-points P(kT) of a smooth motion that velocity is wrong
by T^2 P'''/3, so that the axis is off by 0.032 T^3 P''' between them at most: T times that velocity times the largest
s (1 - s) (1 - 2s), which is 0.096. Where the acceleration jumps by a it is off by 4/27 T (a T/4) = 0.037 a T^2.

Cubics last whole servo ticks. Once the slots have been moved, because the clocks of host and board drift apart, they
close up to a tick before or after they should; each cubic then ends where the parabola is at that time. While they are
moved the speed differs by 1/512 or, at 1 ms, by 1/1000, for the first period by twice that.

From rest the axis follows from the next SYNC on, so the host begins with the position 0x6062. A set-point is a fault if
it is farther from the one before than the axis can go in the time between. Where the axis cannot be fast enough in
the middle of a cubic, after a sudden start, it falls behind and catches up; to be a period behind is a fault. One
beyond the soft limits is moved there (bit 11), and no cubic leads beyond them.

A slot without SYNC, or whose SYNC came without a set-point, is bridged by the velocity of the slot before. It costs
three points, a set-point gives one back, and more than nine are a fault (the counting of EtherCAT's object 0x10F1). At
rest nothing is lost: the axis holds its position, and without SYNC it ceases to follow.

Halt (bit 8) ramps to rest by 0x605D. The axis then does not follow until the bit has been cleared and a SYNC has come:
as at the beginning the host has to start from 0x6062.
"""

from collections.abc import Callable
from typing import NamedTuple

from steptwin.controller.cyclic_cubics import Cubic, highest_velocity, parabola, slowed
from steptwin.controller.kernel import TICKS_PER_MS
from steptwin.controller.modes import Mode, Trip
from steptwin.controller.motion import Motion, Refusal
from steptwin.controller.soft_limits import SoftLimits
from steptwin.controller.sync_clock import TICK_US, Slot, SyncClock
from steptwin.protocol import od
from steptwin.protocol.abort import AbortCode, SdoAbortError
from steptwin.protocol.cia402 import Control, ErrorCode, Status
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS

_LOST, _GOOD, _LOST_MAX = 3, 1, 9
"""What a lost slot costs, what a good one gives back, and how much may be lost: three slots in a row."""
NO_SYNC, NO_SET_POINT = 0, 1
"""Details of the fault: what was lost last."""


class _Came(NamedTuple):
    """What has come in a slot."""

    sync: bool
    set_point_units: int | None


_NOTHING = _Came(sync=False, set_point_units=None)


class CyclicPosition(Mode):
    """One axis' way from set-points to cubics."""

    def __init__(
        self,
        axis: int,
        motion: Motion,
        dictionary: ObjectDictionary,
        clock: SyncClock,
        now_us: Callable[[], int],
        close_records: Callable[[], None],
        ramp_down: Callable[[], None],
        trip: Trip,
    ) -> None:
        super().__init__(axis, motion)
        self._dictionary = dictionary
        self._limits = SoftLimits(dictionary)
        self._clock = clock
        self._now_us = now_us
        self._close_records = close_records
        self._ramp_down = ramp_down
        self._trip = trip
        self._enabled = False
        """Whether the drive is in OPERATION ENABLED in this mode and not halted."""
        self._following = False
        self._written = False
        """Whether there is a set-point that no SYNC has taken yet."""
        self._slot = clock.slot
        self._came = [_NOTHING, _NOTHING]
        """In the open slot, and early for the next."""
        self._points_units = (0, 0, 0)
        """The set-points of the last three slots, bridges among them, the newest first."""
        self._taken_units = 0
        """The last one that the host has sent."""
        self._bridged_slots = 0
        """And how many slots are bridged since."""
        self._lost = 0
        self._at_limit = False
        dictionary.write_hooks[od.TARGET_POSITION] = self._write_set_point
        dictionary.write_hooks[od.INTERPOLATION_PERIOD] = self._write_period

    def _write_set_point(self, _units: int) -> None:
        self._written = True

    def _write_period(self, _period_ms: int) -> None:
        if self._following:
            raise SdoAbortError(AbortCode.DEVICE_STATE)

    def control(self, controlword: int, _previous: int) -> None:
        """Obey the halt bit; what was written before the drive was enabled is no set-point."""
        halted = bool(controlword & Control.HALT)
        if halted and self._following and self._motion.running(self._axis):
            self._ramp_down()
        elif halted:
            self.interrupted()
        elif not self._enabled:
            self._enabled = True
            self._written = False

    def interrupted(self) -> None:
        """The drive stops or halts: the next SYNC after that is a first one."""
        self._enabled = False
        self._release()

    def _release(self) -> None:
        self._following = self._at_limit = False
        self._clock.leave(self._axis)

    @property
    def coordinated(self) -> bool:
        """Whether the axis follows, even if its set-points let it stand."""
        return self._following

    def status_bits(self) -> int:
        """Bits 11, internal limit, and 12, the drive follows the command value."""
        bits = Status.INTERNAL_LIMIT if self._at_limit else 0
        return bits | (Status.FOLLOWS_COMMAND if self._following else 0)

    # --- SYNC

    def on_sync(self) -> None:
        """Keep the set-point that has come with it until its slot closes; of two in a slot the later counts."""
        if not self._enabled or not (self._following or self._begin()):
            return
        slot = self._clock.hear(self._now_us())
        set_point_units = (
            self._dictionary.get(od.TARGET_POSITION) if self._written else self._came[slot].set_point_units
        )
        self._came[slot] = _Came(sync=True, set_point_units=set_point_units)
        self._written = False

    def _begin(self) -> bool:
        """Follow from now on, unless a ramp is still bringing the axis to rest."""
        if self._motion.running(self._axis):
            return False
        period_ms = self._dictionary.get(od.INTERPOLATION_PERIOD)
        if not self._clock.join(self._axis, 1000 * period_ms, self._now_us()):
            self._trip(self._axis, ErrorCode.PARAMETER, period_ms)  # one SYNC cannot have two periods
            return False
        self._close_records()
        self._motion.drop_queued(self._axis)
        self._slot = self._clock.slot
        self._came = [_NOTHING, _NOTHING]
        self._points_units = (self._motion.tail_units(self._axis),) * 3
        self._taken_units = self._points_units[0]
        self._bridged_slots = self._lost = 0
        self._following = True
        return True

    # --- when a slot closes

    @property
    def due_us(self) -> int | None:
        """When the slot closes: a tick before the cubic of the slot before ends."""
        return self._slot.close_tick * TICK_US if self._following else None

    def poll(self, now_us: int) -> None:
        """Queue the cubic of the slot that closes."""
        if self.due_us is None or now_us < self.due_us:
            return
        came = self._came.pop(0)
        self._came.append(_NOTHING)
        point_units = self._bridged(came) if came.set_point_units is None else self._taken(came.set_point_units)
        if point_units is not None:
            self._points_units = (point_units, *self._points_units[:2])
            closed, self._slot = self._slot, self._clock.after(self._slot)
            self._move(closed)

    def _taken(self, set_point_units: int) -> int | None:
        """The set-point, within the soft limits; None if it is too far away."""
        point_units = self._within_limits(set_point_units)
        self._at_limit = point_units != set_point_units
        periods, self._bridged_slots = self._bridged_slots + 1, 0
        self._lost = max(0, self._lost - _GOOD)
        travelled_units, self._taken_units = abs(point_units - self._taken_units), point_units
        if travelled_units > periods * self._reach_units:
            self._trip(self._axis, ErrorCode.OVERSPEED)
            return None
        return point_units

    def _bridged(self, came: _Came) -> int | None:
        """In place of a set-point that has not come; None if too much has been lost."""
        last, before, _ = self._points_units
        if came.sync and last == before:
            return last
        self._bridged_slots += 1
        self._lost += _LOST
        if self._lost <= _LOST_MAX:
            return self._within_limits(2 * last - before)
        if self._motion.running(self._axis):
            self._trip(self._axis, ErrorCode.SYNC_CONTROLLER, NO_SET_POINT if came.sync else NO_SYNC)
        self._release()
        return None

    def _range(self) -> tuple[int, int]:
        """Where the axis may go: an axis beyond a soft limit may stay there, and come back."""
        low, high = self._limits.range()
        tail_units = self._motion.tail_units(self._axis)
        return min(low, tail_units), max(high, tail_units)

    def _within_limits(self, position_units: int) -> int:
        low, high = self._range()
        return max(low, min(position_units, high))

    # --- cubics

    def _move(self, closed: Slot) -> None:
        """Queue the cubic that ends a tick after the slot now open closes, unless the axis stands and shall stand."""
        motion, axis = self._motion, self._axis
        wanted, room = self._aim(self._slot.end_us - closed.end_us)
        start_velocity = motion.tail_velocity(axis)
        if wanted.displacement_units == wanted.end_velocity == start_velocity == 0:
            return
        ticks = self._slot.close_tick - closed.close_tick
        microsteps = motion.config(axis).microsteps
        cubic = slowed(wanted, start_velocity, self._velocity_limit, room, ticks, microsteps)
        if abs(wanted.displacement_units - cubic.displacement_units) > self._reach_units:
            self._trip(axis, ErrorCode.OVERSPEED)
        else:
            self._queue(cubic, ticks)

    def _aim(self, period_us: int) -> tuple[Cubic, int]:
        """To where the parabola is when the open slot closes, and what the soft limits leave of its velocity."""
        end = parabola(self._points_units, self._slot.excess_us, period_us)
        low, high = self._range()
        end_units = max(low, min(end.position_units, high))
        room = highest_velocity(min(end_units - low, high - end_units), period_us + 2 * TICK_US)
        return Cubic(end_units - self._motion.tail_units(self._axis), end.velocity), room

    def _queue(self, cubic: Cubic, ticks: int) -> None:
        """An axis that stands waits for the tick in which the cubic of a moving one begins."""
        motion, axis = self._motion, self._axis
        stands = not motion.running(axis)
        if stands:
            motion.push_ticks(axis, 0, 0, 1)
        if motion.push_ticks(axis, *cubic, ticks) is not Refusal.ACCEPTED:
            motion.drop_queued(axis)
            self._trip(axis, ErrorCode.SEGMENT_REFUSED)
        elif stands:
            motion.start(axis)

    @property
    def _velocity_limit(self) -> int:
        """The axis' highest speed in 1/64 unit per ms; cubics of any number of ticks may have it."""
        config = self._motion.config(self._axis)
        return (config.rate_limit_q16_per_ms & -TICKS_PER_MS) * VELOCITY_PER_UNIT_PER_MS // (config.microsteps << 2)

    @property
    def _reach_units(self) -> int:
        """How far that leads in a period."""
        return self._velocity_limit * self._dictionary.get(od.INTERPOLATION_PERIOD) // VELOCITY_PER_UNIT_PER_MS
