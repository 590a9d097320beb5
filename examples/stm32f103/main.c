/*
 * Seven axes on an STM32F103C8: the kernel in the servo interrupt, edges played by TIM2, TIM3, TIM4 and DMA1.
 *
 * No silicon has seen this program. In an emulator its kernel and its feeding were compared with StepTwin, edge by edge;
 * clock, pins, timers and DMA follow ST's reference manual and are untested. See docs/firmware.md for the plan.
 */
#include <stddef.h>

#include "motion.h"
#include "registers.h"
#include "steptwin_kernel.h"

enum {
    EDGES = 12,        /* of one axis in one tick: 15 kHz make 8, and a step at either end */
    LEAD_COUNTS = 720, /* the interrupt comes 10 us before its tick */
    STARTUP_TRIES = 100000,
    EXCHANGE_TRIES = 8 /* looks at all channels: more than 10 us together */
};

/* A CLK output: its timer, the channel's index, the index of its DMA channel, and the pin of DIR on port A or B. */
typedef struct {
    timer *clock;
    uint8_t channel;
    uint8_t dma;
    gpio *dir_port;
    uint8_t dir_pin;
} output;

static const output outputs[AXES] = {
    {TIM2, 2, 0, GPIOA, 3},  /* CLK PA2 */
    {TIM3, 2, 1, GPIOA, 4},  /* CLK PB0 */
    {TIM3, 3, 2, GPIOA, 5},  /* CLK PB1 */
    {TIM4, 1, 3, GPIOB, 10}, /* CLK PB7 */
    {TIM4, 2, 4, GPIOB, 11}, /* CLK PB8 */
    {TIM3, 0, 5, GPIOB, 12}, /* CLK PA6 */
    {TIM2, 1, 6, GPIOB, 13}, /* CLK PA1 */
};

static st_axis axes[AXES];
static st_axis before[AXES];
static st_segment queue[AXES * ST_QUEUE_DEPTH];
static st_group group;
static uint32_t clk_rows[AXES][EDGES];
static uint32_t direction_rows[AXES][2];
static uint16_t played[2][AXES][EDGES]; /* compare values of the tick that is played, and of the next */
static uint8_t counts[AXES];            /* number of edges of the next tick */
static uint32_t dir_words[AXES];        /* the next DIR edge: twice its time plus the level */
static volatile uint8_t dir_waiting;    /* a bit for each axis */
static uint8_t half;                    /* the half of `played` that is filled */
static int64_t tick;
static int32_t fed;

/* What an emulator or a debugger reads: a hash of all edges so far, their number, and a fault of the kernel. */
volatile uint32_t edge_hash = 2166136261U;
volatile uint32_t edge_count;
volatile uint32_t fault;

void setup(void);
void servo_tick(void);
void dir_edge(void);
int main(void);

static void hash(uint32_t word)
{
    edge_hash = (edge_hash ^ word) * 16777619U; /* FNV-1a, a word at a time */
}

static void feed(void)
{
    while (fed < SEGMENTS && axes[0].queue_count < ST_QUEUE_DEPTH / 2) {
        for (int32_t axis = 0; axis < AXES; axis++) {
            if (st_push(axes, queue, axis, displacement_units(axis, fed), 0, SEGMENT_TICKS) != ST_ACCEPTED) {
                fault = 1;
            }
        }
        fed++;
    }
}

static void set_up_axes(void)
{
    group.rate_from_q16 = ST_FULL_RATE_Q16;
    group.rate_to_q16 = ST_FULL_RATE_Q16;
    for (int32_t axis = 0; axis < AXES; axis++) {
        axes[axis].microsteps = 16;
        axes[axis].duration_ticks = 1;
        axes[axis].last_rise_counts = ST_NEVER_COUNTS;
        axes[axis].steplen_counts = 2376; /* 33 us: the TB6560 with 330 pF */
        axes[axis].stepspace_counts = 2424;
        axes[axis].dirsetup_counts = 1080;
        axes[axis].dirhold_counts = 1080;
        axes[axis].rate_limit_q16_per_ms = 15 * ST_STEP_Q16;
    }
    feed();
    for (int32_t axis = 0; axis < AXES; axis++) {
        if (!st_next_segment(axes, queue, axis)) {
            fault = 1;
        }
    }
}

/* Wait for a bit of a register; without it (an emulator, a missing crystal) go on with the clock that runs. */
static uint32_t wait_for(const reg *where, uint32_t mask, uint32_t value)
{
    for (uint32_t i = 0; i < STARTUP_TRIES; i++) {
        if ((*where & mask) == value) {
            return 1;
        }
    }
    return 0;
}

/* 72 MHz from a crystal of 8 MHz: PLL times 9, APB1 at 36 MHz, whose timers run at 72; two wait states of the flash. */
static void set_up_clock(void)
{
    FLASH_ACR = 0x12U;
    RCC_CR |= 1U << 16;
    if (wait_for(&RCC_CR, 1U << 17, 1U << 17) != 0U) {
        RCC_CFGR = (7U << 18) | (1U << 16) | (4U << 8);
        RCC_CR |= 1U << 24;
        if (wait_for(&RCC_CR, 1U << 25, 1U << 25) != 0U) {
            RCC_CFGR |= 2U;
            (void)wait_for(&RCC_CFGR, 0xCU, 0x8U);
        }
    }
    RCC_AHBENR |= 1U;
    RCC_APB2ENR |= (1U << 11) | (1U << 3) | (1U << 2) | 1U;
    RCC_APB1ENR |= 7U;
}

/* CLK pins are alternate outputs (1011 in their four bits), DIR pins plain ones (0011), all push-pull at 50 MHz. */
static void set_up_pin(gpio *port, uint32_t pin, uint32_t mode)
{
    const uint32_t shift = (pin & 7U) * 4U;
    reg *const cr = &port->cr[pin >> 3];
    *cr = (*cr & ~(0xFU << shift)) | (mode << shift);
}

static void set_mode(const output *out, uint32_t mode)
{
    reg *const ccmr = &out->clock->ccmr[out->channel >> 1];
    const uint32_t shift = (out->channel & 1U) * 8U + 4U;
    *ccmr = (*ccmr & ~(7U << shift)) | (mode << shift);
}

static void set_up_timers(void)
{
    timer *const players[] = {TIM2, TIM3, TIM4};
    set_up_pin(GPIOA, 1, 0xB);
    set_up_pin(GPIOA, 2, 0xB);
    set_up_pin(GPIOA, 6, 0xB);
    set_up_pin(GPIOB, 0, 0xB);
    set_up_pin(GPIOB, 1, 0xB);
    set_up_pin(GPIOB, 7, 0xB);
    set_up_pin(GPIOB, 8, 0xB);
    for (uint32_t i = 0; i < AXES; i++) {
        const output *const out = &outputs[i];
        set_up_pin(out->dir_port, out->dir_pin, 0x3);
        set_mode(out, 4); /* force low once: toggling begins at a known level */
        out->clock->ccer |= 1U << (4U * out->channel);
        out->clock->dier |= 1U << (9U + out->channel); /* a match asks the DMA for the next compare value */
        DMA1_CHANNEL[out->dma].cpar = (uint32_t)(uintptr_t)&out->clock->ccr[out->channel];
    }
    for (uint32_t i = 0; i < 3U; i++) {
        players[i]->arr = 0xFFFF;
    }
    TIM2->dier |= 1U << 1; /* its first channel has no pin: its interrupt writes DIR */
    TIM1->arr = ST_TICK_COUNTS - 1;
    TIM1->cnt = LEAD_COUNTS;
    TIM1->dier = 1;
    NVIC_ISER0 = (1U << 25) | (1U << 28);
    /* TIM2 is the master whose enable starts the others in the same count: TIM3 and TIM4 see it as ITR1. */
    TIM2->cr2 = 1U << 4;
    TIM3->smcr = (1U << 4) | 6U;
    TIM4->smcr = (1U << 4) | 6U;
    TIM1->smcr = (1U << 4) | 6U;
    TIM2->cr1 = 1;
}

/* Give a channel its list of the tick that begins: the first value by hand, the others by DMA; none freezes it. */
static void hand_out(uint32_t axis)
{
    const output *const out = &outputs[axis];
    dma_channel *const dma = &DMA1_CHANNEL[out->dma];
    const uint16_t *const values = played[half][axis];
    dma->ccr = 0;
    set_mode(out, 0);
    if (counts[axis] > 0U) {
        out->clock->ccr[out->channel] = values[0];
        dma->cmar = (uint32_t)(uintptr_t)&values[1];
        dma->cndtr = counts[axis] - 1U;
        dma->ccr = (1U << 10) | (1U << 8) | (1U << 7) | (1U << 4) | 1U; /* 16 bits, memory to timer */
        out->clock->sr = ~(2U << out->channel);
        set_mode(out, 3); /* toggle at a match */
    }
}

/* True while the last edge of a channel's list is still to come. */
static uint32_t busy(uint32_t axis)
{
    const output *const out = &outputs[axis];
    const uint16_t ahead = (uint16_t)(out->clock->ccr[out->channel] - out->clock->cnt);
    const uint32_t toggling = (out->clock->ccmr[out->channel >> 1] >> ((out->channel & 1U) * 8U + 4U)) & 7U;
    return toggling == 3U && ((DMA1_CHANNEL[out->dma].cndtr & 0xFFFFU) != 0U || ahead < LEAD_COUNTS) ? 1U : 0U;
}

/* Exchange the lists. A channel with an edge within the lead is exchanged after it: its next one is 33 us away. */
static void exchange(void)
{
    uint32_t left = (1U << AXES) - 1U;
    for (uint32_t tries = 0; left != 0U && tries < EXCHANGE_TRIES; tries++) {
        for (uint32_t axis = 0; axis < AXES; axis++) {
            if ((left & (1U << axis)) != 0U && busy(axis) == 0U) {
                hand_out(axis);
                left &= ~(1U << axis);
            }
        }
    }
    half ^= 1U;
}

/* TIM2's interrupt: write the DIR pins whose time has come, and wake up for the next. */
void dir_edge(void)
{
    uint16_t nearest = 0x7FFF;
    const uint16_t now = (uint16_t)TIM2->cnt;
    TIM2->sr = ~2U;
    for (uint32_t axis = 0; axis < AXES; axis++) {
        if ((dir_waiting & (1U << axis)) == 0U) {
            continue;
        }
        const uint16_t ahead = (uint16_t)((dir_words[axis] >> 1) + ST_TICK_COUNTS - now);
        if (ahead < 72U || ahead > 0x8000U) {
            const uint32_t pin = 1U << outputs[axis].dir_pin;
            outputs[axis].dir_port->bsrr = (dir_words[axis] & 1U) != 0U ? pin : pin << 16;
            dir_waiting &= (uint8_t)~(1U << axis);
        } else if (ahead < nearest) {
            nearest = ahead;
        }
    }
    TIM2->ccr[0] = (uint16_t)(now + nearest);
}

/* Compute a tick. Its edges are played one tick after their time. */
static void compute(void)
{
    uint32_t *clk[AXES];
    uint32_t *direction[AXES];
    for (int32_t axis = 0; axis < AXES; axis++) {
        clk[axis] = clk_rows[axis];
        direction[axis] = direction_rows[axis];
        axes[axis].clk_edges = 0;
        axes[axis].dir_edges = 0;
    }
    const st_advance_result result = st_advance(axes, before, queue, &group, clk, direction, AXES, tick, tick + 1);
    tick = result.reached;
    for (int32_t axis = 0; axis < AXES; axis++) {
        if (axes[axis].event == ST_EVENT_UNDERRUN || axes[axis].event == ST_EVENT_LATE_STEP) {
            fault = 2;
        }
        counts[axis] = (uint8_t)axes[axis].clk_edges;
        edge_count += counts[axis];
        for (int32_t i = 0; i < axes[axis].clk_edges; i++) {
            hash(clk_rows[axis][i]);
            played[half][axis][i] = (uint16_t)(clk_rows[axis][i] + ST_TICK_COUNTS);
        }
        for (int32_t i = 0; i < axes[axis].dir_edges; i++) {
            hash(direction_rows[axis][i]);
            dir_words[axis] = direction_rows[axis][i];
            dir_waiting |= (uint8_t)(1U << axis);
        }
    }
}

/* TIM1's interrupt, 10 us before each tick. */
void servo_tick(void)
{
    TIM1->sr = 0;
    exchange();
    feed();
    compute();
    if (dir_waiting != 0U) {
        dir_edge();
    }
}

void setup(void)
{
    set_up_clock();
    set_up_axes();
    set_up_timers();
}

int main(void)
{
    setup();
    for (;;) {
        __asm volatile("wfi");
    }
}
