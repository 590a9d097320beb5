/*
 * Two axes by TIM2's compare interrupts, as in compare_stepper.c, that take their moves over CAN at 1 Mbit/s:
 * STEP PA0 and PA2, DIR PA1 and PA3, ENABLE PA4; CAN_RX PA11, CAN_TX PA12.
 *
 * Frame 200h + axis: target in steps (int32) and a CRC-16/CCITT of these four bytes. Frame 180h + axis: the position
 * that the axis has reached. A target that comes during a motion is taken when the axis has stopped.
 * Built with -DFAULT, CAN's interrupt preempts the timer's: its CRC holds up the beginning of a pulse, not its end.
 */
#include "chip.h"

enum { AXES = 2, FIRST = 8000, FASTEST = 250, HIGH = 10, SETUP = 400 }; /* in ticks of 0.5 us */

typedef struct {
    uint32_t step, dir; /* pins */
    int32_t target, position;
    int32_t left; /* steps of this motion */
    int32_t ramp; /* steps since standstill by which it has sped up */
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
    if (!a->high) {
        GPIOA_BSRR = a->step;
        a->high = 1;
        TIM2_CCR(n) = (TIM2_CCR(n) + HIGH) & 0xFFFF;
        return;
    }
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
    a->forward = steps > 0;
    a->left = steps > 0 ? steps : -steps;
    a->ramp = 0;
    a->interval_q8 = FIRST * 256;
    a->running = 1;
    GPIOA_BSRR = a->forward ? a->dir : a->dir << 16;
    TIM2_CCR(n) = (TIM2_CNT + SETUP) & 0xFFFF;
    TIM2_SR = ~(2u << n);
    TIM2_DIER |= 2u << n;
}

static uint32_t crc16(uint32_t word)
{
    uint32_t crc = 0xFFFF;
    for (unsigned byte = 0; byte < 4; byte++) {
        crc ^= (word >> 8 * byte & 0xFF) << 8;
        for (unsigned bit = 0; bit < 8; bit++) {
            crc = crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1;
        }
    }
    return crc & 0xFFFF;
}

void can_rx0(void)
{
    uint32_t n = (CAN_RI0R >> 21) - 0x200, target = CAN_RDL0R, crc = CAN_RDH0R & 0xFFFF;
    uint32_t length = CAN_RDT0R & 15;
    CAN_RF0R = 1u << 5;
    if (n < AXES && length == 6 && crc16(target) == crc) {
        axes[n].target = (int32_t)target;
    }
}

static void send_position(unsigned n)
{
    while (!(CAN_TSR & (7u << 26))) {
    }
    unsigned mailbox = CAN_TSR >> 24 & 3; /* CODE: one that is empty */
    CAN_TDTR(mailbox) = 4;
    CAN_TDLR(mailbox) = (uint32_t)axes[n].position;
    CAN_TIR(mailbox) = (0x180 + n) << 21 | 1;
}

static void can_begin(void)
{
    RCC_APB1ENR |= 1u << 25;
    GPIOA_CRH = (GPIOA_CRH & ~0xFF000u) | 0xB4000u; /* PA11 input, PA12 output of CAN */
    CAN_MCR = 1u << 6 | 1;                          /* ABOM, INRQ; SLEEP is 0 */
    while ((CAN_MSR & 3) != 1) {
    }
    CAN_BTR = 1u << 20 | 14u << 16 | 1; /* 36 MHz / 2 / (1 + 15 + 2) */
    CAN_FMR |= 1;
    CAN_FS1R = 1; /* bank 0: 32 bits, identifiers 200h to 20Fh, no remote frames */
    CAN_FR(0, 1) = 0x200u << 21;
    CAN_FR(0, 2) = 0x7F0u << 21 | 6;
    CAN_FA1R = 1;
    CAN_FMR &= ~1u;
    CAN_IER = 1u << 1;
    CAN_MCR &= ~1u;
    while (CAN_MSR & 1) {
    }
}

static unsigned moving;

static int is_due(unsigned n)
{
    return !axes[n].running && (moving >> n & 1 || axes[n].target != axes[n].position);
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
#ifdef FAULT
    NVIC_IPR(28) = 0x80;
#else
    NVIC_IPR(20) = 0x80;
#endif
    NVIC_ISER0 = 1u << 28 | 1u << 20;
    TIM2_CR1 = 1;
    can_begin();
    uart_say("ready\n");
    for (;;) {
        for (unsigned n = 0; n < AXES; n++) {
            if (is_due(n) && moving >> n & 1) {
                moving &= ~(1u << n);
                send_position(n);
            }
            if (is_due(n)) {
                moving |= 1u << n;
                move_to(n, axes[n].target);
            }
        }
        __asm volatile("cpsid i"); /* an interrupt from here on ends the sleep */
        if (!is_due(0) && !is_due(1)) {
            WAIT_FOR_INTERRUPT();
        }
        __asm volatile("cpsie i");
    }
}
