/*
 * One axis by SysTick at 20 kHz, its pulses as long as DWT's cycle counter says: STEP PA0, DIR PA1, ENABLE PA4.
 *
 * An accumulator of the phase makes the steps, so a pulse may be a tick late: that is the jitter of this method. The end
 * of a motion is told by PendSV, below SysTick's priority. PA5 reads a limit switch to ground, with a pull-up: closed,
 * it ends the motion.
 * Built with -DFAULT, nothing waits between the pulse's edges: at -O2 it is too short for the driver.
 */
#include "chip.h"

enum { HZ = 20000, HIGH_CYCLES = 72 * 12 };

static volatile int32_t left, position;
static volatile uint32_t phase, speed, speed_max, speed_up; /* of the phase: 2^32 is a step, in a tick */
static volatile uint8_t forward, running, told, hit;

static void pulse(void)
{
    GPIOA_BSRR = 1u << 0;
#ifndef FAULT
    uint32_t begin = DWT_CYCCNT;
    while (DWT_CYCCNT - begin < HIGH_CYCLES) {
    }
#endif
    GPIOA_BRR = 1u << 0;
}

void systick(void)
{
    if (!running) {
        return;
    }
    if (!(GPIOA_IDR & (1u << 5))) {
        hit = 1;
        left = 0;
    }
    if (left == 0) {
        running = 0;
        SCB_ICSR = 1u << 28; /* PendSV */
        return;
    }
    /* slow down when the way to standstill, v^2 / 2a, is the rest */
    if ((uint64_t)speed * speed / 2 >= (uint64_t)(uint32_t)left * speed_up << 32) {
        speed = speed > 4 * speed_up ? speed - speed_up : speed;
    } else if (speed < speed_max) {
        speed += speed_up;
    }
    uint32_t before = phase;
    phase += speed;
    if (phase < before) {
        pulse();
        left--;
        position += forward ? 1 : -1;
    }
}

void pend_sv(void) { told = 1; }

static void move_to(int32_t target)
{
    int32_t steps = target - position;
    forward = steps > 0;
    left = steps > 0 ? steps : -steps;
    phase = 0;
    speed = 0;
    told = 0;
    GPIOA_BSRR = forward ? 1u << 1 : 1u << 17;
    running = 1;
    while (!told) {
        WAIT_FOR_INTERRUPT();
    }
}

int main(void)
{
    clock_72_mhz();
    GPIOA_CRL = 0x44833333; /* PA0 to PA4 are outputs, PA5 an input with a pull-up */
    GPIOA_ODR = 1u << 5;
    GPIOA_BSRR = 1u << 4;
    uart_begin();
    DEMCR |= 1u << 24;
    DWT_CYCCNT = 0;
    DWT_CTRL |= 1;
    speed_max = 4000u * (uint32_t)(0x100000000ull / HZ);          /* steps/s */
    speed_up = 20000u * (uint32_t)(0x100000000ull / HZ) / HZ;     /* steps/s^2 */
    SCB_SHPR(14 - 4) = 0xF0;
    SYST_RVR = 72000000 / HZ - 1;
    SYST_CVR = 0;
    SYST_CSR = 7;
    uart_say("ready\n");
    move_to(1000);
    move_to(0);
    uart_say(hit ? "limit\n" : "done\n");
    for (;;) {
        WAIT_FOR_INTERRUPT();
    }
}
