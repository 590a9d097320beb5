/*
 * Two axes by DMA: each update of TIM3, every 4 us, lets channel 3 of DMA1 write a word to GPIOA's BSRR, which sets and
 * resets pins. STEP PA0 and PA2, DIR PA1 and PA3, ENABLE PA4.
 *
 * The words are a circular buffer of two halves. When one half has been written, the interrupt fills it anew with the
 * steps of the next 256 us, from an accumulator of each axis' phase. So no interrupt can move an edge.
 * Built with -DFAULT, TIM3's clock is taken for PCLK1, 36 MHz; it is twice that as APB1 is divided: pulses of 2 us.
 */
#include "chip.h"

enum { AXES = 2, SLOTS = 64, SLOT_HZ = 250000, ACCELERATION = 200000, RATE_MAX = 5000, RATE_MIN = 400 };
#ifdef FAULT
enum { TIMER_HZ = 36000000 };
#else
enum { TIMER_HZ = 72000000 };
#endif

typedef struct {
    uint32_t step, dir; /* pins */
    int32_t target, position;
    uint32_t left, rate; /* steps of this motion; steps/s */
    uint32_t phase;      /* 2^32 is a step */
    uint8_t forward, high;
} axis;

static volatile axis axes[AXES] = {{.step = 1u << 0, .dir = 1u << 1}, {.step = 1u << 2, .dir = 1u << 3}};
static uint32_t words[2 * SLOTS];

/* Add an axis to a half of the buffer: DIR in the first slot, its steps in the later ones. */
static void fill(volatile axis *axis_now, uint32_t *half)
{
    axis a = *axis_now;
    if (a.left == 0 && a.target != a.position) {
        a.forward = a.target > a.position;
        a.left = (uint32_t)(a.forward ? a.target - a.position : a.position - a.target);
        a.rate = 0;
        a.phase = 0;
        half[0] |= a.forward ? a.dir : a.dir << 16;
    }
    if (a.left <= a.rate * a.rate / (2 * ACCELERATION)) { /* the distance in which it stops */
        a.rate = a.rate > RATE_MIN ? a.rate - ACCELERATION / (SLOT_HZ / SLOTS) : a.rate;
    } else if (a.rate < RATE_MAX) {
        a.rate += ACCELERATION / (SLOT_HZ / SLOTS);
    }
    uint32_t speed = a.rate * (uint32_t)(0x100000000ull / SLOT_HZ);
    for (unsigned slot = 0; slot < SLOTS; slot++) {
        if (a.high) {
            half[slot] |= a.step << 16;
            a.high = 0;
        }
        uint32_t before = a.phase;
        a.phase += speed;
        if (a.phase < before && a.left) {
            half[slot] |= a.step;
            a.high = 1;
            a.left--;
            a.position += a.forward ? 1 : -1;
        }
    }
    *axis_now = a;
}

void dma1_channel3(void)
{
    uint32_t flags = DMA1_ISR >> 8;
    DMA1_IFCR = (flags & 6) << 8;
    uint32_t *half = flags & 4 ? words : words + SLOTS; /* HTIF: the first half has been written */
    for (unsigned slot = 0; slot < SLOTS; slot++) {
        half[slot] = 0;
    }
    for (unsigned n = 0; n < AXES; n++) {
        fill(&axes[n], half);
    }
}

static void move_to(int32_t first, int32_t second)
{
    axes[0].target = first;
    axes[1].target = second;
    for (unsigned n = 0; n < AXES; n++) {
        while (axes[n].position != axes[n].target || axes[n].high) {
            WAIT_FOR_INTERRUPT();
        }
    }
}

int main(void)
{
    clock_72_mhz();
    RCC_APB1ENR |= 1u << 1; /* TIM3 */
    RCC_AHBENR |= 1;        /* DMA1 */
    GPIOA_CRL = 0x44433333; /* PA0 to PA4 are outputs */
    GPIOA_BSRR = 1u << 4;
    uart_begin();
    DMA1_CPAR(3) = (uint32_t)&GPIOA_BSRR;
    DMA1_CMAR(3) = (uint32_t)words;
    DMA1_CNDTR(3) = 2 * SLOTS;
    DMA1_CCR(3) = 2u << 10 | 2u << 8 | 1u << 7 | 1u << 5 | 1u << 4 | 1u << 2 | 1u << 1 | 1;
    NVIC_ISER0 = 1u << 13;
    TIM3_PSC = 0;
    TIM3_ARR = TIMER_HZ / SLOT_HZ - 1;
    TIM3_EGR = 1;
    TIM3_DIER = 1u << 8; /* UDE: a request at each update */
    TIM3_CR1 = 1;
    uart_say("ready\n");
    move_to(150, -100);
    move_to(0, 0);
    uart_say("done\n");
    for (;;) {
        WAIT_FOR_INTERRUPT();
    }
}
