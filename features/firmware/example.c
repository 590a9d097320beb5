/* A stepper firmware with a CAN protocol of its own, in less than 100 lines.
 *
 *   host -> board  0x200 + node of the axis   i32 target in steps, u16 milliseconds: go there evenly
 *                  0x280 + node of the axis   u8: 1 switch the driver on, 0 off; 2 keep the position in the flash
 *   board -> host  0x300 + node of the axis   i32 position in steps, u8 inputs: every 20 ms
 *
 * A limit switch or the emergency stop ends the axis' motion. A 40 kHz interrupt makes the pulses: DIR one interrupt
 * before STEP, STEP high for two. Compile it: gcc -O2 -shared -fPIC -o fw.so example.c steptwin_hal.c */
#include "steptwin_hal.h"
#include <string.h>

#define US ST_COUNTS_PER_US
#define PERIOD (25 * US)
#define QUEUE 8
#define PER_MS 40

typedef struct { int32_t target; uint32_t interrupts; } leg;
typedef struct {
    leg queue[QUEUE];
    int waiting, direction, high, low;
    int64_t at, speed;  /* in 2^-32 step */
    int32_t target, count;
    uint32_t left;
} axis;

static axis axes[8];

static void pulses(void) {
    for (uint32_t i = 0; i < hal_axes; i++) {
        axis *a = &axes[i];
        if (!a->left && a->waiting) {
            a->left = a->queue[0].interrupts;
            a->target = a->queue[0].target;
            a->speed = (((int64_t)a->target << 32) - a->at) / a->left;
            memmove(a->queue, a->queue + 1, (size_t)--a->waiting * sizeof *a->queue);
        }
        if (a->left) a->at = --a->left ? a->at + a->speed : (int64_t)a->target << 32;
        if (a->high) {
            if (!--a->high) hal_pin(i, ST_STEP, 0), a->low = 2;
            continue;
        }
        if (a->low && --a->low) continue;
        int32_t wanted = (int32_t)((a->at + (1LL << 31)) >> 32);
        if (wanted == a->count) continue;
        int up = wanted > a->count;
        if (up != a->direction) { hal_pin(i, ST_DIR, a->direction = up); continue; }
        hal_pin(i, ST_STEP, 1);
        a->high = 2;
        a->count += up ? 1 : -1;
    }
}

void fw_can(const st_frame *frame) {
    uint32_t i = (frame->id & 0x7F) - hal_node;
    if (i >= hal_axes) return;
    axis *a = &axes[i];
    if ((frame->id & 0x780) == 0x200 && frame->length == 6 && a->waiting < QUEUE) {
        leg next;
        uint16_t ms;
        memcpy(&next.target, frame->data, 4);
        memcpy(&ms, frame->data + 4, 2);
        next.interrupts = ms ? ms * PER_MS : 1;
        a->queue[a->waiting++] = next;
    } else if ((frame->id & 0x780) == 0x280 && frame->length == 1) {
        if (frame->data[0] < 2) hal_pin(i, ST_ENABLE, frame->data[0]);
        else memcpy(hal_flash + 4 * i, &a->count, 4);
    }
}

void fw_inputs(void) {
    for (uint32_t i = 0; i < hal_axes; i++)
        if (hal_inputs(i) & (ST_ESTOP | ST_NEGATIVE_LIMIT | ST_POSITIVE_LIMIT)) {
            axes[i].waiting = 0, axes[i].left = 0;
            axes[i].at = (int64_t)axes[i].count << 32;
        }
}

void fw_main(void) {
    for (uint32_t i = 0; i < hal_axes; i++) {
        hal_pin(i, ST_M1, 0), hal_pin(i, ST_M2, 1);  /* 16 microsteps of a TB6560 */
        axes[i].direction = 0;
        memcpy(&axes[i].count, hal_flash + 4 * i, 4);
        if (axes[i].count == -1) axes[i].count = 0;  /* an empty flash */
        axes[i].at = (int64_t)axes[i].count << 32;
    }
    hal_wait(1000 * US);
    for (uint32_t i = 0; i < hal_axes; i++) hal_pin(i, ST_RESET, 1);
    hal_timer(PERIOD, 0, 0, pulses);
    for (;;) {
        hal_wait(20000 * US);
        for (uint32_t i = 0; i < hal_axes; i++) {
            uint8_t data[5];
            memcpy(data, &axes[i].count, 4);
            data[4] = (uint8_t)hal_inputs(i);
            hal_can_send(0x300 + hal_node + i, data, 5);
        }
    }
}
