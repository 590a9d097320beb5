/* Vector table and start-up: copy initialised data, clear the rest, call main. */
#include <stdint.h>

extern uint32_t data_source, data_begin, data_end, bss_begin, bss_end, stack_top;
int main(void);
void reset(void);
void stop(void);
__attribute__((weak)) void systick(void);
__attribute__((weak)) void pend_sv(void);
__attribute__((weak)) void tim2(void);
__attribute__((weak)) void can_rx0(void);
__attribute__((weak)) void dma1_channel3(void);

void reset(void)
{
    const uint32_t *from = &data_source;
    for (uint32_t *to = &data_begin; to < &data_end; to++) {
        *to = *from++;
    }
    for (uint32_t *to = &bss_begin; to < &bss_end; to++) {
        *to = 0;
    }
    (void)main();
    stop();
}

void stop(void)
{
    for (;;) {
    }
}

void systick(void) { stop(); }
void pend_sv(void) { stop(); }
void tim2(void) { stop(); }
void can_rx0(void) { stop(); }
void dma1_channel3(void) { stop(); }

typedef void (*vector)(void);

/* 16 of the core and the interrupts up to TIM2, which is 28. */
__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    vector vectors[15 + 29];
} table = {&stack_top,
           {[0] = reset, [1 ... 12] = stop, [13] = pend_sv, [14] = systick, [15 ... 27] = stop, [28] = dma1_channel3,
            [29 ... 34] = stop, [35] = can_rx0, [36 ... 42] = stop, [43] = tim2}};
