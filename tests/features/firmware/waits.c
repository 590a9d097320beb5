/* Firmware of one axis whose pulses are made in the way that -DWAY=... names: see test_waits.py. */
#include "steptwin_hal.h"

#define US ST_COUNTS_PER_US

static int begun;

static void step(uint64_t high_us, uint64_t low_us) {
    hal_pin(0, ST_STEP, 1);
    hal_wait(high_us * US);
    hal_pin(0, ST_STEP, 0);
    hal_wait(low_us * US);
}
static void tell(uint8_t what) { hal_can_send(0x300, &what, 1); }

/* IN_CAN: each frame makes a pulse by busy waits. IN_TIMER: the timer does. */
static void pulse(void) { step(35, 35); }

/* NESTED: a slow interrupt waits for 10 ms; an urgent one, each 4 ms, marks its instants by STEP; a lazy one is pending. */
static void urgent(void) { hal_pin(0, ST_STEP, ++begun & 1); }
static void lazy(void) { tell('L'); }
static void slow(void) {
    tell('<');
    hal_wait(10000 * US);
    tell('>');
}

void fw_can(const st_frame *frame) {
    if (WAY == 1) pulse();
    else if (WAY == 4) tell(frame->data[0]), hal_wait(5000 * US);
}
void fw_inputs(void) { tell('i'); }
void fw_main(void) {
    hal_pin(0, ST_M1, 0), hal_pin(0, ST_M2, 1);
    hal_wait(1000 * US);
    hal_pin(0, ST_RESET, 1), hal_pin(0, ST_ENABLE, 1);
    hal_wait(4000 * US);
    if (WAY == 2) hal_timer(1000 * US, 0, 0, pulse);
    if (WAY == 3) hal_timer(4000 * US, 0, 0, urgent), hal_timer(3000 * US, 2, 1, lazy), hal_timer(20000 * US, 1, 1, slow);
    for (;;) {
        hal_wait(10000 * US);
        if (WAY == 3) tell('m');
    }
}
