"""The motion of all axes of a board: the kernel's storage, its configuration and its one way forward in time."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum

from steptwin.controller import kernel as k
from steptwin.controller.backend import Kernel
from steptwin.controller.group_time import GroupTime
from steptwin.controller.kernel import Cells
from steptwin.protocol.objects import UNITS_PER_FULL_STEP
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS
from steptwin.protocol.timer import COUNTS_PER_SECOND

NS_PER_SECOND = 1_000_000_000
TICKS_PER_SECOND = COUNTS_PER_SECOND // k.TICK_COUNTS
REVERSED = 0xC0
"""Polarity (CiA 402, object 0x607E): bit 7 reverses positions, bit 6 velocities."""
INVERT_DIR = 0x02
"""Bit of the invert mask 0x2001:05, in the order STEP, DIR, ENABLE."""
STOP_MAX_MS = k.QUEUE_DEPTH * k.DURATION_MAX_MS
"""The longest ramp that fits the queue, 16 s; a lower deceleration than that is not honoured."""
_SEGMENT_END_TERMS = (k.START_Q16, k.COEFFICIENT_A, k.COEFFICIENT_B, k.COEFFICIENT_C)
"""A segment's cubic at s = 1 is the sum of these."""
EDGE_CAPACITY = 1 << 16
"""Edges of one pin that fit between two drains."""


class Event(IntEnum):
    """What an axis asks the firmware's attention for."""

    NONE = k.EVENT_NONE
    FINISHED = k.EVENT_FINISHED
    UNDERRUN = k.EVENT_UNDERRUN
    LATE_STEP = k.EVENT_LATE_STEP
    HALTED = k.EVENT_LATE_STEP + 1
    """The group's time stands still and the axis with it. This one is not the kernel's."""


class Refusal(IntEnum):
    """Why a segment was not queued."""

    ACCEPTED = k.ACCEPTED
    QUEUE_FULL = k.REFUSED_QUEUE_FULL
    DURATION = k.REFUSED_DURATION
    COEFFICIENT = k.REFUSED_COEFFICIENT
    TOO_FAST = k.REFUSED_TOO_FAST
    POSITION = k.REFUSED_POSITION
    SOFT_LIMIT = k.REFUSED_POSITION + 1
    """It would leave the range that the host allows. This one is not the kernel's."""


@dataclass(frozen=True, slots=True)
class StepConfig:
    """How one axis makes its steps; the four timings are LinuxCNC's, in ns, and are rounded up to timer counts."""

    microsteps: int
    steplen_ns: int
    stepspace_ns: int
    dirsetup_ns: int
    dirhold_ns: int
    velocity_max_units_per_s: int
    polarity: int = 0
    """0x607E: 0, or REVERSED."""
    invert_mask: int = 0
    """0x2001:05: 0, or INVERT_DIR."""

    @property
    def dir_inverted(self) -> bool:
        """Whether DIR is low while the position grows."""
        return bool(self.polarity) != bool(self.invert_mask)

    @property
    def rate_limit_q16_per_ms(self) -> int:
        """The fastest allowed step rate: the velocity limit, or what the pulse timing can make if that is less."""
        by_velocity = (self.velocity_max_units_per_s * self.microsteps << 2) // 1000
        pulse_counts = counts_of_ns(self.steplen_ns) + counts_of_ns(self.stepspace_ns)
        by_timing = (COUNTS_PER_SECOND * k.STEP_Q16) // (1000 * pulse_counts)
        return min(by_velocity, by_timing)


UNCONFIGURED = StepConfig(1, 1_000_000, 1_000_000, 0, 0, velocity_max_units_per_s=0)
"""An axis that refuses every motion."""


@dataclass(frozen=True, slots=True)
class PinEdges:
    """One axis' edges since the last drain, as kept by the kernel: integers in a list or an int64 array.

    `clk_counts` holds rise, fall, rise, fall, ... in timer counts; `direction` holds 2 * counts + level.
    """

    clk_counts: Cells
    direction: Cells


def counts_of_ns(duration_ns: int) -> int:
    """Timer counts that last at least as long: a minimum is never undercut by rounding."""
    return -(-duration_ns * COUNTS_PER_SECOND // NS_PER_SECOND)


class Motion:
    """All axes of one board. Time is `tick`, the first servo tick not yet computed."""

    def __init__(self, kernel: Kernel, axis_count: int) -> None:
        count = axis_count
        self.axis_count = axis_count
        self.tick = 0
        self._kernel = kernel
        self._axes = kernel.cells(count * k.AXIS_FIELDS)
        self._axes_before = kernel.cells(count * k.AXIS_FIELDS)
        self._cells = kernel.singly(self._axes)
        self._queue = kernel.cells(count * k.QUEUE_DEPTH * k.SEGMENT_FIELDS)
        self.group = GroupTime(kernel.cells(k.GROUP_FIELDS))
        self._clk = kernel.rows(count, EDGE_CAPACITY)
        self._direction = kernel.rows(count, EDGE_CAPACITY)
        self._running: set[int] = set()
        self.starts = 0
        """How many times an axis has been set going: whoever follows those that run need not ask before it changes."""
        self.events: dict[int, Event] = {}
        """What axes ask attention for at the start of `tick`, which the board's clock may not have reached yet: see
        `take_events`. A flush or a stop before then answers it."""
        self._configs = [UNCONFIGURED] * count
        for axis in range(count):
            self._set(axis, k.LAST_RISE_COUNTS, k.NEVER_COUNTS)
            self._set(axis, k.MICROSTEPS, UNCONFIGURED.microsteps)
            self._set(axis, k.DURATION_TICKS, 1)
        self._free_edges = EDGE_CAPACITY
        self._edges_per_tick = _edges_per_tick(self._configs)

    def _get(self, axis: int, field: int) -> int:
        value: int = self._cells[axis * k.AXIS_FIELDS + field]
        return value

    def _set(self, axis: int, field: int, value: int) -> None:
        self._cells[axis * k.AXIS_FIELDS + field] = value

    # --- what the axes are and where they stand

    def configure(self, axis: int, config: StepConfig) -> None:
        """Set how a standing axis makes its steps. Its place stays, in units."""
        if config.microsteps != self._get(axis, k.MICROSTEPS):
            self._set_microsteps(axis, config.microsteps)
        self._configs[axis] = config
        self._edges_per_tick = _edges_per_tick(self._configs)
        self._set(axis, k.STEPLEN_COUNTS, counts_of_ns(config.steplen_ns))
        self._set(axis, k.STEPSPACE_COUNTS, counts_of_ns(config.stepspace_ns))
        self._set(axis, k.DIRSETUP_COUNTS, counts_of_ns(config.dirsetup_ns))
        self._set(axis, k.DIRHOLD_COUNTS, counts_of_ns(config.dirhold_ns))
        self._set(axis, k.RATE_LIMIT_Q16_PER_MS, config.rate_limit_q16_per_ms)
        self._set(axis, k.DIR_INVERTED, int(config.dir_inverted))

    def _set_microsteps(self, axis: int, microsteps: int) -> None:
        """The motor stands where it stood, counted in other steps; the demand goes there, so no step is owed."""
        counter_units = self.counter_units(axis)
        self._set(axis, k.MICROSTEPS, microsteps)
        self.preset(axis, counter_units)

    def config(self, axis: int) -> StepConfig:
        """How an axis makes its steps."""
        return self._configs[axis]

    def preset(self, axis: int, position_units: int) -> None:
        """Declare where an axis is: it stands, its queue is empty, its counter is the nearest whole step."""
        q16 = position_units * self._get(axis, k.MICROSTEPS) << 2
        self._set(axis, k.POSITION_Q16, q16)
        self._set(axis, k.COUNTER, (q16 + k.STEP_Q16 // 2) >> 16)
        self.flush(axis)

    def renumber(self, axis: int, step: int, position_units: int) -> None:
        """Let a step of a standing axis' counter be the one nearest to a position; no step is owed by that."""
        per_unit = self._get(axis, k.MICROSTEPS) << 2
        shift = ((position_units * per_unit + k.STEP_Q16 // 2) >> 16) - step
        self._set(axis, k.COUNTER, self._get(axis, k.COUNTER) + shift)
        self._set(axis, k.POSITION_Q16, self._get(axis, k.POSITION_Q16) + shift * k.STEP_Q16)
        self.flush(axis)

    def running(self, axis: int) -> bool:
        """Whether a segment is being executed, or the event at its end has not been taken yet."""
        return axis in self._running

    def queued(self, axis: int) -> int:
        """Segments waiting behind the running one."""
        count: int = self._cells[axis * k.AXIS_FIELDS + k.QUEUE_COUNT]  # asked for every record: see `_get`
        return count

    def tail_units(self, axis: int) -> int:
        """Where the next segment that is pushed will begin."""
        return self._get(axis, k.TAIL_Q16) // (self._get(axis, k.MICROSTEPS) << 2)

    def tail_velocity(self, axis: int) -> int:
        """The velocity, in 1/64 unit per ms, with which the next segment that is pushed will begin."""
        return self._get(axis, k.TAIL_VELOCITY)

    def delayed_steps(self, axis: int) -> int:
        """Steps that had to wait for the driver's timing since power-up."""
        return self._get(axis, k.DELAYED_STEPS)

    def last_fall_counts(self, axis: int) -> int:
        """When the last pulse placed so far ends; long ago if there is none."""
        return self._get(axis, k.LAST_RISE_COUNTS) + self._get(axis, k.STEPLEN_COUNTS)

    def demand_units(self, axis: int) -> int:
        """The demanded position, to the nearest unit."""
        per_unit = self._get(axis, k.MICROSTEPS) << 2
        return (self._get(axis, k.POSITION_Q16) + per_unit // 2) // per_unit

    def demand_steps(self, axis: int) -> int:
        """The demanded position, to the nearest step of the set mode."""
        return (self._get(axis, k.POSITION_Q16) + k.STEP_Q16 // 2) >> 16

    def counter_steps(self, axis: int) -> int:
        """The step counter, in steps of the set mode."""
        return self._get(axis, k.COUNTER)

    def counter_units(self, axis: int) -> int:
        """Where the steps made so far have brought the motor."""
        return self.counter_steps(axis) * UNITS_PER_FULL_STEP // self._get(axis, k.MICROSTEPS)

    def velocity(self, axis: int) -> int:
        """The demanded velocity in 1/64 unit per ms, truncated towards zero."""
        grouped = self._get(axis, k.IN_GROUP)
        return self._velocity_at(axis, self.group.rate_q16(self.tick) if grouped else k.FULL_RATE_Q16)

    def _velocity_at(self, axis: int, rate_q16: int) -> int:
        rate = self._kernel.demand_rate(self._axes, axis) * rate_q16
        per_segment = self._get(axis, k.DURATION_TICKS) * self._get(axis, k.MICROSTEPS) * k.FULL_RATE_Q16
        return _truncated(rate * VELOCITY_PER_UNIT_PER_MS, per_segment) if rate else 0

    # --- segments in

    def push(self, axis: int, displacement_units: int, end_velocity: int, duration_ms: int) -> Refusal:
        """Queue one segment, in the PVT record's units."""
        return self.push_ticks(axis, displacement_units, end_velocity, duration_ms * k.TICKS_PER_MS)

    def push_ticks(self, axis: int, displacement_units: int, end_velocity: int, duration_ticks: int) -> Refusal:
        """Queue one segment that lasts so many servo ticks."""
        answer = self._kernel.push(self._axes, self._queue, axis, displacement_units, end_velocity, duration_ticks)
        return Refusal(answer) if answer else Refusal.ACCEPTED

    def start(self, axis: int, *, in_group: bool = False) -> bool:
        """Begin with the oldest queued segment in the next tick, in the group's time or not; False if there is none."""
        if not self._kernel.next_segment(self._axes, self._queue, axis):
            return False
        self._running.add(axis)
        self.starts += 1
        self._set(axis, k.IN_GROUP, int(in_group))
        if in_group:
            self.group.members.add(axis)
        return True

    def drop_queued(self, axis: int) -> None:
        """Drop what waits behind the running segment: what is queued next continues from that one's end."""
        if not self.running(axis):
            self.flush(axis)
            return
        end = sum(self._get(axis, field) for field in _SEGMENT_END_TERMS)
        self._set(axis, k.QUEUE_COUNT, 0)
        self._set(axis, k.TAIL_Q16, end)
        self._set(axis, k.TAIL_VELOCITY, self._get(axis, k.END_VELOCITY))

    def flush(self, axis: int) -> None:
        """Drop the running segment and the queue: no more steps; what is queued next starts, at rest, at the demand."""
        self._rest_tail(axis, 0)
        for field in (k.RUNNING, k.COEFFICIENT_A, k.COEFFICIENT_B, k.COEFFICIENT_C):
            self._set(axis, field, 0)
        self._running.discard(axis)
        self.group.members.discard(axis)
        self.events.pop(axis, None)

    def _rest_tail(self, axis: int, velocity: int) -> None:
        """Empty the queue and let it continue from the present demand, to the nearest unit, with this velocity."""
        self._set(axis, k.QUEUE_COUNT, 0)
        self._set(axis, k.TAIL_Q16, self.demand_units(axis) * self._get(axis, k.MICROSTEPS) << 2)
        self._set(axis, k.TAIL_VELOCITY, velocity)

    def stop(self, axis: int, duration_ms: int) -> None:
        """Replace all that is queued by a ramp to rest of constant deceleration along the present velocity.

        The ramp is never refused for its speed. Only where it would leave the range of an i32 position does the axis
        stop dead instead: it is not running then.
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

    # --- halt and resume

    def halted(self, axis: int) -> bool:
        """Whether an axis rests within its segments because its group is halted; not before its event is taken."""
        return axis in self.group.members and self.group.resting(self.tick) and axis not in self.events

    def ramp_group(self, decelerations_units_per_s2: Sequence[int]) -> None:
        """Halt the group or let it go on, as is wanted, from the next tick on; the limits are those of all axes.

        Where no axis is to move at this point of the path, the rate may change at once: v dr/dt is 0.
        """
        moves = any(self._velocity_at(axis, k.FULL_RATE_Q16) for axis in self.group.members)
        self.group.ramp(self.tick, self._ramp_ticks(decelerations_units_per_s2) if moves else 0)

    def _ramp_ticks(self, decelerations_units_per_s2: Sequence[int]) -> int:
        """The shortest ramp between full rate and 0 that keeps |v dr/dt| within every axis' deceleration, T = |v| / D.

        It covers at most T/2 of trajectory time; v is bounded by the velocity hulls of the segments there, as far as
        they are queued. Like a stop it lasts STOP_MAX_MS at most.
        """
        needed, ticks = 1, 0
        while needed > ticks:
            ticks = needed
            for axis in self.group.members:
                velocity = self._fastest_units_per_s(axis, ticks // 2 + 1)
                needed = max(needed, -(-velocity * TICKS_PER_SECOND // decelerations_units_per_s2[axis]))
            needed = min(needed, STOP_MAX_MS * k.TICKS_PER_MS)
        return ticks

    def _fastest_units_per_s(self, axis: int, ahead_ticks: int) -> int:
        """A bound on the planned speed so far ahead: the Bernstein coefficients of the segments' velocities."""
        left_ticks = ahead_ticks + (self._get(axis, k.ELAPSED_Q16) >> 16)
        fastest = 0
        for a, b, c, duration_ticks in self._segments(axis):
            if left_ticks <= 0:
                break
            rate_q16 = max(abs(a), abs(a + b), abs(a + 2 * b + 3 * c))
            per_unit = (self._get(axis, k.MICROSTEPS) << 2) * duration_ticks
            fastest = max(fastest, -(-rate_q16 * TICKS_PER_SECOND // per_unit))
            left_ticks -= duration_ticks
        return fastest

    def _segments(self, axis: int) -> Iterator[list[int]]:
        """Coefficients and duration in ticks of the running segment and of those queued behind it."""
        fields = (k.COEFFICIENT_A, k.COEFFICIENT_B, k.COEFFICIENT_C, k.DURATION_TICKS)
        yield [self._get(axis, field) for field in fields]
        fields = (k.SEGMENT_A, k.SEGMENT_B, k.SEGMENT_C, k.SEGMENT_TICKS)
        for i in range(self.queued(axis)):
            slot = (self._get(axis, k.QUEUE_HEAD) + i) % k.QUEUE_DEPTH
            entry = (axis * k.QUEUE_DEPTH + slot) * k.SEGMENT_FIELDS
            yield [int(self._queue[entry + field]) for field in fields]

    # --- time forward, edges and events out

    @property
    def room_ticks(self) -> int:
        """Ticks of motion whose edges are sure to fit before `take_edges` must be called."""
        return self._free_edges // self._edges_per_tick

    def advance(self, until_tick: int) -> int:
        """Compute up to the start of `until_tick`; return the tick reached.

        That is less if an axis asks for attention (see `take_events`) or if the edges need draining
        (`room_ticks` is 0).
        """
        if not self._running:
            self.tick = until_tick
            return until_tick
        until = min(until_tick, self.tick + self.room_ticks)
        rest_tick = self.group.rest_tick
        if rest_tick is not None and self.tick < rest_tick < until:
            until = rest_tick
        reached, asking = self._kernel.advance(
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
                self.events.setdefault(axis, Event.HALTED)
        return reached

    def _note_events(self) -> None:
        for axis in sorted(self._running):
            event = self._get(axis, k.EVENT)
            if event != k.EVENT_NONE:
                self.events[axis] = Event(event)
                self._set(axis, k.EVENT, k.EVENT_NONE)

    def take_events(self) -> list[tuple[int, Event]]:
        """Return what the axes ask attention for, each once; the axes named stand still or must be stopped."""
        events, self.events = list(self.events.items()), {}
        ended = {axis for axis, event in events if event in (Event.FINISHED, Event.UNDERRUN)}
        self._running -= ended
        self.group.members -= ended
        return events

    def undrained_pulses(self, axis: int) -> int:
        """How many pulses have been placed since the last drain."""
        return self._get(axis, k.CLK_EDGES) // 2

    def take_edges(self) -> tuple[PinEdges, ...]:
        """Hand out all edges placed since the last call and make room for new ones."""
        edges = []
        for axis in range(self.axis_count):
            clk_edges, dir_edges = self._get(axis, k.CLK_EDGES), self._get(axis, k.DIR_EDGES)
            edges.append(PinEdges(self._clk[axis][:clk_edges].copy(), self._direction[axis][:dir_edges].copy()))
            self._set(axis, k.CLK_EDGES, 0)
            self._set(axis, k.DIR_EDGES, 0)
        self._free_edges = EDGE_CAPACITY
        return tuple(edges)


def _edges_per_tick(configs: list[StepConfig]) -> int:
    """An upper bound for the edges of one pin in a tick: the fastest axis' steps, and one more on either side."""
    fastest = max(config.rate_limit_q16_per_ms for config in configs)
    return 2 * ((fastest >> 16) // k.TICKS_PER_MS + 2)


def stop_segments(velocity: int, duration_ms: int) -> list[tuple[int, int, int]]:
    """The ramp from `velocity` (1/64 unit per ms) to rest as PVT segments (displacement, end velocity, duration).

    After t of T ms the velocity is v (1 - t/T) and the distance v (T^2 - (T-t)^2) / 2T; displacements are differences
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
    """Quotient towards zero, as C divides; the denominator is positive."""
    return numerator // denominator if numerator >= 0 else -(-numerator // denominator)
