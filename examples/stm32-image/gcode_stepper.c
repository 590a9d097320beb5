/*
 * Two axes by G-code lines over USART1, such as "G0 X120 Y-40" in steps: STEP PA0 and PA2, DIR PA1 and PA3, ENABLE PA4.
 *
 * The main loop reads a line, lets both axes move at once, and answers "ok" when they are there; "M114" answers where
 * they are, anything else "error". TIM2 counts at 2 MHz and never stops; compare 1 and 2 are the next edge of each axis.
 * Built with -DFAULT, a line is handled with interrupts off until its moves have begun and "busy" is sent: edges of an
 * axis that still moves come too late, and the counter has passed the next one.
 */
#include "chip.h"

enum { AXES = 2, INTERVAL = 600, HIGH = 24, SETUP = 400, LINE = 32 }; /* in ticks of 0.5 us; bytes */

typedef struct {
    uint32_t step, dir; /* pins */
    int32_t left, position;
    uint8_t high, forward;
} axis;

static volatile axis axes[AXES] = {{.step = 1u << 0, .dir = 1u << 1}, {.step = 1u << 2, .dir = 1u << 3}};
static uint32_t lines;

static void edge(unsigned n)
{
    volatile axis *a = &axes[n];
    a->high = !a->high;
    if (a->high) {
        GPIOA_BSRR = a->step;
        TIM2_CCR(n) = (TIM2_CCR(n) + HIGH) & 0xFFFF;
        return;
    }
    GPIOA_BSRR = a->step << 16;
    a->position += a->forward ? 1 : -1;
    if (--a->left == 0) {
        TIM2_DIER &= ~(2u << n);
        return;
    }
    TIM2_CCR(n) = (TIM2_CCR(n) + INTERVAL - HIGH) & 0xFFFF;
}

void tim2(void)
{
    uint32_t status = TIM2_SR & TIM2_DIER;
    TIM2_SR = ~status;
    for (unsigned n = 0; n < AXES; n++) {
        if (status & (2u << n)) {
            edge(n);
        }
    }
}

static void move_by(unsigned n, int32_t steps)
{
    volatile axis *a = &axes[n];
    if (steps == 0) {
        return;
    }
    a->forward = steps > 0;
    a->left = steps > 0 ? steps : -steps;
    GPIOA_BSRR = a->forward ? a->dir : a->dir << 16;
    TIM2_CCR(n) = (TIM2_CNT + SETUP) & 0xFFFF;
    TIM2_SR = ~(2u << n);
    TIM2_DIER |= 2u << n;
}

static void say_number(int32_t value)
{
    char text[12];
    char *at = text + sizeof text - 1;
    uint32_t rest = value < 0 ? 0u - (uint32_t)value : (uint32_t)value;
    *at = 0;
    do {
        *--at = (char)('0' + rest % 10);
        rest /= 10;
    } while (rest);
    if (value < 0) {
        *--at = '-';
    }
    uart_say(at);
}

/* Return the number behind a letter of a line; 0 without the letter. */
static int32_t word_of(const char *line, char letter)
{
    int32_t value = 0;
    while (*line && *line != letter) {
        line++;
    }
    if (!*line) {
        return 0;
    }
    int negative = *++line == '-';
    for (line += negative; *line >= '0' && *line <= '9'; line++) {
        value = 10 * value + (*line - '0');
    }
    return negative ? -value : value;
}

static void obey(const char *line)
{
    lines++;
    if (line[0] == 'G') {
        for (unsigned n = 0; n < AXES; n++) {
#ifdef FAULT
            __asm volatile("cpsid i" ::: "memory");
            move_by(n, word_of(line, n ? 'Y' : 'X'));
            uart_say("busy\n");
            __asm volatile("cpsie i" ::: "memory");
#else
            move_by(n, word_of(line, n ? 'Y' : 'X'));
#endif
        }
        while (axes[0].left || axes[1].left) {
            WAIT_FOR_INTERRUPT();
        }
        uart_say("ok\n");
    } else if (line[0] == 'M') {
        uart_say("X");
        say_number(axes[0].position);
        uart_say(" Y");
        say_number(axes[1].position);
        uart_say("\nok\n");
    } else {
        uart_say("error\n");
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
    char line[LINE];
    for (unsigned used = 0;;) {
        while (!(USART1_SR & 0x20)) {
        }
        char byte = (char)USART1_DR;
        if (byte == '\n' || byte == '\r') {
            line[used] = 0;
            if (used) {
                obey(line);
            }
            used = 0;
        } else if (used < LINE - 1) {
            line[used++] = byte;
        }
    }
}
