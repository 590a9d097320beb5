"""The motion of one axis: configuration, position, segment queue and stops; and the state that all axes share."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.group_time import GroupTime
from steptwin.controller.motion.kernel import Cells, Rows
from steptwin.controller.motion.step_config import UNCONFIGURED, StepConfig
from steptwin.protocol.od import UNITS_PER_FULL_STEP
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS
from steptwin.protocol.timer import COUNTS_PER_SECOND, counts_of_ns

TICKS_PER_SECOND: Final = COUNTS_PER_SECOND // k.TICK_COUNTS
STOP_MAX_MS = k.QUEUE_DEPTH * k.DURATION_MAX_MS
"""Longest stop ramp that fits into the queue: 16 s. A slower deceleration is raised to this duration."""
_SEGMENT_END_TERMS: Final = (k.START_Q16, k.COEFFICIENT_A, k.COEFFICIENT_B, k.COEFFICIENT_C)
"""Fields whose sum is the position at a segment's end (s = 1)."""
EDGE_CAPACITY: Final = 1 << 16
"""Storage for edges of one pin between two drains."""
_SLACK_Q16: Final = 64
"""Upper bound of all rounding errors in two evaluations of a segment, including its parameter."""


class AxisEvent(IntEnum):
    """Reason why an axis needs the firmware's attention."""

    NONE = k.EVENT_NONE
    FINISHED = k.EVENT_FINISHED
    UNDERRUN = k.EVENT_UNDERRUN
    LATE_STEP = k.EVENT_LATE_STEP
    HALTED = k.EVENT_LATE_STEP + 1
    """The group's time has stopped, and so has the axis. `BoardMotion` reports this event, not the kernel."""


class Refusal(IntEnum):
    """Reason why a segment was refused, or ACCEPTED."""

    ACCEPTED = k.ACCEPTED
    QUEUE_FULL = k.REFUSED_QUEUE_FULL
    DURATION = k.REFUSED_DURATION
    COEFFICIENT = k.REFUSED_COEFFICIENT
    TOO_FAST = k.REFUSED_TOO_FAST
    POSITION = k.REFUSED_POSITION
    SOFT_LIMIT = k.REFUSED_POSITION + 1
    """The segment leaves the soft limits. The caller of `AxisMotion.push` checks this, not the kernel."""


@dataclass(frozen=True, slots=True)
class PinEdges:
    """Edges of one axis since the last drain, in the kernel's storage: a list or an int64 array.

    `clk_counts` holds rise, fall, rise, fall ... in timer counts; `direction` holds 2 * counts + level for each edge.
    """

    clk_counts: Cells
    direction: Cells


class BoardState:
    """State that all axes of a board share: the kernel and its storage, the time, and the running axes."""

    def __init__(self, kernel: Kernel, axis_count: int) -> None:
        self.kernel = kernel
        self.axis_count = axis_count
        self.cells: Cells = kernel.cells(axis_count * k.AXIS_FIELDS)
        """Fields of all axes, as the kernel uses them."""
        self.cells_singly: Cells = kernel.singly(self.cells)
        self.queue: Cells = kernel.cells(axis_count * k.QUEUE_DEPTH * k.SEGMENT_FIELDS)
        self.clk: Rows = kernel.rows(axis_count, EDGE_CAPACITY)
        self.direction: Rows = kernel.rows(axis_count, EDGE_CAPACITY)
        self.group: GroupTime = GroupTime(kernel.cells(k.GROUP_FIELDS))
        self.tick = 0
        """First servo tick that is not computed yet."""
        self.running_axes: set[int] = set()
        """Axes that execute a segment, or whose last segment ended with an event that is not taken yet."""
        self.starts = 0
        """Number of axis starts. While it does not change, no further axis has begun to run."""
        self.events: dict[int, AxisEvent] = {}
        """Events at the start of `tick` by axis; a flush or stop before that tick cancels them."""
        self.edges_per_tick: int = 0
        """Bound of a pin's edges in one tick: the steps of the fastest axis, and one more at each end of the tick."""

    def bound_edges(self) -> None:
        """Update `edges_per_tick` after a change of a rate limit."""
        limits = self.cells_singly[k.RATE_LIMIT_Q16_PER_MS :: k.AXIS_FIELDS]
        self.edges_per_tick = 2 * ((max(limits) >> 16) // k.TICKS_PER_MS + 2)


class AxisMotion:
    """One axis of a board: access to its kernel cells by names and units.

    See `group_time` and `ramp_group` for the halt of a group.
    """

    def __init__(self, board: BoardState, axis: int) -> None:
        self._board = board
        self._axis = axis
        self._base = axis * k.AXIS_FIELDS
        self._cells = board.cells_singly
        self._push = board.kernel.push  # called for every record
        self.config: StepConfig = UNCONFIGURED
        """Present step configuration."""
        self._lowered = False
        """True while the axis still has a higher rate limit than its configuration."""
        self.highest_rate_q16 = k.FULL_RATE_Q16
        """Highest rate of the group's time at which the pushed records keep the step rate limit."""
        self._set(k.LAST_RISE_COUNTS, k.NEVER_COUNTS)
        self._set(k.MICROSTEPS, UNCONFIGURED.microsteps)
        self._set(k.DURATION_TICKS, 1)

    def _get(self, field: int) -> int:
        value: int = self._cells[self._base + field]
        return value

    def _set(self, field: int, value: int) -> None:
        self._cells[self._base + field] = value

    # --- configuration and position

    def configure(self, config: StepConfig) -> None:
        """Change the step configuration at standstill; the position in units stays."""
        if config.microsteps != self._get(k.MICROSTEPS):
            counter_units = self.counter_units
            self._set(k.MICROSTEPS, config.microsteps)
            self.preset(counter_units)  # the demand becomes equal to the counter: no step is due
        self.config = config
        steplen_counts = counts_of_ns(config.steplen_ns)
        # A pulse that is already placed keeps its length. If pulses become shorter now, shift its rise accordingly.
        rise_counts = max(self._get(k.LAST_RISE_COUNTS), self.last_fall_counts - steplen_counts)
        self._set(k.LAST_RISE_COUNTS, rise_counts)
        self._set(k.STEPLEN_COUNTS, steplen_counts)
        self._set(k.STEPSPACE_COUNTS, counts_of_ns(config.stepspace_ns))
        self._set(k.DIRSETUP_COUNTS, counts_of_ns(config.dirsetup_ns))
        self._set(k.DIRHOLD_COUNTS, counts_of_ns(config.dirhold_ns))
        self._set(k.DIR_INVERTED, int(config.dir_inverted))
        self._set_rate_limit(config.rate_limit_q16_per_ms)

    def change_speed_limit(self, config: StepConfig) -> None:
        """Change the speed limit, at standstill or in motion.

        A higher limit is valid at once. A lower limit is valid for new profiles at once. For segments it is valid when
        all segments of the old limit have been executed and the axis is at standstill (`settle_speed_limit`).
        """
        self.config = config
        if config.rate_limit_q16_per_ms < self.rate_limit_q16_per_ms:
            self._lowered = True
            self.settle_speed_limit()
        else:
            self._set_rate_limit(config.rate_limit_q16_per_ms)

    def settle_speed_limit(self) -> None:
        """Apply a lowered speed limit to segments, if the axis is at standstill and its queue is empty."""
        if self._lowered and not self.running and not self.queued:
            self._set_rate_limit(self.config.rate_limit_q16_per_ms)

    @property
    def rate_limit_q16_per_ms(self) -> int:
        """Highest step rate of segments: the configured one, or a previous higher one until standstill."""
        return self._get(k.RATE_LIMIT_Q16_PER_MS)

    def _set_rate_limit(self, limit_q16_per_ms: int) -> None:
        self._lowered = False
        self._set(k.RATE_LIMIT_Q16_PER_MS, limit_q16_per_ms)
        self._board.bound_edges()

    def preset(self, position_units: int) -> None:
        """Set the position at standstill: empty the queue, set the counter to the nearest step."""
        q16 = position_units * self._get(k.MICROSTEPS) << 2
        self._set(k.POSITION_Q16, q16)
        self._set(k.COUNTER, (q16 + k.STEP_Q16 // 2) >> 16)
        self.flush()

    def renumber(self, step: int, position_units: int) -> None:
        """Shift the counter at standstill: `step` becomes the step nearest to a position. No step is made."""
        per_unit = self._get(k.MICROSTEPS) << 2
        shift = ((position_units * per_unit + k.STEP_Q16 // 2) >> 16) - step
        self._set(k.COUNTER, self._get(k.COUNTER) + shift)
        self._set(k.POSITION_Q16, self._get(k.POSITION_Q16) + shift * k.STEP_Q16)
        self.flush()

    @property
    def board_axes(self) -> int:
        """Number of axes of the board."""
        return self._board.axis_count

    @property
    def running(self) -> bool:
        """True while a segment is executed, or its final event is not taken yet."""
        return self._axis in self._board.running_axes

    @property
    def queued(self) -> int:
        """Number of segments in the queue behind the running one."""
        count: int = self._cells[self._base + k.QUEUE_COUNT]  # `_get` inlined: read for every record
        return count

    @property
    def tail_units(self) -> int:
        """Position where the next pushed segment will begin."""
        return self._get(k.TAIL_Q16) // (self._get(k.MICROSTEPS) << 2)

    @property
    def tail_velocity(self) -> int:
        """Velocity, in 1/64 unit per ms, with which the next pushed segment will begin."""
        return self._get(k.TAIL_VELOCITY)

    @property
    def delayed_steps(self) -> int:
        """Number of steps since power-up that the driver's timing has delayed."""
        return self._get(k.DELAYED_STEPS)

    @property
    def last_fall_counts(self) -> int:
        """End of the last pulse placed so far; a time long ago if there was none."""
        return self._get(k.LAST_RISE_COUNTS) + self._get(k.STEPLEN_COUNTS)

    @property
    def demand_units(self) -> int:
        """Demanded position, to the nearest unit."""
        per_unit = self._get(k.MICROSTEPS) << 2
        return (self._get(k.POSITION_Q16) + per_unit // 2) // per_unit

    @property
    def demand_steps(self) -> int:
        """Demanded position, to the nearest step."""
        return (self._get(k.POSITION_Q16) + k.STEP_Q16 // 2) >> 16

    @property
    def counter_steps(self) -> int:
        """The step counter."""
        return self._get(k.COUNTER)

    @property
    def counter_units(self) -> int:
        """Position of the step counter in units, rounded down."""
        return self.counter_steps * UNITS_PER_FULL_STEP // self._get(k.MICROSTEPS)

    @property
    def velocity(self) -> int:
        """Demanded velocity in 1/64 unit per ms, truncated towards zero."""
        grouped = self._get(k.IN_GROUP)
        return self._velocity_at(self._board.group.rate_q16(self._board.tick) if grouped else k.FULL_RATE_Q16)

    @property
    def velocity_units_per_s(self) -> int:
        """Demanded velocity in wire units per second."""
        return self.velocity * 1000 // VELOCITY_PER_UNIT_PER_MS

    @property
    def planned_velocity(self) -> int:
        """Velocity of the segment at this point of the path at full rate, independent of the group's present rate."""
        return self._velocity_at(k.FULL_RATE_Q16)

    def _velocity_at(self, rate_q16: int) -> int:
        rate = self._board.kernel.demand_rate(self._board.cells, self._axis) * rate_q16
        per_segment = self._get(k.DURATION_TICKS) * self._get(k.MICROSTEPS) * k.FULL_RATE_Q16
        return _truncated(rate * VELOCITY_PER_UNIT_PER_MS, per_segment) if rate else 0

    # --- segments in

    def push(self, displacement_units: int, end_velocity: int, duration_ms: int) -> Refusal:
        """Queue one segment in the units of a PVT record; return ACCEPTED or the reason of the refusal."""
        return self.push_ticks(displacement_units, end_velocity, duration_ms * k.TICKS_PER_MS)

    def push_ticks(self, displacement_units: int, end_velocity: int, duration_ticks: int) -> Refusal:
        """Queue one segment with a duration in servo ticks."""
        board = self._board
        answer = self._push(board.cells, board.queue, self._axis, displacement_units, end_velocity, duration_ticks)
        return Refusal(answer) if answer else Refusal.ACCEPTED

    def push_record(self, displacement_units: int, end_velocity: int, duration_ticks: int) -> Refusal:
        """Queue one segment in the group's time; refuse it if it is too fast at the group's highest rate."""
        if self.highest_rate_q16 == k.FULL_RATE_Q16:
            return self.push_ticks(displacement_units, end_velocity, duration_ticks)
        limit = self._get(k.RATE_LIMIT_Q16_PER_MS)
        self._set(k.RATE_LIMIT_Q16_PER_MS, limit * k.FULL_RATE_Q16 // self.highest_rate_q16)
        refusal = self.push_ticks(displacement_units, end_velocity, duration_ticks)
        self._set(k.RATE_LIMIT_Q16_PER_MS, limit)
        return refusal

    def start(self, *, in_group: bool = False) -> bool:
        """Begin the oldest queued segment in the next tick, in real time or in the group's time.

        Return False if the queue is empty, or if the group's time runs faster than the axis' records allow. The first
        axis of a group sets the requested rate to full rate.
        """
        board = self._board
        if in_group and not board.group.members:
            board.group.wanted_q16 = k.FULL_RATE_Q16
        elif in_group and max(board.group.wanted_q16, board.group.rate_q16(board.tick)) > self.highest_rate_q16:
            return False
        if not board.kernel.next_segment(board.cells, board.queue, self._axis):
            return False
        board.running_axes.add(self._axis)
        board.starts += 1
        self._set(k.IN_GROUP, int(in_group))
        if in_group:
            board.group.members.add(self._axis)
        return True

    def drop_queued(self) -> None:
        """Drop the segments behind the running one; the next pushed one begins at its end."""
        if not self.running:
            self.flush()
            return
        self._set(k.QUEUE_COUNT, 0)
        self._set(k.TAIL_Q16, self._running_end_q16)
        self._set(k.TAIL_VELOCITY, self._get(k.END_VELOCITY))

    @property
    def _running_end_q16(self) -> int:
        return sum(self._get(field) for field in _SEGMENT_END_TERMS)

    @property
    def running_end(self) -> tuple[int, int]:
        """Position in units and velocity in 1/64 unit per ms at the running segment's end, or at standstill."""
        if not self.running:
            return self.demand_units, 0
        return self._running_end_q16 // (self._get(k.MICROSTEPS) << 2), self._get(k.END_VELOCITY)

    def flush(self) -> None:
        """Drop the running segment and the queue: no more steps. The next segment begins at the demand, at rest."""
        self._reset_tail(0)
        for field in (k.RUNNING, k.COEFFICIENT_A, k.COEFFICIENT_B, k.COEFFICIENT_C):
            self._set(field, 0)
        self._board.running_axes.discard(self._axis)
        self._board.group.members.discard(self._axis)
        self._board.events.pop(self._axis, None)

    def _reset_tail(self, velocity: int) -> None:
        """Empty the queue; the next segment begins at the present demand, to the nearest unit, with this velocity."""
        self._set(k.QUEUE_COUNT, 0)
        self._set(k.TAIL_Q16, self.demand_units * self._get(k.MICROSTEPS) << 2)
        self._set(k.TAIL_VELOCITY, velocity)

    def stop(self, duration_ms: int) -> None:
        """Replace all segments by a stop ramp with constant deceleration from the present velocity.

        The rate limit does not apply to the ramp. If the ramp would leave the range of i32 positions, the axis stops at
        once instead.
        """
        self._board.events.pop(self._axis, None)
        velocity = self.velocity
        self._board.group.members.discard(self._axis)
        limit = self._get(k.RATE_LIMIT_Q16_PER_MS)
        self._reset_tail(velocity)
        self._set(k.RATE_LIMIT_Q16_PER_MS, k.I32_MAX)
        pushed = [self.push(*segment) for segment in stop_segments(velocity, duration_ms)]
        self._set(k.RATE_LIMIT_Q16_PER_MS, limit)
        if all(refusal is Refusal.ACCEPTED for refusal in pushed):
            self.start()
        else:
            self.flush()

    # --- halt and resume (see `ramp_group`)

    @property
    def halted(self) -> bool:
        """True if the axis has stopped within its segments by a halt of its group, and the event was taken."""
        board, axis = self._board, self._axis
        return axis in board.group.members and board.group.stopped(board.tick) and axis not in board.events

    def _planned_segments(self) -> Iterator[list[int]]:
        """Yield a, b, c and the duration in ticks of the running segment and of the queued ones."""
        fields = (k.COEFFICIENT_A, k.COEFFICIENT_B, k.COEFFICIENT_C, k.DURATION_TICKS)
        yield [self._get(field) for field in fields]
        fields = (k.SEGMENT_A, k.SEGMENT_B, k.SEGMENT_C, k.SEGMENT_TICKS)
        for i in range(self.queued):
            slot = (self._get(k.QUEUE_HEAD) + i) % k.QUEUE_DEPTH
            entry = (self._axis * k.QUEUE_DEPTH + slot) * k.SEGMENT_FIELDS
            yield [int(self._board.queue[entry + field]) for field in fields]

    def fastest_units_per_s(self, ahead_ticks: int) -> int:
        """Return a bound of the planned speed in the next `ahead_ticks`, by the velocities' Bernstein coefficients."""
        per_unit_q16 = self._get(k.MICROSTEPS) << 2
        left_ticks = ahead_ticks + (self._get(k.ELAPSED_Q16) >> 16)
        fastest = 0
        for a, b, c, duration_ticks in self._planned_segments():
            if left_ticks <= 0:
                break
            rate_q16 = max(abs(a), abs(a + b), abs(a + 2 * b + 3 * c))
            fastest = max(fastest, -(-rate_q16 * TICKS_PER_SECOND // (per_unit_q16 * duration_ticks)))
            left_ticks -= duration_ticks
        return fastest

    def quiet_ticks(self, steps: int) -> int:
        """Return the number of ticks in which the running axis' counter certainly changes by less than `steps`.

        The result does not exceed the end of the running segment. A start or stop of the axis (`BoardState.starts`)
        invalidates it. It uses two bounds: the slope of a cubic stays within its Bernstein coefficients a, a + b and
        a + 2b + 3c, and a group's time never runs faster than the axis' highest rate.
        """
        a, b, c = self._get(k.COEFFICIENT_A), self._get(k.COEFFICIENT_B), self._get(k.COEFFICIENT_C)
        duration_ticks = self._get(k.DURATION_TICKS)
        left_ticks = ((duration_ticks << 16) - self._get(k.ELAPSED_Q16)) // self.highest_rate_q16
        fastest = max(max(abs(a), abs(a + b)), abs(a + 2 * b + 3 * c))  # noqa: PLW3301  (max of two is fast in C)
        offset_q16 = abs(self._get(k.POSITION_Q16) - self._get(k.COUNTER) * k.STEP_Q16)
        distance_q16 = k.THRESHOLD_Q16 + (steps - 1) * k.STEP_Q16 - offset_q16 - _SLACK_Q16
        if distance_q16 <= 0:
            return 0
        fastest_q16 = fastest * self.highest_rate_q16
        return min(left_ticks, (distance_q16 * duration_ticks << 16) // fastest_q16) if fastest else left_ticks

    # --- edges and events out

    def take_event(self) -> AxisEvent:
        """Return and clear the kernel's event."""
        event = AxisEvent(self._get(k.EVENT))
        self._set(k.EVENT, k.EVENT_NONE)
        return event

    @property
    def undrained_pulses(self) -> int:
        """Number of pulses placed since the last drain."""
        return self._get(k.CLK_EDGES) // 2

    def take_edges(self) -> PinEdges:
        """Return the axis' placed edges since the last call. The edges of the other axes stay in the storage."""
        clk_edges, dir_edges = self._get(k.CLK_EDGES), self._get(k.DIR_EDGES)
        clk, direction = self._board.clk[self._axis], self._board.direction[self._axis]
        edges = PinEdges(clk[:clk_edges].copy(), direction[:dir_edges].copy())
        self._set(k.CLK_EDGES, 0)
        self._set(k.DIR_EDGES, 0)
        return edges


def stop_segments(velocity: int, duration_ms: int) -> list[tuple[int, int, int]]:
    """Return the stop ramp from `velocity` (1/64 unit per ms) as (displacement, end velocity, duration) segments.

    After t of T ms the velocity is v (1 - t/T) and the distance v (T^2 - (T-t)^2) / 2T. Displacements are differences
    of distances from the start, so rounding errors do not add up.
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
