/*
 * The motion kernel: turn queued cubic segments into CLK and DIR edges, in integers throughout.
 *
 * It is StepTwin's controller/motion/kernel.py, written once more by hand: the same functions, names and formulas, and
 * bit for bit the same edges. Once per servo tick (250 us) every running axis evaluates its cubic Hermite segment in
 * Q16 steps,
 *
 *     p(s) = p0 + ((c s + b) s + a) s,    s = (i << 30) / n,    i of n ticks,
 *
 * and places the steps of that tick on the chord between two evaluations. The counter goes up when p reaches counter
 * + H and down when p reaches counter - H, with H = 1/2 + 1/16 step: the sixteenth is hysteresis.
 *
 * A halt slows trajectory time instead of the axes. In each tick the axes of the group advance i by the group's rate
 * instead of by 1, and the rate ramps linearly to 0 and back, or to another up to ST_HIGHEST_RATE_Q16. The rate is a
 * function of the tick alone and i is kept in Q16 ticks, so that axes in step stay so to the last bit and keep to the
 * planned path.
 *
 * Storage: `axes` is one st_axis for each axis, `queue` ST_QUEUE_DEPTH st_segment for each axis, `clk` and `direction`
 * one row of edges for each axis, as long as the edges of a call. All begins as 0, except that last_rise_counts is
 * ST_NEVER_COUNTS, microsteps and duration_ticks are 1 and the group's rate_to_q16 is ST_FULL_RATE_Q16.
 * A row of `clk` holds rise, fall, rise, fall ... in timer counts, a row of `direction` 2 * counts + level. An edge is
 * the low 32 bits of that: at 72 MHz a CLK edge repeats after 59 s, a DIR edge after 29 s.
 */
#ifndef STEPTWIN_KERNEL_H
#define STEPTWIN_KERNEL_H

#include <stdbool.h>
#include <stdint.h>

/* One servo tick: 250 us of the 72 MHz timer. */
#define ST_TICK_COUNTS 18000
#define ST_TICKS_PER_MS 4

#define ST_STEP_Q16 65536
/* H, the distance from counter to demand at which a step is made; the sixteenth prevents chatter on a threshold. */
#define ST_THRESHOLD_Q16 36864
/* Upper bound of the error that the three rounding shifts of an evaluation make together. */
#define ST_ROUNDING_Q16 4
/* Rate at which trajectory time runs as fast as real time: one tick a tick. */
#define ST_FULL_RATE_Q16 65536
/* The highest rate. A segment of the group's lasts at least two ticks, so that at most one ends within a tick. */
#define ST_HIGHEST_RATE_Q16 98304

/* Segments that wait for each axis: a power of two, at most 64. */
#define ST_QUEUE_DEPTH 64
#define ST_DURATION_MAX_MS 255
#define ST_I32_MAX 2147483647
/* Time of an edge that has not happened yet. */
#define ST_NEVER_COUNTS (-INT64_C(4611686018427387904))
/* A tick that never comes. */
#define ST_NEVER_TICK INT64_C(4611686018427387904)

/* Why an axis needs the firmware's attention in a tick. */
#define ST_EVENT_NONE 0
#define ST_EVENT_FINISHED 1
#define ST_EVENT_UNDERRUN 2
#define ST_EVENT_LATE_STEP 3

/* Why a segment is refused. */
#define ST_ACCEPTED 0
#define ST_REFUSED_QUEUE_FULL 1
#define ST_REFUSED_DURATION 2
#define ST_REFUSED_COEFFICIENT 3
#define ST_REFUSED_TOO_FAST 4
#define ST_REFUSED_POSITION 5

/* One axis. The comment behind a member is the range that it keeps. */
typedef struct {
    int64_t position_q16;          /* -2^41 .. 2^41 - 1 */
    int64_t start_q16;             /* -2^41 .. 2^41 - 1 */
    int64_t tail_q16;              /* -2^41 .. 2^41 - 1; where the next segment starts */
    int64_t earliest_rise_counts;  /* -2^62 .. 2^62 - 1 */
    int64_t last_rise_counts;      /* -2^62 .. 2^62 - 1 */
    int32_t steplen_counts;        /* 0 .. 2^17 - 1; CLK is high for it */
    int32_t stepspace_counts;      /* 0 .. 2^17 - 1; CLK is low for it at least */
    int32_t dirsetup_counts;       /* 0 .. 2^17 - 1; DIR stands for it before a rise */
    int32_t dirhold_counts;        /* 0 .. 2^17 - 1; and after a rise */
    int32_t rate_limit_q16_per_ms; /* 0 .. 2^31 - 1 */
    int32_t counter;               /* -2^31 .. 2^31 - 1; steps made, up less down */
    int32_t coefficient_a;         /* -2^31 .. 2^31 - 1 */
    int32_t coefficient_b;         /* -2^31 .. 2^31 - 1 */
    int32_t coefficient_c;         /* -2^31 .. 2^31 - 1 */
    int32_t elapsed_q16;           /* -2^31 .. 2^31 - 1; ticks of the segment */
    int32_t end_velocity;          /* -2^31 .. 2^31 - 1 */
    int32_t tail_velocity;         /* -2^31 .. 2^31 - 1 */
    int32_t delayed_steps;         /* 0 .. 2^31 - 1 */
    int32_t clk_edges;             /* 0 .. 2^30 - 1; in the axis' row, and so are dir_edges */
    int32_t dir_edges;             /* 0 .. 2^30 - 1 */
    uint16_t duration_ticks;       /* 1 .. 1020 */
    uint16_t microsteps;           /* 1 .. 256 */
    uint8_t dir_inverted;          /* 0 .. 1 */
    uint8_t running;               /* 0 .. 1 */
    uint8_t in_group;              /* 0 .. 1; whether the group's rate is its own */
    uint8_t queue_head;            /* 0 .. 63 */
    uint8_t queue_count;           /* 0 .. 64 */
    uint8_t dir_level;             /* 0 .. 1 */
    uint8_t event;                 /* 0 .. 3 */
} st_axis;

/* A cubic in the queue. */
typedef struct {
    int64_t start_q16;    /* -2^41 .. 2^41 - 1 */
    int32_t a;            /* -2^31 .. 2^31 - 1 */
    int32_t b;            /* -2^31 .. 2^31 - 1 */
    int32_t c;            /* -2^31 .. 2^31 - 1 */
    int32_t end_velocity; /* -2^31 .. 2^31 - 1 */
    uint16_t ticks;       /* 0 .. 1020 */
} st_segment;

/* The time of the axes that halt together: a ramp of its rate that begins at the start of a tick. */
typedef struct {
    int64_t ramp_tick;     /* -2^43 .. 2^43 - 1 */
    int32_t rate_from_q16; /* 0 .. 98304 */
    int32_t rate_to_q16;   /* 0 .. 98304 */
    int32_t ramp_ticks;    /* 0 .. 2^17 - 1 */
} st_group;

/* What st_advance returns. */
typedef struct {
    int64_t reached;
    int32_t asking;
} st_advance_result;

/*
 * Queue the cubic from the tail of the queue to the tail + displacement; return ST_ACCEPTED or why it is refused.
 *
 * The displacement is in wire units (1/16 384 full step), the end velocity in 1/64 unit per ms. With D the
 * displacement, a = v0 dt and e = v1 dt, all in Q16 steps: b = 3D - 2a - e, c = a + e - 2D. The velocity is a
 * quadratic with the Bernstein coefficients a, 3D - a - e and e (over dt), so these three bound the step rate. With
 * all values checked below inside i32, every intermediate of the evaluation is inside i32 too. A refused segment
 * changes nothing.
 */
int32_t st_push(st_axis *axes, st_segment *queue, int32_t axis, int32_t displacement_units, int32_t end_velocity,
    int32_t duration_ticks);

/* Take the oldest segment off the queue and make it the running one; return false if there is none. */
bool st_next_segment(st_axis *axes, const st_segment *queue, int32_t axis);

/*
 * Return the trajectory time from the start of the group's ramp to the start of `tick`, in Q16 ticks.
 *
 * After j of the ramp's K ticks it is r0 j + (r1 - r0) j^2 / 2K, rounded down; then it grows by r1 a tick. So a ramp
 * covers (r0 + r1) K / 2. Between full rate and 0, with an even number of ticks, that is a whole number of ticks.
 */
int64_t st_group_time_q16(const st_group *group, int64_t tick);

/*
 * Run one axis from the start of `tick` to the start of `until_tick`, or until it needs attention.
 *
 * Return the tick reached; if it is before `until_tick`, `event` tells why. At full rate all whole ticks of a segment
 * are run in one call. A tick at another rate is run alone, and so is a tick within which a segment ends: the rest of
 * the tick belongs to the next segment, or the axis rests if there is none.
 */
int64_t st_advance_axis(st_axis *axes, const st_segment *queue, const st_group *group, uint32_t *clk,
    uint32_t *direction, int32_t axis, int64_t tick, int64_t until_tick);

/*
 * Run all axes from `tick` to `until_tick`, or to the first tick when one of them needs attention.
 *
 * The group's ramp must not begin after `tick`. `before` is as long as `axes` and is overwritten. Return the tick
 * reached, which is after `tick`, and the number of axes that need attention there; their `event` tells why.
 */
st_advance_result st_advance(st_axis *axes, st_axis *before, const st_segment *queue, const st_group *group,
    uint32_t *const *clk, uint32_t *const *direction, int32_t axis_count, int64_t tick, int64_t until_tick);

/*
 * Return the slope of the present segment, or of the last one at its end, in Q16 steps per duration.
 *
 * That is a + 2 b s + 3 c s^2 at full rate; the caller scales it by the group's rate.
 */
int64_t st_demand_rate(const st_axis *axes, int32_t axis);

#endif
