/*
 * Seven axes on an STM32F103C8: the kernel in the servo interrupt, edges played by TIM2, TIM3, TIM4 and DMA1.
 *
 * No silicon has seen this program. Its tests run it on an emulated core, with a model of timers and DMA made from ST's
 * reference manual, and compare the pins with StepTwin's edges. See docs/firmware.md for the plan.
 */
#include <stddef.h>

#include "motion.h"
#include "registers.h"
#include "steptwin_kernel.h"

enum {
    EDGES = 20,         /* of one axis: 15 kHz make 8 in a tick, and a step that waits may be a tick late */
    DIR_EDGES = 4,      /* of one axis that wait to be played: a power of two */
    LEAD_COUNTS = 1440, /* the servo interrupt comes 20 us before its tick */
    DELAY_COUNTS = 2 * ST_TICK_COUNTS, /* an edge is played two ticks after its time: computed in one, listed in one */
    DIR_EARLY_COUNTS = 72,
    DIR_NEAREST_MAX = 0x7FFF,
    STARTUP_TRIES = 100000
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
static uint32_t clk_rows[AXES][EDGES]; /* the edges of the last tick, after those that fall into a later one */
static uint32_t direction_rows[AXES][2];
static uint16_t played[2][AXES][EDGES]; /* compare values of the tick that is played, and of the next */
static uint8_t counts[AXES];            /* number of edges of the next tick */
static uint8_t half;                    /* the half of `played` that is filled */
static uint32_t boundary;               /* time at which the tick begins that the last servo interrupt was for */
static int64_t tick;
static int32_t fed;

/* DIR edges that wait, twice the time plus the level. The servo interrupt adds, the DIR interrupt above it takes. */
static volatile uint32_t dir_words[AXES][DIR_EDGES];
static volatile uint8_t dir_added[AXES];
static volatile uint8_t dir_taken[AXES];

/* What an emulator or a debugger reads: a hash of all edges so far, their number, and the first fault. */
volatile uint32_t edge_hash = 2166136261U;
volatile uint32_t edge_count;
volatile uint32_t fault;

enum { FAULT_REFUSED = 1, FAULT_KERNEL = 2, FAULT_LIST_LATE = 3, FAULT_TOO_MANY_EDGES = 4 };

void setup(void);
void servo_tick(void);
void dir_edge(void);
int main(void);

static void hash(uint32_t word)
{
    edge_hash = (edge_hash ^ word) * 16777619U; /* FNV-1a, a word at a time */
}

static void fail(uint32_t cause)
{
    if (fault == 0U) {
        fault = cause;
    }
}

static void feed(void)
{
    while (fed < SEGMENTS && axes[0].queue_count < ST_QUEUE_DEPTH / 2) {
        for (int32_t axis = 0; axis < AXES; axis++) {
            if (st_push(axes, queue, axis, displacement_units(axis, fed), 0, SEGMENT_TICKS) != ST_ACCEPTED) {
                fail(FAULT_REFUSED);
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
            fail(FAULT_REFUSED);
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
        DMA1_CHANNEL[out->dma].cpar = (uint32_t)(uintptr_t)&out->clock->ccr[out->channel];
    }
    for (uint32_t i = 0; i < 3U; i++) {
        players[i]->arr = 0xFFFF;
    }
    TIM2->dier |= 1U << 1; /* its first channel has no pin: its interrupt writes DIR */
    NVIC_IPR[TIM2_IRQ] = 0x40; /* above the servo interrupt, which takes a third of a tick */
    NVIC_IPR[TIM1_UP_IRQ] = 0x80;
    TIM1->arr = ST_TICK_COUNTS - 1;
    TIM1->cnt = LEAD_COUNTS;
    TIM1->dier = 1;
    NVIC_ISER0 = (1U << TIM1_UP_IRQ) | (1U << TIM2_IRQ);
    /* TIM2 is the master whose enable starts the others in the same count: TIM3 and TIM4 see it as ITR1. */
    TIM2->cr2 = 1U << 4;
    TIM3->smcr = (1U << 4) | 6U;
    TIM4->smcr = (1U << 4) | 6U;
    TIM1->smcr = (1U << 4) | 6U;
    TIM2->cr1 = 1;
}

/* Time at the 72 MHz timers, up to 0.45 ms before and after the boundary. */
static uint32_t now_counts(void)
{
    return boundary + (uint32_t)(int32_t)(int16_t)(uint16_t)(TIM2->cnt - boundary);
}

/* Give a channel its list of the tick that begins: the first value by hand, the others by DMA. Without one it is frozen:
   a stale compare value would match again after 910 us. Requests are off meanwhile, so that none is left over. */
static void hand_out(uint32_t axis)
{
    const output *const out = &outputs[axis];
    dma_channel *const dma = &DMA1_CHANNEL[out->dma];
    const uint16_t *const values = played[half][axis];
    const uint32_t request = 1U << (9U + out->channel);
    out->clock->dier &= ~request;
    dma->ccr = 0;
    set_mode(out, 0);
    if (counts[axis] > 0U) {
        out->clock->ccr[out->channel] = values[0];
        out->clock->sr = ~(2U << out->channel);
        dma->cmar = (uint32_t)(uintptr_t)&values[1];
        dma->cndtr = counts[axis] - 1U;
        dma->ccr = (1U << 10) | (1U << 8) | (1U << 7) | (1U << 4) | 1U; /* 16 bits, memory to timer */
        out->clock->dier |= request;
        set_mode(out, 3); /* toggle at a match */
    }
}

/* True while the last edge of a channel's list is still to come. All of a list is before its tick's end, so that it
   comes within the lead. */
static uint32_t busy(uint32_t axis)
{
    const output *const out = &outputs[axis];
    const uint16_t ahead = (uint16_t)(out->clock->ccr[out->channel] - out->clock->cnt);
    const uint32_t mode = (out->clock->ccmr[out->channel >> 1] >> ((out->channel & 1U) * 8U + 4U)) & 7U;
    return mode == 3U && ((DMA1_CHANNEL[out->dma].cndtr & 0xFFFFU) != 0U || ahead <= LEAD_COUNTS) ? 1U : 0U;
}

/* Exchange the lists. A channel with an edge within the lead is exchanged after it: its next one is 33 us away. */
static void exchange(void)
{
    uint32_t left = (1U << AXES) - 1U;
    while (left != 0U && (int32_t)(now_counts() - boundary) < LEAD_COUNTS) {
        for (uint32_t axis = 0; axis < AXES; axis++) {
            if ((left & (1U << axis)) != 0U && busy(axis) == 0U) {
                hand_out(axis);
                left &= ~(1U << axis);
            }
        }
    }
    if (left != 0U) {
        fail(FAULT_LIST_LATE);
    }
    half ^= 1U;
}

/* TIM2's interrupt: write the DIR pins whose time has come, and wake up for the next. */
void dir_edge(void)
{
    const uint32_t now = now_counts();
    int32_t nearest = DIR_NEAREST_MAX;
    TIM2->sr = ~2U;
    for (uint32_t axis = 0; axis < AXES; axis++) {
        while (dir_taken[axis] != dir_added[axis]) {
            const uint32_t word = dir_words[axis][dir_taken[axis] % DIR_EDGES];
            const int32_t ahead = (int32_t)((word & ~1U) + 2U * (DELAY_COUNTS - now)) / 2;
            if (ahead >= DIR_EARLY_COUNTS) {
                nearest = ahead < nearest ? ahead : nearest;
                break;
            }
            const uint32_t pin = 1U << outputs[axis].dir_pin;
            outputs[axis].dir_port->bsrr = (word & 1U) != 0U ? pin : pin << 16;
            dir_taken[axis]++;
        }
    }
    TIM2->ccr[0] = (uint16_t)(now + (uint32_t)nearest);
}

/* List the edges before the end of the tick just computed, and keep the others at the beginning of their row. */
static void list_edges(uint32_t axis)
{
    uint32_t *const row = clk_rows[axis];
    const int32_t placed = axes[axis].clk_edges;
    const uint32_t end = (uint32_t)(tick * ST_TICK_COUNTS);
    int32_t listed = 0;
    for (; listed < placed && (int32_t)(row[listed] - end) < 0; listed++) {
        played[half][axis][listed] = (uint16_t)(row[listed] + DELAY_COUNTS);
    }
    for (int32_t i = listed; i < placed; i++) {
        row[i - listed] = row[i];
    }
    counts[axis] = (uint8_t)listed;
    axes[axis].clk_edges = placed - listed;
}

static void add_dir_edges(uint32_t axis)
{
    for (int32_t i = 0; i < axes[axis].dir_edges; i++) {
        const uint8_t waiting = (uint8_t)(dir_added[axis] - dir_taken[axis]);
        if (waiting >= DIR_EDGES) {
            fail(FAULT_TOO_MANY_EDGES);
            return;
        }
        hash(direction_rows[axis][i]);
        dir_words[axis][dir_added[axis] % DIR_EDGES] = direction_rows[axis][i];
        dir_added[axis]++;
    }
    axes[axis].dir_edges = 0;
}

/* Compute a tick. */
static void compute(void)
{
    uint32_t *clk[AXES];
    uint32_t *direction[AXES];
    int32_t kept[AXES];
    for (int32_t axis = 0; axis < AXES; axis++) {
        clk[axis] = clk_rows[axis];
        direction[axis] = direction_rows[axis];
        kept[axis] = axes[axis].clk_edges;
    }
    const st_advance_result result = st_advance(axes, before, queue, &group, clk, direction, AXES, tick, tick + 1);
    tick = result.reached;
    for (uint32_t axis = 0; axis < AXES; axis++) {
        if (axes[axis].event == ST_EVENT_UNDERRUN || axes[axis].event == ST_EVENT_LATE_STEP) {
            fail(FAULT_KERNEL);
        }
        for (int32_t i = kept[axis]; i < axes[axis].clk_edges; i++) {
            hash(clk_rows[axis][i]);
            edge_count++;
        }
        list_edges(axis);
        add_dir_edges(axis);
    }
}

/* TIM1's interrupt, LEAD_COUNTS before each tick. */
void servo_tick(void)
{
    TIM1->sr = 0;
    boundary += ST_TICK_COUNTS;
    exchange();
    feed();
    compute();
    TIM2->egr = 2; /* the DIR interrupt looks for new edges */
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
