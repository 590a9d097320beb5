"""The motion kernel: queued cubic segments in, CLK and DIR edges out, integers throughout.

Once per servo tick (250 us) every running axis evaluates its cubic Hermite segment in Q16 steps,

    p(s) = p0 + ((c s + b) s + a) s,    s = (i << 30) // n,    i of n ticks,

and places the steps of that tick on the chord between two evaluations: the counter goes up when p reaches
counter + H and down when it reaches counter - H, with H = 1/2 + 1/16 step of hysteresis.

The functions here are an integer subset of Python over flat, indexable storage, the way the C of a Cortex-M3 would
be written. Run as they stand, on lists, they are the reference: unbounded integers would show any overflow. Compiled
by numba on int64 arrays (see `backend`) they give the same bits. `axes` holds AXIS_FIELDS integers for each axis,
`queue` QUEUE_DEPTH entries of SEGMENT_FIELDS for each axis, `clk` and `direction` one row of edges for each axis.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])


def _decorator() -> Callable[[Function], Function]:
    """With the extra `fast`, numba compiles a kernel function into those that call it; it stays plain Python too."""
    try:
        from numba.extending import register_jitable
    except ImportError:
        return lambda function: function
    return cast("Callable[[Function], Function]", register_jitable)


kernel_function = _decorator()


TICK_COUNTS = 18_000
"""One servo tick: 250 us of the 72 MHz timer; compare values 0..17 999 fit a 16-bit timer."""
TICKS_PER_MS = 4

STEP_Q16 = 1 << 16
THRESHOLD_Q16 = STEP_Q16 // 2 + STEP_Q16 // 16
"""H: how far the demand leaves the counter before a step is made; the sixteenth keeps noise from chattering."""

QUEUE_DEPTH = 64
DURATION_MAX_MS = 255
I32_MAX = (1 << 31) - 1
NEVER_COUNTS = -(1 << 62)
"""The time of an edge that has not happened yet."""

# Fields of one axis in `axes`: its configuration, ...
MICROSTEPS = 0
STEPLEN_COUNTS = 1
STEPSPACE_COUNTS = 2
DIRSETUP_COUNTS = 3
DIRHOLD_COUNTS = 4
RATE_LIMIT_Q16_PER_MS = 5
# ... its motion, ...
RUNNING = 6
COUNTER = 7
POSITION_Q16 = 8
START_Q16 = 9
COEFFICIENT_A = 10
COEFFICIENT_B = 11
COEFFICIENT_C = 12
DURATION_TICKS = 13
ELAPSED_TICKS = 14
END_VELOCITY = 15
# ... its queue, whose tail is where the next segment starts, ...
QUEUE_HEAD = 16
QUEUE_COUNT = 17
TAIL_Q16 = 18
TAIL_VELOCITY = 19
# ... its pins, ...
EARLIEST_RISE_COUNTS = 20
LAST_RISE_COUNTS = 21
DIR_LEVEL = 22
# ... and what it reports.
EVENT = 23
DELAYED_STEPS = 24
CLK_EDGES = 25
DIR_EDGES = 26
AXIS_FIELDS = 27

# Fields of one queued segment.
SEGMENT_START_Q16 = 0
SEGMENT_A = 1
SEGMENT_B = 2
SEGMENT_C = 3
SEGMENT_TICKS = 4
SEGMENT_END_VELOCITY = 5
SEGMENT_FIELDS = 6

# What can ask for the firmware's attention in a tick.
EVENT_NONE = 0
EVENT_FINISHED = 1
EVENT_UNDERRUN = 2
EVENT_LATE_STEP = 3

# Why a segment is refused.
ACCEPTED = 0
REFUSED_QUEUE_FULL = 1
REFUSED_DURATION = 2
REFUSED_COEFFICIENT = 3
REFUSED_TOO_FAST = 4
REFUSED_POSITION = 5

Cells = Any
"""list[int] or an int64 array: what the kernel's functions index."""
Rows = Any
"""list[list[int]] or a two-dimensional int64 array."""


@kernel_function
def push(axes: Cells, queue: Cells, axis: int, displacement_units: int, end_velocity: int, duration_ms: int) -> int:
    """Queue the cubic from the tail of the queue to the tail + displacement; return why not, or ACCEPTED.

    Displacement in wire units (1/16 384 full step), end velocity in 1/64 unit per ms. With D the displacement,
    a = v0 dt and e = v1 dt, all in Q16 steps: b = 3D - 2a - e, c = a + e - 2D. The velocity is a quadratic whose
    Bernstein coefficients are a, 3D - a - e and e (over dt), so these three bound the step rate; with them inside
    i32 every intermediate of the evaluation is too. A refused segment leaves everything as it was.
    """
    base = axis * AXIS_FIELDS
    count = axes[base + QUEUE_COUNT]
    if count >= QUEUE_DEPTH:
        return REFUSED_QUEUE_FULL
    if duration_ms < 1 or duration_ms > DURATION_MAX_MS:
        return REFUSED_DURATION
    microsteps = axes[base + MICROSTEPS]
    distance = displacement_units * microsteps << 2
    a = (axes[base + TAIL_VELOCITY] * duration_ms * microsteps + 8) >> 4
    e = (end_velocity * duration_ms * microsteps + 8) >> 4
    middle = 3 * distance - a - e
    b = middle - a
    c = a + e - 2 * distance
    fastest = max(abs(a), abs(middle), abs(e))
    if max(fastest, abs(b), abs(c), abs(distance), abs(distance - a)) > I32_MAX:
        return REFUSED_COEFFICIENT
    if fastest > axes[base + RATE_LIMIT_Q16_PER_MS] * duration_ms:
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
    queue[entry + SEGMENT_TICKS] = duration_ms * TICKS_PER_MS
    queue[entry + SEGMENT_END_VELOCITY] = end_velocity
    axes[base + QUEUE_COUNT] = count + 1
    axes[base + TAIL_Q16] = tail + distance
    axes[base + TAIL_VELOCITY] = end_velocity
    return ACCEPTED


@kernel_function
def next_segment(axes: Cells, queue: Cells, axis: int) -> bool:
    """Take the oldest segment off the queue and make it the running one; False when there is none."""
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
    axes[base + ELAPSED_TICKS] = 0
    axes[base + QUEUE_HEAD] = (head + 1) % QUEUE_DEPTH
    axes[base + QUEUE_COUNT] = count - 1
    axes[base + RUNNING] = 1
    return True


@kernel_function
def place_steps(axes: Cells, clk: Cells, direction: Cells, base: int, tick_counts: int, p_from: int, p_to: int) -> bool:
    """Place the steps of one tick on the chord from p_from to p_to (Q16); False if one is over a tick late.

    The crossings are evenly spaced: the first at (distance to the threshold) * interval, then one interval each. A
    rise waits until the last CLK fall is stepspace old and the last DIR edge dirsetup old; a DIR edge waits until
    the last rise is dirhold old, and at least a count: at the rise itself the driver reads DIR. All four are measured
    from the edges really placed.

    A pulse is longer than all intervals between a tick's crossings or than none. So lateness only grows or only falls
    within a tick, and the worst is the first or the last step's.
    """
    up = 1 if p_to > p_from else 0
    sign = 2 * up - 1
    travel = (p_to - p_from) * sign
    to_threshold = axes[base + COUNTER] * STEP_Q16 * sign + THRESHOLD_Q16 - p_from * sign
    if to_threshold > travel:
        return True
    earliest = axes[base + EARLIEST_RISE_COUNTS]
    if axes[base + DIR_LEVEL] != up:
        edge = max(tick_counts, axes[base + LAST_RISE_COUNTS] + max(axes[base + DIRHOLD_COUNTS], 1))
        earliest = max(earliest, edge + axes[base + DIRSETUP_COUNTS])
        axes[base + DIR_LEVEL] = up
        direction[axes[base + DIR_EDGES]] = 2 * edge + up
        axes[base + DIR_EDGES] += 1
    steps = (travel - to_threshold) // STEP_Q16 + 1
    interval_q16 = (TICK_COUNTS << 32) // travel
    due_q16 = (to_threshold * interval_q16) >> 16
    steplen = axes[base + STEPLEN_COUNTS]
    stepspace = axes[base + STEPSPACE_COUNTS]
    first = axes[base + CLK_EDGES]
    last = first + 2 * steps
    delayed = 0
    rise = 0
    due = 0
    for k in range(first, last, 2):
        due = tick_counts + (due_q16 >> 16)
        rise = max(due, earliest)
        delayed += rise > due
        fall = rise + steplen
        clk[k] = rise
        clk[k + 1] = fall
        earliest = fall + stepspace
        due_q16 += interval_q16
    axes[base + COUNTER] += sign * steps
    axes[base + EARLIEST_RISE_COUNTS] = earliest
    axes[base + LAST_RISE_COUNTS] = rise
    axes[base + CLK_EDGES] = last
    axes[base + DELAYED_STEPS] += delayed
    if delayed == 0:
        return True
    first_due = tick_counts + (to_threshold * interval_q16 >> 32)
    return bool(max(clk[first] - first_due, rise - due) <= TICK_COUNTS)


@kernel_function
def advance_axis(axes: Cells, queue: Cells, clk: Cells, direction: Cells, axis: int, tick: int, until_tick: int) -> int:
    """Run one axis from the start of `tick` to the start of `until_tick`, or until it asks for attention.

    Returns the tick reached; if that is before `until_tick`, EVENT says why.
    """
    base = axis * AXIS_FIELDS
    half = 1 << 29
    while tick < until_tick and axes[base + RUNNING] == 1:
        start = axes[base + START_Q16]
        a = axes[base + COEFFICIENT_A]
        b = axes[base + COEFFICIENT_B]
        c = axes[base + COEFFICIENT_C]
        n = axes[base + DURATION_TICKS]
        i = axes[base + ELAPSED_TICKS]
        p = axes[base + POSITION_Q16]
        stop = min(n, i + until_tick - tick)
        s_per_tick = (1 << 30) // n
        s_remainder_per_tick = (1 << 30) % n
        on_time = True
        if a == 0 and b == 0 and c == 0:  # at rest no edge can fall: the whole segment is one jump
            tick += stop - i
            i = stop
        s = (i << 30) // n
        s_remainder = (i << 30) % n
        while i < stop and on_time:
            i += 1
            s += s_per_tick
            s_remainder += s_remainder_per_tick
            if s_remainder >= n:
                s_remainder -= n
                s += 1
            q = ((c * s + half) >> 30) + b
            q = ((q * s + half) >> 30) + a
            q = start + ((q * s + half) >> 30)
            if q != p:
                on_time = place_steps(axes, clk, direction, base, tick * TICK_COUNTS, p, q)
            p = q
            tick += 1
        axes[base + POSITION_Q16] = p
        axes[base + ELAPSED_TICKS] = i
        if not on_time:
            axes[base + EVENT] = EVENT_LATE_STEP
            return tick
        if i == n and not next_segment(axes, queue, axis):
            axes[base + EVENT] = EVENT_FINISHED if axes[base + END_VELOCITY] == 0 else EVENT_UNDERRUN
            return tick
    return until_tick


@kernel_function
def advance(axes: Cells, queue: Cells, clk: Rows, direction: Rows, axis_count: int, tick: int, until_tick: int) -> int:
    """Run all axes from `tick` to `until_tick` or to the first tick in which one of them asks for attention.

    Returns the tick reached. If that is before `until_tick`, axes may stand beyond it: restore a copy of `axes` taken
    before the call and advance to the tick returned, which then is reached by all of them.
    """
    reached = until_tick
    for axis in range(axis_count):
        reached = advance_axis(axes, queue, clk[axis], direction[axis], axis, tick, reached)
    return reached


@kernel_function
def demand_rate(axes: Cells, axis: int) -> int:
    """Slope of the present segment, or of the last one at its end: a + 2 b s + 3 c s^2 in Q16 steps a duration."""
    base = axis * AXIS_FIELDS
    s = (axes[base + ELAPSED_TICKS] << 30) // axes[base + DURATION_TICKS]
    slope = ((3 * axes[base + COEFFICIENT_C] * s) >> 30) + 2 * axes[base + COEFFICIENT_B]
    return int(((slope * s) >> 30) + axes[base + COEFFICIENT_A])
