"""The motion kernel: turn queued cubic segments into CLK and DIR edges, in integers throughout.

Once per servo tick (250 us) each running axis evaluates its cubic Hermite segment in Q16 steps,

    p(s) = p0 + ((c s + b) s + a) s,    s = (i << 30) // n,    i of n ticks,

and places the steps of that tick on the chord between two evaluations. The counter increases when p reaches
counter + H and decreases when p reaches counter - H, with H = 1/2 + 1/16 step; 1/16 is hysteresis.

The functions use an integer subset of Python and flat, indexable storage, like C code for a Cortex-M3. Plain Python on
lists is the reference: its unbounded integers show any overflow. Compiled by numba on int64 arrays (see `backend`) they
give identical results. `features/kernel_c` contains the same functions in C with fixed-width integers; change them
there, too. Tests compare all results. The storage is

    axes        AXIS_FIELDS integers for each axis,
    queue       QUEUE_DEPTH entries of SEGMENT_FIELDS integers for each axis,
    group       the GROUP_FIELDS integers of the axes that halt together,
    clk         one row of CLK edges for each axis: rise, fall, rise, fall ... in timer counts,
    direction   one row of DIR edges for each axis: 2 * counts + level.

A halt slows the trajectory time, not the axes. In each tick the axes of the group advance i by the group's rate instead
of 1. The rate ramps linearly to 0 and back, or to another rate up to HIGHEST_RATE_Q16. It depends on the tick only, and
i is in Q16 ticks, so the axes stay exactly synchronous and on the planned path.
"""

from collections.abc import Callable
from typing import Any, Final, TypeAlias, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])


kernel_functions: list[Callable[..., Any]] = []
"""Marked functions that are not registered with numba yet (see `backend`)."""


def _marked(function: Function) -> Function:
    """Mark a function that numba (extra `fast`) inlines into its callers. It also stays a plain Python function."""
    kernel_functions.append(function)
    return function


kernel_function = _marked


TICK_COUNTS: Final = 18_000
"""One servo tick: 250 us of the 72 MHz timer; compare values 0..17 999 fit a 16-bit timer."""
TICKS_PER_MS: Final = 4

STEP_Q16: Final = 1 << 16
THRESHOLD_Q16: Final = STEP_Q16 // 2 + STEP_Q16 // 16
"""H: distance between counter and demand that triggers a step. The 1/16 is hysteresis against chatter."""

ROUNDING_Q16: Final = 4
"""Upper bound of the total error of the three rounding shifts in one evaluation."""

FULL_RATE_Q16: Final = 1 << 16
"""Rate at which trajectory time equals real time: one tick per tick."""
HIGHEST_RATE_Q16: Final = FULL_RATE_Q16 * 3 // 2
"""Highest rate. Because a group's segment lasts at least two ticks, at most one ends within a tick."""

QUEUE_DEPTH: Final = 64
DURATION_MAX_MS: Final = 255
I32_MAX: Final = (1 << 31) - 1
NEVER_COUNTS: Final = -(1 << 62)
"""Time of an edge that has not occurred yet."""
NEVER_TICK: Final = 1 << 62
"""A tick that never comes."""

# Fields of one axis in `axes`: its configuration,
MICROSTEPS: Final = 0
STEPLEN_COUNTS: Final = 1
STEPSPACE_COUNTS: Final = 2
DIRSETUP_COUNTS: Final = 3
DIRHOLD_COUNTS: Final = 4
RATE_LIMIT_Q16_PER_MS: Final = 5
DIR_INVERTED: Final = 6
# its motion,
RUNNING: Final = 7
COUNTER: Final = 8
POSITION_Q16: Final = 9
START_Q16: Final = 10
COEFFICIENT_A: Final = 11
COEFFICIENT_B: Final = 12
COEFFICIENT_C: Final = 13
DURATION_TICKS: Final = 14
ELAPSED_Q16: Final = 15
END_VELOCITY: Final = 16
IN_GROUP: Final = 17
# its queue, whose tail is where the next segment starts,
QUEUE_HEAD: Final = 18
QUEUE_COUNT: Final = 19
TAIL_Q16: Final = 20
TAIL_VELOCITY: Final = 21
# its pins,
EARLIEST_RISE_COUNTS: Final = 22
LAST_RISE_COUNTS: Final = 23
DIR_LEVEL: Final = 24
# and its reports.
EVENT: Final = 25
DELAYED_STEPS: Final = 26
CLK_EDGES: Final = 27
DIR_EDGES: Final = 28
AXIS_FIELDS: Final = 29

# The group's time: a ramp of its rate, which begins at the start of RAMP_TICK and lasts RAMP_TICKS.
RATE_FROM_Q16: Final = 0
RATE_TO_Q16: Final = 1
RAMP_TICK: Final = 2
RAMP_TICKS: Final = 3
GROUP_FIELDS: Final = 4

# Fields of one queued segment.
SEGMENT_START_Q16: Final = 0
SEGMENT_A: Final = 1
SEGMENT_B: Final = 2
SEGMENT_C: Final = 3
SEGMENT_TICKS: Final = 4
SEGMENT_END_VELOCITY: Final = 5
SEGMENT_FIELDS: Final = 6

# Why an axis needs the firmware's attention in a tick.
EVENT_NONE: Final = 0
EVENT_FINISHED: Final = 1
EVENT_UNDERRUN: Final = 2
EVENT_LATE_STEP: Final = 3

# Why a segment is refused.
ACCEPTED: Final = 0
REFUSED_QUEUE_FULL: Final = 1
REFUSED_DURATION: Final = 2
REFUSED_COEFFICIENT: Final = 3
REFUSED_TOO_FAST: Final = 4
REFUSED_POSITION: Final = 5

Cells: TypeAlias = Any
"""list[int] or an int64 array."""
Rows: TypeAlias = Any
"""list[list[int]] or a two-dimensional int64 array."""


@kernel_function
def distance_q16(velocity: int, duration_ticks: int, microsteps: int) -> int:
    """Return the distance at a velocity in 1/64 unit per ms, in Q16 steps; rounded once."""
    return (velocity * duration_ticks * microsteps + 32) >> 6


@kernel_function
def push(axes: Cells, queue: Cells, axis: int, displacement_units: int, end_velocity: int, duration_ticks: int) -> int:
    """Queue the cubic from the queue's tail to tail + displacement; return ACCEPTED or the reason of the refusal.

    The displacement is in wire units (1/16 384 full step), the end velocity in 1/64 unit per ms. With D the
    displacement, a = v0 dt and e = v1 dt, all in Q16 steps: b = 3D - 2a - e, c = a + e - 2D. The velocity is a
    quadratic with the Bernstein coefficients a, 3D - a - e and e (over dt), so these three bound the step rate. With
    all values checked below inside i32, every intermediate of the evaluation is inside i32 too. A refused segment
    changes nothing.
    """
    base = axis * AXIS_FIELDS
    count = axes[base + QUEUE_COUNT]
    if count >= QUEUE_DEPTH:
        return REFUSED_QUEUE_FULL
    if duration_ticks < 1 or duration_ticks > DURATION_MAX_MS * TICKS_PER_MS:
        return REFUSED_DURATION
    microsteps = axes[base + MICROSTEPS]
    distance = displacement_units * microsteps << 2
    a = distance_q16(axes[base + TAIL_VELOCITY], duration_ticks, microsteps)
    e = distance_q16(end_velocity, duration_ticks, microsteps)
    middle = 3 * distance - a - e
    b = middle - a
    c = a + e - 2 * distance
    fastest = max(abs(a), abs(middle), abs(e))
    if max(fastest, abs(b), abs(c), abs(distance), abs(distance - a)) > I32_MAX:
        return REFUSED_COEFFICIENT
    if fastest * TICKS_PER_MS > axes[base + RATE_LIMIT_Q16_PER_MS] * duration_ticks:
        return REFUSED_TOO_FAST
    tail = axes[base + TAIL_Q16]
    if abs(tail + distance) > I32_MAX * microsteps << 2:
        return REFUSED_POSITION
    slot = (axes[base + QUEUE_HEAD] + count) % QUEUE_DEPTH
    entry = (axis * QUEUE_DEPTH + slot) * SEGMENT_FIELDS
    queue[entry + SEGMENT_START_Q16] = tail
    queue[entry + SEGMENT_A] = a
    queue[entry + SEGMENT_B] = b
    queue[entry + SEGMENT_C] = c
    queue[entry + SEGMENT_TICKS] = duration_ticks
    queue[entry + SEGMENT_END_VELOCITY] = end_velocity
    axes[base + QUEUE_COUNT] = count + 1
    axes[base + TAIL_Q16] = tail + distance
    axes[base + TAIL_VELOCITY] = end_velocity
    return ACCEPTED


@kernel_function
def next_segment(axes: Cells, queue: Cells, axis: int) -> bool:
    """Take the oldest segment off the queue and make it the running one; return False if there is none."""
    base = axis * AXIS_FIELDS
    count = axes[base + QUEUE_COUNT]
    if count == 0:
        axes[base + RUNNING] = 0
        return False
    head = axes[base + QUEUE_HEAD]
    entry = (axis * QUEUE_DEPTH + head) * SEGMENT_FIELDS
    axes[base + START_Q16] = queue[entry + SEGMENT_START_Q16]
    axes[base + COEFFICIENT_A] = queue[entry + SEGMENT_A]
    axes[base + COEFFICIENT_B] = queue[entry + SEGMENT_B]
    axes[base + COEFFICIENT_C] = queue[entry + SEGMENT_C]
    axes[base + DURATION_TICKS] = queue[entry + SEGMENT_TICKS]
    axes[base + END_VELOCITY] = queue[entry + SEGMENT_END_VELOCITY]
    axes[base + ELAPSED_Q16] = 0
    axes[base + QUEUE_HEAD] = (head + 1) % QUEUE_DEPTH
    axes[base + QUEUE_COUNT] = count - 1
    axes[base + RUNNING] = 1
    return True


@kernel_function
def place_steps(
    axes: Cells, clk: Cells, direction: Cells, base: int, tick_counts: int, travel: int, to_threshold: int, up: int
) -> bool:
    """Place the steps of one tick, all upwards (`up` 1) or downwards (0); return False if one is over a tick late.

    The chord is `travel` long and crosses the first threshold after `to_threshold` (Q16 steps). The crossings are
    evenly spaced: the first at to_threshold * interval, each further one an interval later. A rise waits until
    stepspace after the last CLK fall and dirsetup after the last DIR edge. A DIR edge waits until dirhold after the
    last rise, at least one count, because the driver reads DIR at the rise. All times count from the placed edges.
    """
    # `travel` is never negative; testing for it lets the compiler divide unsigned.
    if travel <= 0 or to_threshold > travel:
        return True
    earliest = axes[base + EARLIEST_RISE_COUNTS]
    level = up ^ axes[base + DIR_INVERTED]
    if axes[base + DIR_LEVEL] != level:
        edge = max(tick_counts, axes[base + LAST_RISE_COUNTS] + max(axes[base + DIRHOLD_COUNTS], 1))
        earliest = max(earliest, edge + axes[base + DIRSETUP_COUNTS])
        axes[base + DIR_LEVEL] = level
        direction[axes[base + DIR_EDGES]] = 2 * edge + level
        axes[base + DIR_EDGES] += 1
    steps = (travel - to_threshold) // STEP_Q16 + 1
    interval_q16 = (TICK_COUNTS << 32) // travel
    due_q16 = to_threshold * interval_q16 >> 16  # at most one tick, because the threshold is on the chord
    steplen = axes[base + STEPLEN_COUNTS]
    pulse = steplen + axes[base + STEPSPACE_COUNTS]
    first = axes[base + CLK_EDGES] & I32_MAX  # the mask shows that it is not negative: the loop is then vectorised
    last = first + 2 * steps
    axes[base + COUNTER] += steps if up else -steps
    axes[base + CLK_EDGES] = last
    rise = tick_counts + (due_q16 >> 16)
    if earliest > rise or pulse > interval_q16 >> 16:
        return place_waiting_steps(axes, clk, base, first, last, tick_counts, due_q16, interval_q16, earliest)
    # The first step does not wait, and the steps are at least one pulse apart: all are placed at their due times.
    for k in range(first, last, 2):
        rise = tick_counts + (due_q16 >> 16)
        clk[k] = rise
        clk[k + 1] = rise + steplen
        due_q16 += interval_q16
    axes[base + LAST_RISE_COUNTS] = rise
    axes[base + EARLIEST_RISE_COUNTS] = rise + pulse
    return True


@kernel_function
def place_waiting_steps(
    axes: Cells,
    clk: Cells,
    base: int,
    first: int,
    last: int,
    tick_counts: int,
    due_q16: int,
    interval_q16: int,
    earliest: int,
) -> bool:
    """Place the edges first .. last - 1: each step at its due time, or later when the driver accepts it.

    Return False if a step is over a tick late. The crossings of a tick are equally spaced. If a pulse is longer than
    their interval, the delay grows from step to step; if not, it shrinks. So the first or the last step has the longest
    delay.
    """
    steplen = axes[base + STEPLEN_COUNTS]
    pulse = steplen + axes[base + STEPSPACE_COUNTS]
    first_due = tick_counts + (due_q16 >> 16)
    first_late = max(earliest - first_due, 0)
    due = 0
    rise = 0
    delayed = 0
    for k in range(first, last, 2):
        due = tick_counts + (due_q16 >> 16)
        rise = max(due, earliest)
        delayed += rise > due
        clk[k] = rise
        clk[k + 1] = rise + steplen
        earliest = rise + pulse
        due_q16 += interval_q16
    axes[base + LAST_RISE_COUNTS] = rise
    axes[base + EARLIEST_RISE_COUNTS] = earliest
    axes[base + DELAYED_STEPS] += delayed
    return bool(max(first_late, rise - due) <= TICK_COUNTS)


@kernel_function
def group_time_q16(group: Cells, tick: int) -> int:
    """Return the trajectory time from the start of the group's ramp to the start of `tick`, in Q16 ticks.

    After j of the ramp's K ticks it is r0 j + (r1 - r0) j^2 / 2K, rounded down; then it grows by r1 a tick. So a ramp
    covers (r0 + r1) K / 2. Between full rate and 0, with an even number of ticks, that is a whole number of ticks.
    """
    since = tick - group[RAMP_TICK]
    ramped = min(since, group[RAMP_TICKS])
    time_q16 = group[RATE_FROM_Q16] * ramped + group[RATE_TO_Q16] * (since - ramped)
    if ramped > 0:
        time_q16 += (group[RATE_TO_Q16] - group[RATE_FROM_Q16]) * ramped * ramped // (2 * group[RAMP_TICKS])
    return int(time_q16)


@kernel_function
def makes_no_step(start: int, a: int, b: int, c: int) -> bool:
    """Return whether a segment that starts at this distance from the counter certainly reaches no threshold.

    A cubic stays within its Bernstein coefficients: start, start + a/3, end - e/3 and end, with e = a + 2b + 3c. All
    values are multiplied by three to avoid the division.
    """
    end = 3 * (start + a + b + c)
    farthest = max(abs(3 * start), abs(3 * start + a), abs(end - a - 2 * b - 3 * c), abs(end))
    return bool(farthest < 3 * (THRESHOLD_Q16 - ROUNDING_Q16))


@kernel_function
def run_ticks(axes: Cells, clk: Cells, direction: Cells, base: int, tick: int, until_tick: int, rate_q16: int) -> int:
    """Evaluate the segment at the end of each tick and place the steps, up to `until_tick` or a late step.

    Trajectory time advances by `rate_q16` per tick, so (i << 30) // n is updated by additions: quotient and remainder
    are carried from tick to tick. Trajectory time is negative if the segment begins within the tick. Return the tick
    reached; EVENT reports a late step.
    """
    half = 1 << 29
    start = axes[base + START_Q16]
    a = axes[base + COEFFICIENT_A]
    b = axes[base + COEFFICIENT_B]
    c = axes[base + COEFFICIENT_C]
    n = axes[base + DURATION_TICKS]
    p = axes[base + POSITION_Q16]
    elapsed_q16 = axes[base + ELAPSED_Q16]
    from_tick = tick
    s_per_tick = (rate_q16 << 14) // n
    s_remainder_per_tick = (rate_q16 << 14) - s_per_tick * n
    on_time = True
    if until_tick - tick > 1 and makes_no_step(start - axes[base + COUNTER] * STEP_Q16, a, b, c):
        # Only the position at the end is needed: skip to the last tick.
        tick = max(tick, until_tick - 1)
    since_q16 = elapsed_q16 + (tick - from_tick) * rate_q16
    s = (since_q16 << 14) // n
    s_remainder = (since_q16 << 14) - s * n
    while tick < until_tick and on_time:
        s += s_per_tick
        s_remainder += s_remainder_per_tick
        if s_remainder >= n:
            s_remainder -= n
            s += 1
        chord = ((c * s + half) >> 30) + b
        chord = ((chord * s + half) >> 30) + a
        q = start + ((chord * s + half) >> 30)
        # One call for each direction: the compiler inlines two versions, which are faster by a sixth.
        counter_q16 = axes[base + COUNTER] * STEP_Q16
        tick_counts = tick * TICK_COUNTS
        if q - counter_q16 >= THRESHOLD_Q16:
            to_threshold = counter_q16 + THRESHOLD_Q16 - p
            on_time = place_steps(axes, clk, direction, base, tick_counts, q - p, to_threshold, 1)
        elif counter_q16 - q >= THRESHOLD_Q16:
            to_threshold = p + THRESHOLD_Q16 - counter_q16
            on_time = place_steps(axes, clk, direction, base, tick_counts, p - q, to_threshold, 0)
        p = q
        tick += 1
    axes[base + POSITION_Q16] = p
    axes[base + ELAPSED_Q16] = elapsed_q16 + (tick - from_tick) * rate_q16
    if not on_time:
        axes[base + EVENT] = EVENT_LATE_STEP
    return tick


@kernel_function
def full_rate_from(axes: Cells, group: Cells, axis: int, tick: int) -> int:
    """Return the first tick, at or after `tick`, from which an axis' trajectory time runs at full rate."""
    if axes[axis * AXIS_FIELDS + IN_GROUP] == 0:
        return tick
    if group[RATE_TO_Q16] != FULL_RATE_Q16:
        return NEVER_TICK
    return int(max(tick, group[RAMP_TICK] + group[RAMP_TICKS]))


@kernel_function
def advance_axis(
    axes: Cells, queue: Cells, group: Cells, clk: Cells, direction: Cells, axis: int, tick: int, until_tick: int
) -> int:
    """Run one axis from the start of `tick` to the start of `until_tick`, or until it needs attention.

    Return the tick reached; if it is before `until_tick`, EVENT gives the reason. At full rate all whole ticks of a
    segment run in one call. A tick at another rate runs alone, and so does a tick in which a segment ends: the rest of
    the tick belongs to the next segment, or the axis stops if there is none.
    """
    base = axis * AXIS_FIELDS
    if axes[base + RUNNING] == 1:
        axes[base + EVENT] = EVENT_NONE
    full_from = full_rate_from(axes, group, axis, tick)
    while tick < until_tick and axes[base + RUNNING] == 1:
        left_q16 = (axes[base + DURATION_TICKS] << 16) - axes[base + ELAPSED_Q16]
        rate_q16 = FULL_RATE_Q16
        ticks = max(left_q16 >> 16, 1)
        if tick < full_from:
            rate_q16 = group_time_q16(group, tick + 1) - group_time_q16(group, tick)
            ticks = 1
            if rate_q16 == 0 and tick >= group[RAMP_TICK] + group[RAMP_TICKS]:
                return until_tick  # the group has halted
        if left_q16 < rate_q16:
            if next_segment(axes, queue, axis):
                axes[base + ELAPSED_Q16] = -left_q16  # it begins within the tick
            else:
                rate_q16 = left_q16  # to the segment's very end
        tick = run_ticks(axes, clk, direction, base, tick, min(tick + ticks, until_tick), rate_q16)
        if axes[base + ELAPSED_Q16] == axes[base + DURATION_TICKS] << 16 and not next_segment(axes, queue, axis):
            if axes[base + EVENT] == EVENT_NONE:  # a late step has priority: the firmware stops for it anyway
                axes[base + EVENT] = EVENT_FINISHED if axes[base + END_VELOCITY] == 0 else EVENT_UNDERRUN
            return tick
        if axes[base + EVENT] != EVENT_NONE:
            return tick
    return until_tick


@kernel_function
def advance(
    axes: Cells,
    before: Cells,
    queue: Cells,
    group: Cells,
    clk: Rows,
    direction: Rows,
    axis_count: int,
    tick: int,
    until_tick: int,
) -> tuple[int, int]:
    """Run all axes from `tick` to `until_tick`, or to the first tick at which one of them needs attention.

    The group's ramp must not begin after `tick`. `before` is as long as `axes` and is overwritten. Return the tick
    reached, which is after `tick`, and the number of axes that need attention there; their EVENT gives the reason.
    """
    if until_tick - tick > 1:  # within one tick no axis can run too far
        before[:] = axes
    reached = until_tick
    for axis in range(axis_count):
        reached = advance_axis(axes, queue, group, clk[axis], direction[axis], axis, tick, reached)
    if reached < until_tick:  # axes run one after the other, and some have run too far: repeat up to the common tick
        axes[:] = before
        for axis in range(axis_count):
            advance_axis(axes, queue, group, clk[axis], direction[axis], axis, tick, reached)
    asking = 0
    for axis in range(axis_count):
        asking += axes[axis * AXIS_FIELDS + EVENT] != EVENT_NONE
    return reached, asking


@kernel_function
def demand_rate(axes: Cells, axis: int) -> int:
    """Return the slope of the present segment, or of the last one at its end, in Q16 steps per duration.

    It is a + 2 b s + 3 c s^2 at full rate; the caller scales it by the group's rate.
    """
    base = axis * AXIS_FIELDS
    s = (axes[base + ELAPSED_Q16] << 14) // axes[base + DURATION_TICKS]
    slope = ((3 * axes[base + COEFFICIENT_C] * s) >> 30) + 2 * axes[base + COEFFICIENT_B]
    return int(((slope * s) >> 30) + axes[base + COEFFICIENT_A])
