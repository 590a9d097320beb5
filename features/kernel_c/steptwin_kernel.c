/* The motion kernel: what it does and the ranges of its storage are in the header. */
#include "steptwin_kernel.h"

#include <stddef.h>

/* As in <string.h>, which a core without a C library does not have. */
void *memcpy(void *restrict target, const void *restrict source, size_t size);

/*
 * Bounds that the arithmetic relies on: as long as they hold, no operation overflows its type. They cost nothing unless
 * a build defines ST_ASSERT, as StepTwin's tests do. ST_ASSERT_BITS is for values that fit so many bits with their sign.
 */
#ifndef ST_ASSERT
#define ST_ASSERT(holds) ((void)sizeof(holds))
#endif
#define ST_ASSERT_BITS(value, bits) \
    ST_ASSERT((value) >= -(INT64_C(1) << ((bits) - 1)) && (value) < INT64_C(1) << ((bits) - 1))

_Static_assert((-1 >> 1) == -1 && (INT64_C(-1) >> 1) == -1, "shifts of negative numbers must keep the sign");
_Static_assert(sizeof(st_axis) == 112 && sizeof(st_segment) == 32 && sizeof(st_group) == 24, "layout of the storage");
_Static_assert(ST_QUEUE_DEPTH <= 64 && (ST_QUEUE_DEPTH & (ST_QUEUE_DEPTH - 1)) == 0, "size of the queue");

static inline int64_t min_64(int64_t x, int64_t y)
{
    return x < y ? x : y;
}

static inline int64_t max_64(int64_t x, int64_t y)
{
    return x > y ? x : y;
}

static inline int64_t abs_64(int64_t x)
{
    return x < 0 ? -x : x;
}

/* Narrow a value that fits 32 bits. */
static inline int32_t to_32(int64_t value)
{
    ST_ASSERT_BITS(value, 32);
    return (int32_t)value;
}

/*
 * Divide 64 bits by 32, rounded down. A Cortex-M3 divides only 32 bits at once, and its library takes hundreds of
 * cycles for 64. A divisor below 2^20 leaves 12 bits of room above each remainder, so that three steps divide the low
 * word.
 */
static uint64_t divide(uint64_t numerator, uint32_t divisor)
{
    const uint32_t low = (uint32_t)numerator;
    const uint32_t high = (uint32_t)(numerator >> 32);
    const uint32_t quotient = high / divisor;
    uint32_t rest = high - quotient * divisor;
    uint32_t part = 0;
    if (divisor < UINT32_C(1) << 20) {
        uint32_t next = (rest << 12) | (low >> 20);
        uint32_t digit = next / divisor;
        part = digit << 20;
        next = ((next - digit * divisor) << 12) | ((low >> 8) & UINT32_C(0xFFF));
        digit = next / divisor;
        part |= digit << 8;
        next = ((next - digit * divisor) << 8) | (low & UINT32_C(0xFF));
        part |= next / divisor;
    } else {
        for (uint32_t bit = UINT32_C(1) << 31; bit != 0; bit >>= 1) {
            const bool carry = rest >> 31 != 0;
            rest = (rest << 1) | ((low & bit) != 0 ? 1U : 0U);
            if (carry || rest >= divisor) {
                rest -= divisor;
                part |= bit;
            }
        }
    }
    return ((uint64_t)quotient << 32) | part;
}

/* Divide by a positive number, rounded down also where the quotient is negative. */
static int64_t floor_divide(int64_t numerator, uint32_t divisor)
{
    if (numerator >= 0) {
        return (int64_t)divide((uint64_t)numerator, divisor);
    }
    return -(int64_t)divide((uint64_t)-numerator + (divisor - 1U), divisor);
}

/* Return the distance, in Q16 steps, that a velocity in 1/64 unit per ms covers; rounded once. */
static int64_t distance_q16(int32_t velocity, int32_t duration_ticks, int32_t microsteps)
{
    return ((int64_t)velocity * duration_ticks * microsteps + 32) >> 6; /* 31 + 10 + 8 bits, less 6 */
}

int32_t st_push(st_axis *axes, st_segment *queue, int32_t axis, int32_t displacement_units, int32_t end_velocity,
    int32_t duration_ticks)
{
    st_axis *const self = &axes[axis];
    const int32_t count = self->queue_count;
    if (count >= ST_QUEUE_DEPTH) {
        return ST_REFUSED_QUEUE_FULL;
    }
    if (duration_ticks < 1 || duration_ticks > ST_DURATION_MAX_MS * ST_TICKS_PER_MS) {
        return ST_REFUSED_DURATION;
    }
    const int32_t microsteps = self->microsteps;
    ST_ASSERT(microsteps >= 1 && microsteps <= 256);
    const int64_t distance = (int64_t)displacement_units * microsteps * 4;
    const int64_t a = distance_q16(self->tail_velocity, duration_ticks, microsteps);
    const int64_t e = distance_q16(end_velocity, duration_ticks, microsteps);
    const int64_t middle = 3 * distance - a - e;
    const int64_t b = middle - a;
    const int64_t c = a + e - 2 * distance;
    const int64_t fastest = max_64(max_64(abs_64(a), abs_64(middle)), abs_64(e));
    const int64_t longest = max_64(abs_64(distance), abs_64(distance - a));
    if (max_64(max_64(fastest, longest), max_64(abs_64(b), abs_64(c))) > ST_I32_MAX) {
        return ST_REFUSED_COEFFICIENT;
    }
    if (fastest * ST_TICKS_PER_MS > (int64_t)self->rate_limit_q16_per_ms * duration_ticks) {
        return ST_REFUSED_TOO_FAST;
    }
    const int64_t tail = self->tail_q16;
    if (abs_64(tail + distance) > (int64_t)ST_I32_MAX * microsteps * 4) {
        return ST_REFUSED_POSITION;
    }
    st_segment *const entry = &queue[axis * ST_QUEUE_DEPTH + (self->queue_head + count) % ST_QUEUE_DEPTH];
    entry->start_q16 = tail;
    entry->a = to_32(a);
    entry->b = to_32(b);
    entry->c = to_32(c);
    entry->ticks = (uint16_t)duration_ticks;
    entry->end_velocity = end_velocity;
    self->queue_count = (uint8_t)(count + 1);
    self->tail_q16 = tail + distance;
    self->tail_velocity = end_velocity;
    return ST_ACCEPTED;
}

bool st_next_segment(st_axis *axes, const st_segment *queue, int32_t axis)
{
    st_axis *const self = &axes[axis];
    const int32_t count = self->queue_count;
    if (count == 0) {
        self->running = 0;
        return false;
    }
    const int32_t head = self->queue_head;
    const st_segment *const entry = &queue[axis * ST_QUEUE_DEPTH + head];
    self->start_q16 = entry->start_q16;
    self->coefficient_a = entry->a;
    self->coefficient_b = entry->b;
    self->coefficient_c = entry->c;
    self->duration_ticks = entry->ticks;
    self->end_velocity = entry->end_velocity;
    self->elapsed_q16 = 0;
    self->queue_head = (uint8_t)((head + 1) % ST_QUEUE_DEPTH);
    self->queue_count = (uint8_t)(count - 1);
    self->running = 1;
    return true;
}

/*
 * Place the edges first .. last - 1: each step when it is due, or later when the driver is ready for it.
 *
 * Return false if a step is over a tick late. The crossings of a tick are equally spaced: if a pulse is longer than
 * their interval, lateness grows from step to step; if not, it shrinks. So the first or the last step is the latest.
 */
static bool place_waiting_steps(st_axis *self, uint32_t *clk, int32_t first, int32_t last, int64_t tick_counts,
    int64_t due_q16, int64_t interval_q16, int64_t earliest)
{
    const int32_t steplen = self->steplen_counts;
    const int32_t pulse = steplen + self->stepspace_counts;
    const int64_t first_late = max_64(earliest - (tick_counts + (due_q16 >> 16)), 0);
    int64_t due = 0;
    int64_t rise = 0;
    int32_t delayed = 0;
    for (int32_t k = first; k < last; k += 2) {
        due = tick_counts + (due_q16 >> 16);
        rise = max_64(due, earliest);
        delayed += rise > due;
        clk[k] = (uint32_t)rise;
        clk[k + 1] = (uint32_t)(rise + steplen);
        earliest = rise + pulse;
        due_q16 += interval_q16;
    }
    ST_ASSERT_BITS(earliest, 60);
    self->last_rise_counts = rise;
    self->earliest_rise_counts = earliest;
    self->delayed_steps += delayed;
    return max_64(first_late, rise - due) <= ST_TICK_COUNTS;
}

/*
 * Place the steps of one tick, all of them up or down (1 or 0); return false if one is over a tick late.
 *
 * The chord is `travel` long and crosses the first threshold after `to_threshold` (Q16 steps). The crossings are
 * evenly spaced: the first is at to_threshold * interval, each further one an interval later. A rise waits until the
 * last CLK fall is stepspace old and the last DIR edge dirsetup old. A DIR edge waits until the last rise is dirhold
 * old, and at least one count, because the driver reads DIR at the rise itself. All these times count from the edges
 * really placed.
 */
static bool place_steps(st_axis *self, uint32_t *clk, uint32_t *direction, int64_t tick_counts, int32_t travel,
    int32_t to_threshold, int32_t up)
{
    if (travel <= 0 || to_threshold > travel) {
        return true;
    }
    ST_ASSERT(to_threshold >= 0);
    ST_ASSERT_BITS(tick_counts, 60);
    int64_t earliest = self->earliest_rise_counts;
    const int32_t level = up ^ self->dir_inverted;
    if (self->dir_level != level) {
        const int32_t dirhold = self->dirhold_counts > 1 ? self->dirhold_counts : 1;
        const int64_t edge = max_64(tick_counts, self->last_rise_counts + dirhold);
        earliest = max_64(earliest, edge + self->dirsetup_counts);
        self->dir_level = (uint8_t)level;
        direction[self->dir_edges++] = (uint32_t)(2 * edge + level);
    }
    const int32_t steps = ((travel - to_threshold) >> 16) + 1;
    const int64_t interval_q16 = (int64_t)divide((uint64_t)ST_TICK_COUNTS << 32, (uint32_t)travel);
    int64_t due_q16 = (to_threshold * interval_q16) >> 16; /* at most a tick, since the threshold is on the chord */
    ST_ASSERT(due_q16 <= (int64_t)ST_TICK_COUNTS << 16);
    const int32_t steplen = self->steplen_counts;
    const int32_t pulse = steplen + self->stepspace_counts;
    const int32_t first = self->clk_edges;
    const int32_t last = first + 2 * steps;
    self->counter += up != 0 ? steps : -steps;
    self->clk_edges = last;
    int64_t rise = tick_counts + (due_q16 >> 16);
    if (earliest > rise || pulse > interval_q16 >> 16) {
        return place_waiting_steps(self, clk, first, last, tick_counts, due_q16, interval_q16, earliest);
    }
    /* The first step need not wait, and the others are at least a pulse apart: all are placed when they are due. */
    for (int32_t k = first; k < last; k += 2) {
        rise = tick_counts + (due_q16 >> 16);
        clk[k] = (uint32_t)rise;
        clk[k + 1] = (uint32_t)(rise + steplen);
        due_q16 += interval_q16;
    }
    self->last_rise_counts = rise;
    self->earliest_rise_counts = rise + pulse;
    return true;
}

int64_t st_group_time_q16(const st_group *group, int64_t tick)
{
    const int64_t since = tick - group->ramp_tick;
    const int32_t ramped = to_32(min_64(since, group->ramp_ticks));
    ST_ASSERT(ramped >= 0);
    int64_t time_q16 = (int64_t)group->rate_from_q16 * ramped + group->rate_to_q16 * (since - ramped);
    if (ramped > 0) {
        const int64_t change = group->rate_to_q16 - group->rate_from_q16;
        time_q16 += floor_divide(change * ramped * ramped, 2U * (uint32_t)group->ramp_ticks); /* 17 + 17 + 17 bits */
    }
    return time_q16;
}

/*
 * Return true if a segment that starts at this distance from the counter cannot reach a threshold.
 *
 * A cubic stays within its Bernstein coefficients: start, start + a/3, end - e/3 and end, with e = a + 2b + 3c. They
 * are multiplied by three to avoid the division, and so are the threshold and the rounding of an evaluation.
 */
static bool makes_no_step(int64_t start, int64_t a, int64_t b, int64_t c)
{
    ST_ASSERT_BITS(start, 49);
    const int64_t end = 3 * (start + a + b + c);
    const int64_t outer = max_64(abs_64(3 * start), abs_64(end));
    const int64_t inner = max_64(abs_64(3 * start + a), abs_64(end - a - 2 * b - 3 * c));
    return max_64(outer, inner) < 3 * (ST_THRESHOLD_Q16 - ST_ROUNDING_Q16);
}

/*
 * Return s = (since_q16 << 14) / n, rounded down, and its remainder. The first division leaves less than n, which is at
 * most 10 bits, so that two divisions of 32 bits do. A segment that begins within a tick has a negative time.
 */
static int32_t parameter(int32_t since_q16, int32_t n, int32_t *remainder)
{
    int32_t quotient = since_q16 / n;
    int32_t rest = since_q16 - quotient * n;
    if (rest < 0) {
        rest += n;
        quotient -= 1;
    }
    const int32_t low = (rest << 14) / n;
    *remainder = (rest << 14) - low * n;
    return quotient * 16384 + low;
}

/*
 * Evaluate the segment at the end of each tick and place the steps, to `until_tick` or to a late step.
 *
 * Trajectory time advances by `rate_q16` a tick, so (i << 30) / n is updated by additions: quotient and remainder
 * are carried from tick to tick. Trajectory time is negative where the segment begins within the tick. Return the
 * tick reached; `event` tells if a step was late.
 */
static int64_t run_ticks(
    st_axis *self, uint32_t *clk, uint32_t *direction, int64_t tick, int64_t until_tick, int32_t rate_q16)
{
    const int32_t half = 1 << 29;
    const int64_t start = self->start_q16;
    const int32_t a = self->coefficient_a;
    const int32_t b = self->coefficient_b;
    const int32_t c = self->coefficient_c;
    const int32_t n = self->duration_ticks;
    ST_ASSERT(n >= 1 && n <= ST_DURATION_MAX_MS * ST_TICKS_PER_MS && rate_q16 >= 0 && rate_q16 <= ST_HIGHEST_RATE_Q16);
    int64_t p = self->position_q16;
    const int32_t elapsed_q16 = self->elapsed_q16;
    const int64_t from_tick = tick;
    const int32_t s_per_tick = (rate_q16 << 14) / n;
    const int32_t s_remainder_per_tick = (rate_q16 << 14) - s_per_tick * n;
    bool on_time = true;
    if (until_tick - tick > 1 && makes_no_step(start - (int64_t)self->counter * ST_STEP_Q16, a, b, c)) {
        tick = until_tick - 1; /* only the position at the end is needed: skip to the last tick */
    }
    const int32_t since_q16 = to_32(elapsed_q16 + (tick - from_tick) * rate_q16);
    int32_t s_remainder = 0;
    int32_t s = parameter(since_q16, n, &s_remainder);
    while (tick < until_tick && on_time) {
        s += s_per_tick;
        s_remainder += s_remainder_per_tick;
        if (s_remainder >= n) {
            s_remainder -= n;
            s += 1;
        }
        ST_ASSERT(s >= -(1 << 30) && s <= 1 << 30);
        int32_t chord = to_32((((int64_t)c * s + half) >> 30) + b);
        chord = to_32((((int64_t)chord * s + half) >> 30) + a);
        const int64_t q = start + (((int64_t)chord * s + half) >> 30);
        ST_ASSERT_BITS(q, 40);
        const int64_t counter_q16 = (int64_t)self->counter * ST_STEP_Q16;
        const int64_t tick_counts = tick * ST_TICK_COUNTS;
        if (q - counter_q16 >= ST_THRESHOLD_Q16) {
            const int32_t to_threshold = to_32(counter_q16 + ST_THRESHOLD_Q16 - p);
            on_time = place_steps(self, clk, direction, tick_counts, to_32(q - p), to_threshold, 1);
        } else if (counter_q16 - q >= ST_THRESHOLD_Q16) {
            const int32_t to_threshold = to_32(p + ST_THRESHOLD_Q16 - counter_q16);
            on_time = place_steps(self, clk, direction, tick_counts, to_32(p - q), to_threshold, 0);
        }
        p = q;
        tick += 1;
    }
    self->position_q16 = p;
    self->elapsed_q16 = to_32(elapsed_q16 + (tick - from_tick) * rate_q16);
    if (!on_time) {
        self->event = ST_EVENT_LATE_STEP;
    }
    return tick;
}

/* Return the first tick, not before `tick`, from which on an axis' trajectory time runs at full rate. */
static int64_t full_rate_from(const st_axis *self, const st_group *group, int64_t tick)
{
    if (self->in_group == 0) {
        return tick;
    }
    if (group->rate_to_q16 != ST_FULL_RATE_Q16) {
        return ST_NEVER_TICK;
    }
    return max_64(tick, group->ramp_tick + group->ramp_ticks);
}

int64_t st_advance_axis(st_axis *axes, const st_segment *queue, const st_group *group, uint32_t *clk,
    uint32_t *direction, int32_t axis, int64_t tick, int64_t until_tick)
{
    st_axis *const self = &axes[axis];
    if (self->running == 1) {
        self->event = ST_EVENT_NONE;
    }
    const int64_t full_from = full_rate_from(self, group, tick);
    while (tick < until_tick && self->running == 1) {
        const int32_t left_q16 = (self->duration_ticks << 16) - self->elapsed_q16;
        int32_t rate_q16 = ST_FULL_RATE_Q16;
        int32_t ticks = left_q16 >> 16 > 1 ? left_q16 >> 16 : 1;
        if (tick < full_from) {
            rate_q16 = to_32(st_group_time_q16(group, tick + 1) - st_group_time_q16(group, tick));
            ticks = 1;
            if (rate_q16 == 0 && tick >= group->ramp_tick + group->ramp_ticks) {
                return until_tick; /* the group has halted */
            }
        }
        if (left_q16 < rate_q16) {
            if (st_next_segment(axes, queue, axis)) {
                self->elapsed_q16 = -left_q16; /* it begins within the tick */
            } else {
                rate_q16 = left_q16; /* to the segment's very end */
            }
        }
        tick = run_ticks(self, clk, direction, tick, min_64(tick + ticks, until_tick), rate_q16);
        if (self->elapsed_q16 == self->duration_ticks << 16 && !st_next_segment(axes, queue, axis)) {
            if (self->event == ST_EVENT_NONE) { /* a late step is told first: the firmware stops for it anyway */
                self->event = self->end_velocity == 0 ? ST_EVENT_FINISHED : ST_EVENT_UNDERRUN;
            }
            return tick;
        }
        if (self->event != ST_EVENT_NONE) {
            return tick;
        }
    }
    return until_tick;
}

st_advance_result st_advance(st_axis *axes, st_axis *before, const st_segment *queue, const st_group *group,
    uint32_t *const *clk, uint32_t *const *direction, int32_t axis_count, int64_t tick, int64_t until_tick)
{
    const size_t size = (size_t)axis_count * sizeof(axes[0]);
    if (until_tick - tick > 1) { /* within one tick no axis can run too far */
        (void)memcpy(before, axes, size);
    }
    int64_t reached = until_tick;
    for (int32_t axis = 0; axis < axis_count; axis++) {
        reached = st_advance_axis(axes, queue, group, clk[axis], direction[axis], axis, tick, reached);
    }
    if (reached < until_tick) { /* axes run one after the other, and some ran too far: repeat up to the common tick */
        (void)memcpy(axes, before, size);
        for (int32_t axis = 0; axis < axis_count; axis++) {
            (void)st_advance_axis(axes, queue, group, clk[axis], direction[axis], axis, tick, reached);
        }
    }
    int32_t asking = 0;
    for (int32_t axis = 0; axis < axis_count; axis++) {
        asking += axes[axis].event != ST_EVENT_NONE;
    }
    return (st_advance_result){reached, asking};
}

int64_t st_demand_rate(const st_axis *axes, int32_t axis)
{
    const st_axis *const self = &axes[axis];
    int32_t remainder = 0;
    const int32_t s = parameter(self->elapsed_q16, self->duration_ticks, &remainder);
    const int64_t slope = (((int64_t)3 * self->coefficient_c * s) >> 30) + (int64_t)2 * self->coefficient_b;
    ST_ASSERT_BITS(slope, 33);
    return ((slope * s) >> 30) + self->coefficient_a;
}
