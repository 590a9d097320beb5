"""The motion of all axes of a board: the kernel's storage, its configuration, and its one way forward in time."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.group_time import GroupTime
from steptwin.controller.motion.kernel import Cells
from steptwin.controller.motion.step_config import UNCONFIGURED, StepConfig
from steptwin.protocol.od import UNITS_PER_FULL_STEP
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS
from steptwin.protocol.timer import COUNTS_PER_SECOND, counts_of_ns

TICKS_PER_SECOND: Final = COUNTS_PER_SECOND // k.TICK_COUNTS
STOP_MAX_MS = k.QUEUE_DEPTH * k.DURATION_MAX_MS
"""The longest stop ramp that fits the queue, 16 s: a deceleration that would take longer is exceeded."""
_SEGMENT_END_TERMS: Final = (k.START_Q16, k.COEFFICIENT_A, k.COEFFICIENT_B, k.COEFFICIENT_C)
"""The position at a segment's end, s = 1, is the sum of these."""
EDGE_CAPACITY: Final = 1 << 16
"""Number of edges of one pin that fit between two drains."""
_TICKS_PER_MS: Final = k.TICKS_PER_MS
_SLACK_Q16: Final = 64
"""More than all roundings of two evaluations of a segment, its parameter's included, add up to."""


class AxisEvent(IntEnum):
    """Reason why an axis needs the firmware's attention."""

    NONE = k.EVENT_NONE
    FINISHED = k.EVENT_FINISHED
    UNDERRUN = k.EVENT_UNDERRUN
    LATE_STEP = k.EVENT_LATE_STEP
    HALTED = k.EVENT_LATE_STEP + 1
    """The group's time has stopped, and the axis with it. `BoardMotion` reports this one, not the kernel."""


class Refusal(IntEnum):
    """Reason why a segment was refused, or ACCEPTED."""

    ACCEPTED = k.ACCEPTED
    QUEUE_FULL = k.REFUSED_QUEUE_FULL
    DURATION = k.REFUSED_DURATION
    COEFFICIENT = k.REFUSED_COEFFICIENT
    TOO_FAST = k.REFUSED_TOO_FAST
    POSITION = k.REFUSED_POSITION
    SOFT_LIMIT = k.REFUSED_POSITION + 1
    """The segment leaves the soft limits. The caller of `Motion.push` checks this one, not the kernel."""


@dataclass(frozen=True, slots=True)
class PinEdges:
    """One axis' edges since the last drain, as the kernel keeps them: integers in a list or an int64 array.

    `clk_counts` holds rise, fall, rise, fall ... in timer counts; `direction` holds 2 * counts + level for each edge.
    """

    clk_counts: Cells
    direction: Cells


class BoardMotion:
    """All axes of one board. Time is `tick`, the first servo tick not yet computed.

    Everything that touches the kernel's storage is here, so the class has many methods: most read or write a few cells
    of one axis and give them a name and a unit. How a group halts is in `group_time`; `ramp_group` lets it.
    """

    def __init__(self, kernel: Kernel, axis_count: int) -> None:
        count = axis_count
        self.axis_count = axis_count
        self.tick = 0
        self._kernel = kernel
        self._push, self._advance = kernel.push, kernel.advance  # called for every record, and every few ticks
        self._axes = kernel.cells(count * k.AXIS_FIELDS)
        self._axes_before = kernel.cells(count * k.AXIS_FIELDS)
        self._cells = kernel.singly(self._axes)
        self._queue = kernel.cells(count * k.QUEUE_DEPTH * k.SEGMENT_FIELDS)
        self.group = GroupTime(kernel.cells(k.GROUP_FIELDS))
        self._clk = kernel.rows(count, EDGE_CAPACITY)
        self._direction = kernel.rows(count, EDGE_CAPACITY)
        self._queue_counts = [axis * k.AXIS_FIELDS + k.QUEUE_COUNT for axis in range(count)]
        """Where the number of queued segments of each axis is."""
        self._running: set[int] = set()
        self.starts = 0
        """Number of times that an axis has been started. While it stays the same, no other axis has begun to run."""
        self.events: dict[int, AxisEvent] = {}
        """Events at the start of `tick`, by axis; a flush or stop before the board's clock gets there cancels them."""
        self._configs = [UNCONFIGURED] * count
        self._lowered: set[int] = set()
        """Axes that still run within a higher rate limit than that of their configuration."""
        for axis in range(count):
            self._set(axis, k.LAST_RISE_COUNTS, k.NEVER_COUNTS)
            self._set(axis, k.MICROSTEPS, UNCONFIGURED.microsteps)
            self._set(axis, k.DURATION_TICKS, 1)
        self._free_edges = EDGE_CAPACITY
        self._edges_per_tick = 0
        self._bound_edges()

    def _get(self, axis: int, field: int) -> int:
        value: int = self._cells[axis * k.AXIS_FIELDS + field]
        return value

    def _set(self, axis: int, field: int, value: int) -> None:
        self._cells[axis * k.AXIS_FIELDS + field] = value

    # --- configuration and position

    def configure(self, axis: int, config: StepConfig) -> None:
        """Set how a standing axis makes its steps; its position in units stays."""
        if config.microsteps != self._get(axis, k.MICROSTEPS):
            self._set_microsteps(axis, config.microsteps)
        self._configs[axis] = config
        steplen_counts = counts_of_ns(config.steplen_ns)
        # A pulse that is already placed keeps its length: with a shorter one from now on, it rose that much later.
        rise_counts = max(self._get(axis, k.LAST_RISE_COUNTS), self.last_fall_counts(axis) - steplen_counts)
        self._set(axis, k.LAST_RISE_COUNTS, rise_counts)
        self._set(axis, k.STEPLEN_COUNTS, steplen_counts)
        self._set(axis, k.STEPSPACE_COUNTS, counts_of_ns(config.stepspace_ns))
        self._set(axis, k.DIRSETUP_COUNTS, counts_of_ns(config.dirsetup_ns))
        self._set(axis, k.DIRHOLD_COUNTS, counts_of_ns(config.dirhold_ns))
        self._set(axis, k.DIR_INVERTED, int(config.dir_inverted))
        self._set_rate_limit(axis, config.rate_limit_q16_per_ms)

    def change_speed_limit(self, axis: int, config: StepConfig) -> None:
        """Take a configuration with another speed limit, in motion or not.

        A higher limit holds at once. A lower one holds for new profiles at once; segments are refused by it when all
        that were planned within the old one have been executed and the axis stands (`settle_speed_limit`).
        """
        self._configs[axis] = config
        if config.rate_limit_q16_per_ms < self.rate_limit_q16_per_ms(axis):
            self._lowered.add(axis)
            self.settle_speed_limit(axis)
        else:
            self._set_rate_limit(axis, config.rate_limit_q16_per_ms)

    def settle_speed_limit(self, axis: int) -> None:
        """Refuse segments by a limit that was lowered, if the axis stands and its queue is empty."""
        if axis in self._lowered and not self.running(axis) and not self.queued(axis):
            self._set_rate_limit(axis, self._configs[axis].rate_limit_q16_per_ms)

    def rate_limit_q16_per_ms(self, axis: int) -> int:
        """Return the highest step rate of segments: that of the configuration, or a higher one until standstill."""
        return self._get(axis, k.RATE_LIMIT_Q16_PER_MS)

    def _set_rate_limit(self, axis: int, limit_q16_per_ms: int) -> None:
        self._lowered.discard(axis)
        self._set(axis, k.RATE_LIMIT_Q16_PER_MS, limit_q16_per_ms)
        self._bound_edges()

    def _bound_edges(self) -> None:
        """Bound the edges of a pin in a tick: the fastest axis' steps, and one more at either end of the tick."""
        fastest_q16_per_ms = max(map(self.rate_limit_q16_per_ms, range(self.axis_count)))
        self._edges_per_tick = 2 * ((fastest_q16_per_ms >> 16) // k.TICKS_PER_MS + 2)

    def _set_microsteps(self, axis: int, microsteps: int) -> None:
        """Count the motor's position in other steps. The demand is set to the counter, so that no step is due."""
        counter_units = self.counter_units(axis)
        self._set(axis, k.MICROSTEPS, microsteps)
        self.preset(axis, counter_units)

    def config(self, axis: int) -> StepConfig:
        """Return how an axis makes its steps."""
        return self._configs[axis]

    def preset(self, axis: int, position_units: int) -> None:
        """Set the position of a standing axis: empty its queue, set its counter to the nearest whole step."""
        q16 = position_units * self._get(axis, k.MICROSTEPS) << 2
        self._set(axis, k.POSITION_Q16, q16)
        self._set(axis, k.COUNTER, (q16 + k.STEP_Q16 // 2) >> 16)
        self.flush(axis)

    def renumber(self, axis: int, step: int, position_units: int) -> None:
        """Shift the count of a standing axis, so that `step` becomes the step nearest to a position; make no step."""
        per_unit = self._get(axis, k.MICROSTEPS) << 2
        shift = ((position_units * per_unit + k.STEP_Q16 // 2) >> 16) - step
        self._set(axis, k.COUNTER, self._get(axis, k.COUNTER) + shift)
        self._set(axis, k.POSITION_Q16, self._get(axis, k.POSITION_Q16) + shift * k.STEP_Q16)
        self.flush(axis)

    def running(self, axis: int) -> bool:
        """Return whether a segment is being executed, or has ended with an event not taken yet."""
        return axis in self._running

    def queued(self, axis: int) -> int:
        """Return the number of segments that wait behind the running one."""
        count: int = self._cells[self._queue_counts[axis]]  # `_get` inlined: read for every record
        return count

    def tail_units(self, axis: int) -> int:
        """Return the position where the next pushed segment will begin."""
        return self._get(axis, k.TAIL_Q16) // (self._get(axis, k.MICROSTEPS) << 2)

    def tail_velocity(self, axis: int) -> int:
        """Return the velocity, in 1/64 unit per ms, of the beginning of the next segment pushed."""
        return self._get(axis, k.TAIL_VELOCITY)

    def delayed_steps(self, axis: int) -> int:
        """Return the number of steps since power-up that had to wait for the driver's timing."""
        return self._get(axis, k.DELAYED_STEPS)

    def last_fall_counts(self, axis: int) -> int:
        """Return when the last pulse placed so far ends; a time long ago if there has been none."""
        return self._get(axis, k.LAST_RISE_COUNTS) + self._get(axis, k.STEPLEN_COUNTS)

    def demand_units(self, axis: int) -> int:
        """Return the demanded position, to the nearest unit."""
        per_unit = self._get(axis, k.MICROSTEPS) << 2
        return (self._get(axis, k.POSITION_Q16) + per_unit // 2) // per_unit

    def demand_steps(self, axis: int) -> int:
        """Return the demanded position, to the nearest step."""
        return (self._get(axis, k.POSITION_Q16) + k.STEP_Q16 // 2) >> 16

    def counter_steps(self, axis: int) -> int:
        """Return the step counter."""
        return self._get(axis, k.COUNTER)

    def counter_units(self, axis: int) -> int:
        """Return the position of the step counter in units, rounded down."""
        return self.counter_steps(axis) * UNITS_PER_FULL_STEP // self._get(axis, k.MICROSTEPS)

    def velocity(self, axis: int) -> int:
        """Return the demanded velocity in 1/64 unit per ms, truncated towards zero."""
        grouped = self._get(axis, k.IN_GROUP)
        return self._velocity_at(axis, self.group.rate_q16(self.tick) if grouped else k.FULL_RATE_Q16)

    def velocity_units_per_s(self, axis: int) -> int:
        """Return the demanded velocity in wire units per second."""
        return self.velocity(axis) * 1000 // VELOCITY_PER_UNIT_PER_MS

    def planned_velocity(self, axis: int) -> int:
        """Return the velocity that the segment plans at this point of the path, as if the group ran at full rate."""
        return self._velocity_at(axis, k.FULL_RATE_Q16)

    def _velocity_at(self, axis: int, rate_q16: int) -> int:
        rate = self._kernel.demand_rate(self._axes, axis) * rate_q16
        per_segment = self._get(axis, k.DURATION_TICKS) * self._get(axis, k.MICROSTEPS) * k.FULL_RATE_Q16
        return _truncated(rate * VELOCITY_PER_UNIT_PER_MS, per_segment) if rate else 0

    # --- segments in

    def push(self, axis: int, displacement_units: int, end_velocity: int, duration_ms: int) -> Refusal:
        """Queue one segment, in the units of a PVT record; return ACCEPTED or the reason for refusing it."""
        return self.push_ticks(axis, displacement_units, end_velocity, duration_ms * _TICKS_PER_MS)

    def push_ticks(self, axis: int, displacement_units: int, end_velocity: int, duration_ticks: int) -> Refusal:
        """Queue one segment whose duration is given in servo ticks."""
        answer = self._push(self._axes, self._queue, axis, displacement_units, end_velocity, duration_ticks)
        return Refusal(answer) if answer else Refusal.ACCEPTED

    def start(self, axis: int, *, in_group: bool = False) -> bool:
        """Begin the oldest queued segment in the next tick, in the group's time or not; False if none is queued."""
        if not self._kernel.next_segment(self._axes, self._queue, axis):
            return False
        self._running.add(axis)
        self.starts += 1
        self._set(axis, k.IN_GROUP, int(in_group))
        if in_group:
            self.group.members.add(axis)
        return True

    def drop_queued(self, axis: int) -> None:
        """Drop the segments behind the running one: the next one pushed continues from its end."""
        if not self.running(axis):
            self.flush(axis)
            return
        end = sum(self._get(axis, field) for field in _SEGMENT_END_TERMS)
        self._set(axis, k.QUEUE_COUNT, 0)
        self._set(axis, k.TAIL_Q16, end)
        self._set(axis, k.TAIL_VELOCITY, self._get(axis, k.END_VELOCITY))

    def flush(self, axis: int) -> None:
        """Drop the running segment and the queue: make no more steps. The next push starts at rest at the demand."""
        self._rest_tail(axis, 0)
        for field in (k.RUNNING, k.COEFFICIENT_A, k.COEFFICIENT_B, k.COEFFICIENT_C):
            self._set(axis, field, 0)
        self._running.discard(axis)
        self.group.members.discard(axis)
        self.events.pop(axis, None)

    def _rest_tail(self, axis: int, velocity: int) -> None:
        """Empty the queue; let the next push begin at the present demand, to the nearest unit, with this velocity."""
        self._set(axis, k.QUEUE_COUNT, 0)
        self._set(axis, k.TAIL_Q16, self.demand_units(axis) * self._get(axis, k.MICROSTEPS) << 2)
        self._set(axis, k.TAIL_VELOCITY, velocity)

    def stop(self, axis: int, duration_ms: int) -> None:
        """Replace all segments by a ramp from the present velocity to rest, with constant deceleration.

        The rate limit is lifted for the ramp, so that it is not refused for its speed. Where it would leave the range
        of an i32 position, the axis stops dead instead and is not running afterwards.
        """
        self.events.pop(axis, None)
        velocity = self.velocity(axis)
        self.group.members.discard(axis)
        limit = self._get(axis, k.RATE_LIMIT_Q16_PER_MS)
        self._rest_tail(axis, velocity)
        self._set(axis, k.RATE_LIMIT_Q16_PER_MS, k.I32_MAX)
        pushed = [self.push(axis, *segment) for segment in stop_segments(velocity, duration_ms)]
        self._set(axis, k.RATE_LIMIT_Q16_PER_MS, limit)
        if all(refusal is Refusal.ACCEPTED for refusal in pushed):
            self.start(axis)
        else:
            self.flush(axis)

    # --- halt and resume (see `ramp_group`)

    def halted(self, axis: int) -> bool:
        """Return whether an axis rests within its segments because its group has halted and the event was taken."""
        return axis in self.group.members and self.group.resting(self.tick) and axis not in self.events

    def elapsed_ticks(self, axis: int) -> int:
        """Return the trajectory time since the running segment's start, in whole ticks."""
        return self._get(axis, k.ELAPSED_Q16) >> 16

    def planned_segments(self, axis: int) -> Iterator[list[int]]:
        """Yield a, b, c and the duration in ticks of the running segment and of those queued behind it."""
        fields = (k.COEFFICIENT_A, k.COEFFICIENT_B, k.COEFFICIENT_C, k.DURATION_TICKS)
        yield [self._get(axis, field) for field in fields]
        fields = (k.SEGMENT_A, k.SEGMENT_B, k.SEGMENT_C, k.SEGMENT_TICKS)
        for i in range(self.queued(axis)):
            slot = (self._get(axis, k.QUEUE_HEAD) + i) % k.QUEUE_DEPTH
            entry = (axis * k.QUEUE_DEPTH + slot) * k.SEGMENT_FIELDS
            yield [int(self._queue[entry + field]) for field in fields]

    def quiet_ticks(self, axis: int, steps: int) -> int:
        """Return for how many ticks a running axis' counter certainly moves by less than `steps`.

        It ends with the running segment at the latest, and a start or stop of the axis (`starts`) makes it void. The
        slope of a cubic stays within its Bernstein coefficients a, a + b and a + 2b + 3c, and a group's time never
        runs faster than ticks do.
        """
        a, b, c = self._get(axis, k.COEFFICIENT_A), self._get(axis, k.COEFFICIENT_B), self._get(axis, k.COEFFICIENT_C)
        duration_ticks = self._get(axis, k.DURATION_TICKS)
        left_ticks = ((duration_ticks << 16) - self._get(axis, k.ELAPSED_Q16)) >> 16
        fastest = max(max(abs(a), abs(a + b)), abs(a + 2 * b + 3 * c))  # noqa: PLW3301  (of two each: made in C)
        offset_q16 = abs(self._get(axis, k.POSITION_Q16) - self._get(axis, k.COUNTER) * k.STEP_Q16)
        way_q16 = k.THRESHOLD_Q16 + (steps - 1) * k.STEP_Q16 - offset_q16 - _SLACK_Q16
        if way_q16 <= 0:
            return 0
        return min(left_ticks, way_q16 * duration_ticks // fastest) if fastest else left_ticks

    # --- time forward, edges and events out

    @property
    def room_ticks(self) -> int:
        """Number of ticks whose edges are sure to fit before `take_edges` must be called."""
        return self._free_edges // self._edges_per_tick

    def advance(self, until_tick: int) -> int:
        """Compute the motion up to the start of `until_tick`; return the tick reached.

        That is an earlier one if an axis needs attention there (see `take_events`) or if the edges must be drained
        (`room_ticks` is 0).
        """
        if not self._running:
            self.tick = until_tick
            return until_tick
        until = min(until_tick, self.tick + self.room_ticks)
        rest_tick = self.group.rest_tick
        if rest_tick is not None and self.tick < rest_tick < until:
            until = rest_tick
        reached, asking = self._advance(
            self._axes,
            self._axes_before,
            self._queue,
            self.group.cells,
            self._clk,
            self._direction,
            self.axis_count,
            self.tick,
            until,
        )
        self._free_edges -= (reached - self.tick) * self._edges_per_tick
        comes_to_rest = self.tick < reached == rest_tick
        self.tick = reached
        if asking:
            self._note_events()
        if comes_to_rest:
            for axis in sorted(self.group.members):
                self.events.setdefault(axis, AxisEvent.HALTED)
        return reached

    def _note_events(self) -> None:
        for axis in sorted(self._running):
            event = self._get(axis, k.EVENT)
            if event != k.EVENT_NONE:
                self.events[axis] = AxisEvent(event)
                self._set(axis, k.EVENT, k.EVENT_NONE)

    def take_events(self) -> list[tuple[int, AxisEvent]]:
        """Return each event once, with its axis. An axis that has an event is at rest or must be stopped."""
        events, self.events = list(self.events.items()), {}
        ended = {axis for axis, event in events if event in (AxisEvent.FINISHED, AxisEvent.UNDERRUN)}
        self._running -= ended
        self.group.members -= ended
        return events

    def undrained_pulses(self, axis: int) -> int:
        """Return the number of pulses placed since the last drain."""
        return self._get(axis, k.CLK_EDGES) // 2

    def take_edges(self) -> tuple[PinEdges, ...]:
        """Return all edges that have been placed and not been taken, and make room for new ones."""
        edges = tuple(self.take_axis_edges(axis) for axis in range(self.axis_count))
        self._free_edges = EDGE_CAPACITY
        return edges

    def take_axis_edges(self, axis: int) -> PinEdges:
        """Return those of one axis; `room_ticks` stays, since the other axes' edges do."""
        clk_edges, dir_edges = self._get(axis, k.CLK_EDGES), self._get(axis, k.DIR_EDGES)
        edges = PinEdges(self._clk[axis][:clk_edges].copy(), self._direction[axis][:dir_edges].copy())
        self._set(axis, k.CLK_EDGES, 0)
        self._set(axis, k.DIR_EDGES, 0)
        return edges


def stop_segments(velocity: int, duration_ms: int) -> list[tuple[int, int, int]]:
    """Return the ramp from `velocity` (1/64 unit per ms) to rest as (displacement, end velocity, duration) segments.

    After t of T ms the velocity is v (1 - t/T) and the distance v (T^2 - (T-t)^2) / 2T. Displacements are differences
    of distances from the start, so that roundings do not add up.
    """
    segments = []
    ended_ms, ended_units = 0, 0
    while ended_ms < duration_ms:
        dt_ms = min(k.DURATION_MAX_MS, duration_ms - ended_ms)
        ended_ms += dt_ms
        left_ms = duration_ms - ended_ms
        travelled = velocity * (duration_ms * duration_ms - left_ms * left_ms)
        units = _truncated(travelled, 2 * VELOCITY_PER_UNIT_PER_MS * duration_ms)
        segments.append((units - ended_units, _truncated(velocity * left_ms, duration_ms), dt_ms))
        ended_units = units
    return segments


def _truncated(numerator: int, denominator: int) -> int:
    """Divide towards zero, as C does; the denominator is positive."""
    return numerator // denominator if numerator >= 0 else -(-numerator // denominator)


def ramp_group(motion: BoardMotion, decelerations_units_per_s2: Sequence[int]) -> None:
    """Halt or resume the group, as its axes request, from the next tick on, within each axis' deceleration limit.

    See `group_time` for the formula. The speeds come from the segments that the ramp will cover, if they are queued.
    """
    group = motion.group
    # Where the plan has every axis at rest, v dr/dt is 0 at any slope: the rate may change at once.
    moves = any(motion.planned_velocity(axis) for axis in group.members)
    group.ramp(motion.tick, _full_ramp_ticks(motion, decelerations_units_per_s2) if moves else 0)


def _full_ramp_ticks(motion: BoardMotion, decelerations_units_per_s2: Sequence[int]) -> int:
    """Return the shortest ramp between full rate and 0 that keeps |v dr/dt| within every axis' deceleration D.

    That is T = |v| / D, with v the highest speed in the T/2 of trajectory time that the ramp covers at most. A longer
    ramp covers more segments, which may be faster: so T is increased until it suffices. Like a stop it lasts at most
    STOP_MAX_MS.
    """
    needed, ticks = 1, 0
    while needed > ticks:
        ticks = needed
        for axis in motion.group.members:
            velocity = _fastest_units_per_s(motion, axis, ticks // 2 + 1)
            needed = max(needed, -(-velocity * TICKS_PER_SECOND // decelerations_units_per_s2[axis]))
        needed = min(needed, STOP_MAX_MS * _TICKS_PER_MS)
    return ticks


def _fastest_units_per_s(motion: BoardMotion, axis: int, ahead_ticks: int) -> int:
    """Bound the planned speed over a time ahead, by the Bernstein coefficients of the segments' velocities."""
    per_unit_q16 = motion.config(axis).microsteps << 2
    left_ticks = ahead_ticks + motion.elapsed_ticks(axis)
    fastest = 0
    for a, b, c, duration_ticks in motion.planned_segments(axis):
        if left_ticks <= 0:
            break
        rate_q16 = max(abs(a), abs(a + b), abs(a + 2 * b + 3 * c))
        fastest = max(fastest, -(-rate_q16 * TICKS_PER_SECOND // (per_unit_q16 * duration_ticks)))
        left_ticks -= duration_ticks
    return fastest
