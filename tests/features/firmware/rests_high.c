/* STEP rests high, as with common-anode wiring: ten pulses each way are low for LOW_US, 1 ms apart.
 *
 * DIR turns, 1 ms before the next pulse, and ENABLE falls while STEP rests. The emergency stop ends the motion. */
#include "steptwin_hal.h"

#define US ST_COUNTS_PER_US

static int made, turned, rising = -1;

static void rise(void) {
    hal_pin(0, ST_STEP, 1);
    hal_timer_stop(rising);
}
static void fall(void) {
    if (hal_inputs(0) & ST_ESTOP) return;
    if (made == 10 && !turned) { hal_pin(0, ST_DIR, 0), turned = 1; return; }
    if (made == 20) { hal_pin(0, ST_ENABLE, 0); return; }
    made++;
    hal_pin(0, ST_STEP, 0);
    rising = hal_timer(LOW_US * US, 1, 0, rise);
}
void fw_can(const st_frame *frame) { (void)frame; }
void fw_inputs(void) {}
void fw_main(void) {
    hal_pin(0, ST_M1, 0), hal_pin(0, ST_M2, 1), hal_pin(0, ST_STEP, 1), hal_pin(0, ST_DIR, 1);
    hal_wait(1000 * US);
    hal_pin(0, ST_RESET, 1), hal_pin(0, ST_ENABLE, 1);
    hal_wait(5000 * US);
    hal_timer(1000 * US, 0, 0, fall);
    for (;;) hal_wait(10000 * US);
}
