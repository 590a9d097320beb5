/* Vector table and start-up: copy initialised data, clear the rest, call main. */
#include <stdint.h>

extern uint32_t data_source, data_begin, data_end, bss_begin, bss_end, stack_top;
int main(void);
void servo_tick(void);
void dir_edge(void);
void reset(void);
void stop(void);

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
}

/* Any fault or unexpected interrupt: stay here, where a debugger finds it. */
void stop(void)
{
    for (;;) {
    }
}

typedef void (*vector)(void);

/* 16 of the core and the F103's interrupts up to TIM2 (28); TIM1_UP is 25. */
__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    vector vectors[15 + 29];
} table = {&stack_top, {[0] = reset, [1 ... 14] = stop, [15 ... 39] = stop, [40] = servo_tick, [41 ... 42] = stop, [43] = dir_edge}};
