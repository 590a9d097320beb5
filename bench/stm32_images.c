/*
 * Images whose speed on the emulated STM32F103 is measured, built with the files of examples/stm32-image:
 * four axes at 10 000 steps/s by TIM2's compare interrupts, whose main loop sleeps, or polls with -DPOLL;
 * or with -DSYSTICK one axis at 2000 steps/s by SysTick.
 */
#include "chip.h"

#define SLEEP WAIT_FOR_INTERRUPT()
#ifdef POLL
#undef SLEEP
#define SLEEP
#endif

volatile uint32_t steps;

void tim2(void)
{
    uint32_t status = TIM2_SR & 0x1E;
    TIM2_SR = ~status;
    for (unsigned n = 0; n < 4; n++) {
        if (status & (2u << n)) {
            GPIOA_BSRR = 1u << n;
            TIM2_CCR(n) = (TIM2_CCR(n) + 7200) & 0xFFFF;
            steps++;
            GPIOA_BSRR = 0x10000u << n;
        }
    }
}

void systick(void)
{
    GPIOA_BSRR = 1;
    steps++;
    GPIOA_BSRR = 0x10000;
}

int main(void)
{
    clock_72_mhz();
    GPIOA_CRL = 0x33333333;
#ifdef SYSTICK
    SYST_RVR = 36000 - 1;
    SYST_CVR = 0;
    SYST_CSR = 7;
#else
    TIM2_EGR = 1;
    for (unsigned n = 0; n < 4; n++) {
        TIM2_CCR(n) = 1000 + 1800 * n;
    }
    TIM2_SR = 0;
    TIM2_DIER = 0x1E;
    NVIC_ISER0 = 1u << 28;
    TIM2_CR1 = 1;
#endif
    uint32_t seen = 0;
    for (;;) {
        SLEEP;
        seen ^= steps;
        __asm volatile("" ::"r"(seen));
    }
}
