"""Cyclic synchronous position and velocity, and linear interpolation (CiA 402-2): follow a set-point of each SYNC.

The set-point is the target position (607Ah). It is used when the slot of its SYNC closes (see `SyncClock`): with the
next servo tick begins a cubic of one period T that ends at the set-point. The cubic begins with the end velocity of the
previous one, and ends with the velocity of the parabola through the last three set-points. For set-points P(kT) of a
smooth motion this velocity has an error of T^2 P'''/3. Between the set-points the position error is then at most
0.032 T^3 P''': T times the velocity error times 0.096, the maximum of s (1 - s) (1 - 2s). If the acceleration jumps by
a, the position error is 4/27 T (a T/4) = 0.037 a T^2.

Cubics last whole servo ticks. Slots move when the clocks of host and board drift apart. From then on a slot closes up
to one tick early or late, and each cubic ends where the parabola is at that time. While slots move, the speed differs
by 1/512 (at a period of 1 ms by 1/1000); in the first period by twice as much.

From standstill the axis follows from the next SYNC on, so the host begins with the position demand (6062h). A set-point
is a fault if the axis cannot reach it from the previous one in one period. After a sudden start the middle of a cubic
may need more than the axis' speed limit. The axis then lags behind and catches up; a lag of one period is a fault. A
set-point beyond the soft limits is moved to the limit (bit 11), and no cubic exceeds the limits.

A slot without SYNC, or with a SYNC but no set-point, is bridged with the velocity of the previous slot. Each such slot
adds three to a counter, each set-point subtracts one, and more than nine is a fault (as in EtherCAT's object 10F1h). At
standstill a lost slot causes no fault: the axis holds its position, and without SYNC it stops following.

Halt (bit 8) stops the axis as the halt option code (605Dh) selects. After the bit has been cleared, the axis follows
from the next SYNC on, and the host starts from the position demand again. A set-point in the same frame as the
controlword that ends the halt counts.

In velocity mode the set-point is the target velocity (60FFh). The drive integrates it to a position and keeps fractions
of a unit for the next period. The rest is as in position mode, except that a velocity above the axis' limit is reduced
to it (bit 11), as in profile velocity mode. Each stop resets the target velocity to 0. There is no velocity offset
(60B1h).

In some drives cyclic modes need no SYNC. Then each set-point counts as if its SYNC came with it, and a slot without one
holds the last set-point; nothing is lost.

Interpolated position with the sub mode "linear" (60C0h = 0) is as position mode, with two differences. The set-points
are those of 2011h. The axis follows while bit 4 of the controlword is set; when the bit falls, it stops by a ramp.

Positions are in units, velocities in 1/64 unit per ms, as on the wire.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

from steptwin.controller.modes.drive_mode import DriveMode
from steptwin.controller.modes.interpolation import Interpolation
from steptwin.controller.motion.axis_motion import Refusal
from steptwin.controller.motion.kernel import TICKS_PER_MS, distance_q16
from steptwin.controller.node.axis_context import AxisContext
from steptwin.controller.node.stops import AxisStop, StopKind
from steptwin.controller.node.sync_clock import TICK_US, Slot
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, ErrorCode, Mode, Status
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

_PER_UNIT_PER_US = 1000 * VELOCITY_PER_UNIT_PER_MS


class Knot(NamedTuple):
    """Position and velocity at which two cubics meet."""

    position_units: int
    velocity: int


class CyclicCubic(NamedTuple):
    """A cubic; it begins with the end position and end velocity of the previous one."""

    displacement_units: int
    end_velocity: int


def parabola(points_units: tuple[int, int, int], after_us: int, period_us: int) -> Knot:
    """Return the parabola through the last three set-points (newest first), evaluated `after_us` after the newest.

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
    """Return the highest velocity at a knot, `room_units` from a soft limit, with which cubics keep the limit.

    A cubic of at most `duration_us` stays between p0, p0 + v0 T/3, p1 - v1 T/3 and p1 (see `soft_limits.hull`).
    """
    return 3 * room_units * _PER_UNIT_PER_US // duration_us


def slowed(wanted: CyclicCubic, start_velocity: int, limit: int, room: int, ticks: int, microsteps: int) -> CyclicCubic:
    """Return the cubic nearest to `wanted` that keeps the speed limit L and the end velocity limit `room`.

    |v0|, |3D/T - v0 - v1| and |v1| bound the speed of a cubic. First, D is limited to the distances that some v1 can
    reach. Then v1 becomes the velocity nearest to the wanted one that keeps the middle bound. All values are in Q16
    steps over the duration of the cubic, as in the kernel.
    """
    middle_q16 = 3 * microsteps << 2
    """Contribution of one unit of D to the middle bound."""
    velocity_q16 = ticks * microsteps
    """Contribution of a velocity of 64 (one unit per ms) to a bound (see `distance_q16`)."""
    most = min(limit, room)
    limit_q16, start_q16 = distance_q16(limit, ticks, microsteps), distance_q16(start_velocity, ticks, microsteps)
    # The kernel rounds half a Q16 step up: a distance backward may be one less than the same distance forward.
    most_q16, most_back_q16 = distance_q16(most, ticks, microsteps), -distance_q16(-most, ticks, microsteps)
    farthest = (limit_q16 + most_q16 + start_q16) // middle_q16
    farthest_back = (limit_q16 + most_back_q16 - start_q16) // middle_q16
    displacement_units = max(-farthest_back, min(wanted.displacement_units, farthest))
    chord_q16 = displacement_units * middle_q16 - start_q16
    lowest = -(-(chord_q16 - limit_q16 << 6) // velocity_q16)
    highest = (chord_q16 + limit_q16 << 6) // velocity_q16
    velocity = max(lowest, min(wanted.end_velocity, highest))
    return CyclicCubic(displacement_units, max(-most, min(velocity, most)))


def _rounded(numerator: int, denominator: int) -> int:
    """Divide, rounding to the nearest integer."""
    return (2 * numerator + denominator) // (2 * denominator)


_LOST, _GOOD, _LOST_MAX = 3, 1, 9
"""Counter of lost slots: increment of a lost one, decrement of a good one, highest value without fault."""
NO_SYNC, NO_SET_POINT = 0, 1
"""Details of the fault: the last lost slot had no SYNC, or a SYNC but no set-point."""


class _SlotReceptions(NamedTuple):
    """Received in a slot so far: its SYNC, and its set-point in units or units per s."""

    sync: bool
    set_point: int | None


_NOTHING = _SlotReceptions(sync=False, set_point=None)


_SET_POINTS: Final[Mapping[int, int]] = {
    Mode.CYCLIC_SYNCHRONOUS_POSITION: od.TARGET_POSITION,
    Mode.CYCLIC_SYNCHRONOUS_VELOCITY: od.TARGET_VELOCITY,
    Mode.INTERPOLATED_POSITION: od.INTERPOLATION_SET_POINT,
}
"""The set-point of each mode of operation."""


class CyclicPosition(DriveMode):
    """Makes cubics from the set-points of one axis."""

    def __init__(self, context: AxisContext, records: Interpolation, stop: AxisStop) -> None:
        super().__init__(context)
        self._limits = context.limits
        self._clock = context.board.sync_clock
        self._trip = context.trip
        self._records = records
        self._stop = stop
        self._at_arrival = context.dictionary.traits.targets_at_arrival
        """True if each target acts when it is written, as a set-point whose SYNC comes with it."""
        self._arrived = False
        self._enabled = False
        """True while the drive is in OPERATION ENABLED in this mode and not halted."""
        self._following = False
        self._written: set[int] = set()
        """Written targets that no SYNC has used yet."""
        self._fresh: set[int] = set()
        """Targets written in the present call while the mode was halted or off."""
        self._slot = self._clock.slot
        self._received = [_NOTHING, _NOTHING]
        """Receptions of the open slot, and early receptions of the next slot."""
        self._points_units = (0, 0, 0)
        """Set-points of the last three slots, bridged ones included, newest first."""
        self._taken_units = 0
        """Last set-point from the host, within the limits."""
        self._bridged_slots = 0
        """Number of bridged slots since that set-point."""
        self._lost = 0
        self._at_limit = False
        self._remainder_thousandths = 0
        """Remaining travel of less than one unit in velocity mode, in thousandths of a unit."""
        context.dictionary.bind(self)

    def note_set_point_at(self, address: int, _value: int) -> None:
        """Record that a target position or velocity is written; the mode determines which one is the set-point."""
        self._written.add(address)
        if self._at_arrival or not self._enabled:
            self._arrived = self._at_arrival
            self._fresh.add(address)
            self._context.touch()

    def end_image(self) -> None:
        """End a process image: a set-point of an earlier image does not start a motion."""
        self._fresh.clear()
        if self._arrived:
            self._arrived = False
            self.on_sync()

    def check_period(self, _period_ms: int) -> None:
        """Refuse a change of the period while the axis follows."""
        if self._following:
            raise SdoAbortError(AbortCode.DEVICE_STATE)

    def control(self, controlword: int, _previous: int) -> None:
        """Obey the halt bit, and in linear interpolation the enable bit.

        Ignore a target that was written before the mode was enabled, in another frame.
        """
        halted = bool(controlword & Control.HALT)
        if halted or (self._linear and not controlword & Control.START):
            if self._following and self._motion.running:
                self._stop.ramp_down(self._stop.halt_kind if halted else StopKind.SLOW_DOWN)
            self.interrupted()
        elif not self._enabled:
            self._enabled = True
            self._written = self._fresh.copy()

    def interrupted(self) -> None:
        """Stop following, because the drive stops or halts. The next SYNC after that begins a new motion."""
        self._enabled = False
        if self._by_velocity:
            self._dictionary.set(od.TARGET_VELOCITY, 0)
        self._release()

    def _release(self) -> None:
        self._following = self._at_limit = False
        self._clock.leave(self._context.axis)

    @property
    def coordinated(self) -> bool:
        """True while the axis follows, even if its set-points do not change."""
        return self._following

    def status_bits(self) -> int:
        """Return bits 11 and 12: internal limit, drive follows the command value."""
        bits = Status.INTERNAL_LIMIT if self._at_limit else 0
        return bits | (Status.FOLLOWS_COMMAND if self._following else 0)

    # --- SYNC

    def on_sync(self) -> None:
        """Keep the set-point of this SYNC until its slot closes; a second SYNC in the slot replaces it."""
        if not self._enabled or not (self._following or self._begin()):
            return
        slot = self._clock.hear(self._context.now_us)
        target = _SET_POINTS[self._dictionary.get(od.MODE_OF_OPERATION_DISPLAY)]
        set_point = self._dictionary.get(target) if target in self._written else self._received[slot].set_point
        self._received[slot] = _SlotReceptions(sync=True, set_point=set_point)
        self._written.clear()

    def _begin(self) -> bool:
        """Begin to follow, unless a stop ramp still moves the axis; return whether the axis follows."""
        if self._motion.running:
            return False
        period_ms = self._dictionary.get(od.INTERPOLATION_PERIOD)
        if not self._clock.join(self._context.axis, 1000 * period_ms, self._context.now_us):
            self._trip(ErrorCode.PARAMETER, period_ms)  # all axes must use the period of the one SYNC
            return False
        self._records.close()
        self._motion.drop_queued()
        self._slot = self._clock.slot
        self._received = [_NOTHING, _NOTHING]
        self._points_units = (self._motion.tail_units,) * 3
        self._taken_units = self._points_units[0]
        self._bridged_slots = self._lost = self._remainder_thousandths = 0
        self._following = True
        return True

    # --- when a slot closes

    @property
    def due_us(self) -> int | None:
        """Instant when the slot closes: one tick before the cubic of the previous slot ends."""
        return self._slot.close_tick * TICK_US if self._following else None

    def poll(self, now_us: int) -> None:
        """Queue the cubic of the closing slot if it is due."""
        if self.due_us is None or now_us < self.due_us:
            return
        received = self._received.pop(0)
        self._received.append(_NOTHING)
        set_point = received.set_point
        point_units = self._bridged(received) if set_point is None else self._taken(set_point)
        if point_units is not None:
            self._points_units = (point_units, *self._points_units[:2])
            closed, self._slot = self._slot, self._clock.after(self._slot)
            self._move(closed)

    @property
    def _by_velocity(self) -> bool:
        """True in velocity mode."""
        return self._dictionary.get(od.MODE_OF_OPERATION_DISPLAY) == Mode.CYCLIC_SYNCHRONOUS_VELOCITY

    @property
    def _linear(self) -> bool:
        """True in interpolated position mode, which reaches this class only with the sub mode "linear"."""
        return self._dictionary.get(od.MODE_OF_OPERATION_DISPLAY) == Mode.INTERPOLATED_POSITION

    def _integrated(self, units_per_s: int) -> int:
        """Return the position after one period at a velocity, from the last point."""
        travel_thousandths = units_per_s * self._dictionary.get(od.INTERPOLATION_PERIOD) + self._remainder_thousandths
        travel_units, self._remainder_thousandths = divmod(travel_thousandths, 1000)
        return self._points_units[0] + travel_units

    def _taken(self, set_point: int) -> int | None:
        """Return the set-point, limited to the soft limits; trip and return None if it is too far away."""
        if self._by_velocity:
            highest = self._velocity_limit * 1000 // VELOCITY_PER_UNIT_PER_MS
            velocity = max(-highest, min(set_point, highest))
            wanted_units = self._integrated(velocity)
            reduced = velocity != set_point
        else:
            wanted_units, reduced = set_point, False
        point_units = self._within_limits(wanted_units)
        self._at_limit = reduced or point_units != wanted_units
        periods, self._bridged_slots = self._bridged_slots + 1, 0
        self._lost = max(0, self._lost - _GOOD)
        travelled_units, self._taken_units = abs(point_units - self._taken_units), point_units
        if travelled_units > periods * self._reach_units:
            self._trip(ErrorCode.OVERSPEED)
            return None
        return point_units

    def _bridged(self, received: _SlotReceptions) -> int | None:
        """Return a point at constant velocity for a missing set-point; None if too many are missing."""
        last, before, _ = self._points_units
        if (received.sync and last == before) or self._at_arrival:
            return last
        self._bridged_slots += 1
        self._lost += _LOST
        if self._lost <= _LOST_MAX:
            return self._within_limits(2 * last - before)
        if self._motion.running:
            self._trip(ErrorCode.SYNC_CONTROLLER, NO_SET_POINT if received.sync else NO_SYNC)
        self._release()
        return None

    def _range(self) -> tuple[int, int]:
        """Return the range of allowed positions. From beyond a soft limit the axis may stay or return."""
        low, high = self._limits.range()
        tail_units = self._motion.tail_units
        return min(low, tail_units), max(high, tail_units)

    def _within_limits(self, position_units: int) -> int:
        low, high = self._range()
        return max(low, min(position_units, high))

    # --- cubics

    def _move(self, closed: Slot) -> None:
        """Queue the cubic that ends one tick after the open slot closes, unless the axis stays at standstill."""
        motion = self._motion
        wanted, room = self._aim(self._slot.end_us - closed.end_us)
        start_velocity = motion.tail_velocity
        if wanted.displacement_units == wanted.end_velocity == start_velocity == 0:
            return
        ticks = self._slot.close_tick - closed.close_tick
        microsteps = motion.config.microsteps
        cubic = slowed(wanted, start_velocity, self._velocity_limit, room, ticks, microsteps)
        if abs(wanted.displacement_units - cubic.displacement_units) > self._reach_units:
            self._trip(ErrorCode.OVERSPEED)
        else:
            self._queue(cubic, ticks)

    def _aim(self, period_us: int) -> tuple[CyclicCubic, int]:
        """Return the cubic that ends on the parabola when the open slot closes, and the end velocity's limit."""
        end = parabola(self._points_units, self._slot.excess_us, period_us)
        low, high = self._range()
        end_units = max(low, min(end.position_units, high))
        room = highest_velocity(min(end_units - low, high - end_units), period_us + 2 * TICK_US)
        return CyclicCubic(end_units - self._motion.tail_units, end.velocity), room

    def _queue(self, cubic: CyclicCubic, ticks: int) -> None:
        """Queue a cubic. An axis at standstill first waits one tick, to begin together with moving axes."""
        motion = self._motion
        at_standstill = not motion.running
        if at_standstill:
            motion.push_ticks(0, 0, 1)
        if motion.push_ticks(*cubic, ticks) is not Refusal.ACCEPTED:
            motion.drop_queued()
            self._trip(ErrorCode.SEGMENT_REFUSED)
        elif at_standstill:
            motion.start()

    @property
    def _velocity_limit(self) -> int:
        """Highest speed in 1/64 unit per ms, rounded so that cubics of any number of ticks may have it."""
        limit_q16_per_ms = self._motion.rate_limit_q16_per_ms
        microsteps = self._motion.config.microsteps
        return (limit_q16_per_ms & -TICKS_PER_MS) * VELOCITY_PER_UNIT_PER_MS // (microsteps << 2)

    @property
    def _reach_units(self) -> int:
        """Longest travel in one period, in units."""
        return self._velocity_limit * self._dictionary.get(od.INTERPOLATION_PERIOD) // VELOCITY_PER_UNIT_PER_MS
