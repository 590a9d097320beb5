/* An example: one axis goes 100 full steps forth and back in two seconds; the times of its edges are printed. */
#include <inttypes.h>
#include <stdio.h>

#include "steptwin_kernel.h"

enum { EDGES = 64, UNITS_PER_FULL_STEP = 16384, SEGMENT_MS = 250 };

static st_axis axes[1];
static st_axis before[1];
static st_segment queue[ST_QUEUE_DEPTH];
static st_group group = {.rate_from_q16 = ST_FULL_RATE_Q16, .rate_to_q16 = ST_FULL_RATE_Q16};
static uint32_t clk_row[EDGES];
static uint32_t direction_row[EDGES];

int main(void)
{
    uint32_t *const clk[1] = {clk_row};
    uint32_t *const direction[1] = {direction_row};
    axes[0].microsteps = 16;
    axes[0].duration_ticks = 1;
    axes[0].last_rise_counts = ST_NEVER_COUNTS;
    axes[0].steplen_counts = 2376; /* 33 us */
    axes[0].stepspace_counts = 2424;
    axes[0].dirsetup_counts = 1080; /* 15 us */
    axes[0].dirhold_counts = 1080;
    axes[0].rate_limit_q16_per_ms = 15 * ST_STEP_Q16;

    for (int32_t i = 0; i < 8; i++) { /* from rest to rest in each segment */
        const int32_t way = (i < 4 ? 25 : -25) * UNITS_PER_FULL_STEP;
        if (st_push(axes, queue, 0, way, 0, SEGMENT_MS * ST_TICKS_PER_MS) != ST_ACCEPTED) {
            return 1;
        }
    }
    if (!st_next_segment(axes, queue, 0)) {
        return 1;
    }
    int64_t tick = 0;
    while (axes[0].running != 0) {
        const st_advance_result result = st_advance(axes, before, queue, &group, clk, direction, 1, tick, tick + 1);
        tick = result.reached;
        for (int32_t i = 0; i < axes[0].dir_edges; i++) {
            printf("DIR %" PRIu32 " at %" PRIu32 "\n", direction_row[i] & 1U, direction_row[i] >> 1);
        }
        for (int32_t i = 0; i < axes[0].clk_edges; i += 2) {
            printf("CLK from %" PRIu32 " to %" PRIu32 "\n", clk_row[i], clk_row[i + 1]);
        }
        axes[0].dir_edges = 0;
        axes[0].clk_edges = 0;
        if (result.asking != 0 && axes[0].event != ST_EVENT_FINISHED) {
            return 1;
        }
    }
    return axes[0].counter == 0 ? 0 : 1;
}
