/*
 * Two axes by TIM2's compare interrupts: STEP PA0 and PA2, DIR PA1 and PA3, ENABLE PA4.
 *
 * TIM2 counts at 2 MHz and never stops. Compare 1 and 2 are the next edge of each axis. An axis speeds up and slows down
 * by intervals of a table of its own: c(n + 1) = c(n) - 2 c(n) / (4 n + 1). The main loop sleeps.
 * Built with -DFAULT, DIR changes at the first STEP instead of 200 us before it: the driver steps the wrong way.
 */
#include "chip.h"

enum { AXES = 2, FIRST = 8000, FASTEST = 250, HIGH = 24, SETUP = 400 }; /* in ticks of 0.5 us */

typedef struct {
    uint32_t step, dir; /* pins */
    int32_t target, position;
    int32_t left;    /* steps of this motion */
    int32_t ramp;    /* steps since standstill by which it has sped up */
    int32_t interval_q8;
    uint8_t high, forward, running;
} axis;

static volatile axis axes[AXES] = {{.step = 1u << 0, .dir = 1u << 1}, {.step = 1u << 2, .dir = 1u << 3}};

static void next_interval(volatile axis *a)
{
    if (a->left <= a->ramp) { /* slow down */
        if (a->ramp > 1) {
            a->interval_q8 += 2 * a->interval_q8 / (4 * a->ramp - 1);
            a->ramp--;
        }
    } else if (a->interval_q8 > FASTEST * 256) {
        a->ramp++;
        a->interval_q8 -= 2 * a->interval_q8 / (4 * a->ramp + 1);
    }
}

static void edge(unsigned n)
{
    volatile axis *a = &axes[n];
    if (a->high) {
        GPIOA_BSRR = a->step << 16;
        a->high = 0;
        a->position += a->forward ? 1 : -1;
        if (--a->left == 0) {
            TIM2_DIER &= ~(2u << n);
            a->running = 0;
            return;
        }
        next_interval(a);
        TIM2_CCR(n) = (TIM2_CCR(n) + (uint32_t)(a->interval_q8 >> 8) - HIGH) & 0xFFFF;
        return;
    }
#ifdef FAULT
    GPIOA_BSRR = a->forward ? a->dir : a->dir << 16;
#endif
    GPIOA_BSRR = a->step;
    a->high = 1;
    TIM2_CCR(n) = (TIM2_CCR(n) + HIGH) & 0xFFFF;
}

void tim2(void)
{
    uint32_t status = TIM2_SR & TIM2_DIER;
    TIM2_SR = ~status;
    if (status & 2) {
        edge(0);
    }
    if (status & 4) {
        edge(1);
    }
}

static void move_to(unsigned n, int32_t target)
{
    volatile axis *a = &axes[n];
    int32_t steps = target - a->position;
    if (steps == 0) {
        return;
    }
    a->forward = steps > 0;
    a->left = steps > 0 ? steps : -steps;
    a->ramp = 0;
    a->interval_q8 = FIRST * 256;
    a->running = 1;
#ifndef FAULT
    GPIOA_BSRR = a->forward ? a->dir : a->dir << 16;
#endif
    TIM2_CCR(n) = (TIM2_CNT + SETUP) & 0xFFFF;
    TIM2_SR = ~(2u << n);
    TIM2_DIER |= 2u << n;
}

static void wait_for_all(void)
{
    while (axes[0].running || axes[1].running) {
        WAIT_FOR_INTERRUPT();
    }
}

int main(void)
{
    clock_72_mhz();
    GPIOA_CRL = 0x44433333; /* PA0 to PA4 are outputs */
    GPIOA_BSRR = 1u << 4;
    uart_begin();
    TIM2_PSC = 36 - 1; /* 72 MHz: the APB1's clock doubled */
    TIM2_ARR = 0xFFFF;
    TIM2_EGR = 1;
    TIM2_SR = 0;
    NVIC_ISER0 = 1u << 28;
    TIM2_CR1 = 1;
    uart_say("ready\n");
    move_to(0, 800);
    move_to(1, -300);
    wait_for_all();
    move_to(0, 0);
    move_to(1, 500);
    wait_for_all();
    uart_say("done\n");
    for (;;) {
        WAIT_FOR_INTERRUPT();
    }
}
