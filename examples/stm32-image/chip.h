/* The registers of an STM32F103 that the examples use, and its start-up: the clock at 72 MHz from 8 MHz. */
#ifndef CHIP_H
#define CHIP_H
#include <stdint.h>

#define WORD(address) (*(volatile uint32_t *)(address))

#define RCC_CR WORD(0x40021000)
#define RCC_CFGR WORD(0x40021004)
#define RCC_APB2ENR WORD(0x40021018)
#define RCC_APB1ENR WORD(0x4002101C)
#define FLASH_ACR WORD(0x40022000)
#define GPIOA_CRL WORD(0x40010800)
#define GPIOA_CRH WORD(0x40010804)
#define GPIOA_IDR WORD(0x40010808)
#define GPIOA_ODR WORD(0x4001080C)
#define GPIOA_BSRR WORD(0x40010810)
#define GPIOA_BRR WORD(0x40010814)
#define TIM2_CR1 WORD(0x40000000)
#define TIM2_DIER WORD(0x4000000C)
#define TIM2_SR WORD(0x40000010)
#define TIM2_EGR WORD(0x40000014)
#define TIM2_CNT WORD(0x40000024)
#define TIM2_PSC WORD(0x40000028)
#define TIM2_ARR WORD(0x4000002C)
#define TIM2_CCR(n) WORD(0x40000034 + 4 * (n))
#define TIM3_CR1 WORD(0x40000400)
#define TIM3_DIER WORD(0x4000040C)
#define TIM3_EGR WORD(0x40000414)
#define TIM3_PSC WORD(0x40000428)
#define TIM3_ARR WORD(0x4000042C)
#define CAN_MCR WORD(0x40006400)
#define CAN_MSR WORD(0x40006404)
#define CAN_TSR WORD(0x40006408)
#define CAN_RF0R WORD(0x4000640C)
#define CAN_IER WORD(0x40006414)
#define CAN_BTR WORD(0x4000641C)
#define CAN_TIR(n) WORD(0x40006580 + 16 * (n))
#define CAN_TDTR(n) WORD(0x40006584 + 16 * (n))
#define CAN_TDLR(n) WORD(0x40006588 + 16 * (n))
#define CAN_RI0R WORD(0x400065B0)
#define CAN_RDT0R WORD(0x400065B4)
#define CAN_RDL0R WORD(0x400065B8)
#define CAN_RDH0R WORD(0x400065BC)
#define CAN_FMR WORD(0x40006600)
#define CAN_FM1R WORD(0x40006604)
#define CAN_FS1R WORD(0x4000660C)
#define CAN_FA1R WORD(0x4000661C)
#define CAN_FR(bank, n) WORD(0x4000663C + 8 * (bank) + 4 * (n))
#define DMA1_ISR WORD(0x40020000)
#define DMA1_IFCR WORD(0x40020004)
#define DMA1_CCR(channel) WORD(0x40020008 + 20 * ((channel) - 1))
#define DMA1_CNDTR(channel) WORD(0x4002000C + 20 * ((channel) - 1))
#define DMA1_CPAR(channel) WORD(0x40020010 + 20 * ((channel) - 1))
#define DMA1_CMAR(channel) WORD(0x40020014 + 20 * ((channel) - 1))
#define RCC_AHBENR WORD(0x40021014)
#define USART1_SR WORD(0x40013800)
#define USART1_DR WORD(0x40013804)
#define USART1_BRR WORD(0x40013808)
#define USART1_CR1 WORD(0x4001380C)
#define SYST_CSR WORD(0xE000E010)
#define SYST_RVR WORD(0xE000E014)
#define SYST_CVR WORD(0xE000E018)
#define NVIC_ISER0 WORD(0xE000E100)
#define NVIC_IPR(irq) (*(volatile uint8_t *)(0xE000E400 + (irq)))
#define SCB_ICSR WORD(0xE000ED04)
#define SCB_SHPR(exception) (*(volatile uint8_t *)(0xE000ED14 + (exception)))
#define DEMCR WORD(0xE000EDFC)
#define DWT_CTRL WORD(0xE0001000)
#define DWT_CYCCNT WORD(0xE0001004)

static inline void clock_72_mhz(void)
{
    FLASH_ACR = 0x12; /* prefetch, two wait states */
    RCC_CR |= 1u << 16;
    while (!(RCC_CR & (1u << 17))) {
    }
    RCC_CFGR = 7u << 18 | 1u << 16 | 4u << 8; /* PLL: 8 MHz * 9; APB1: 36 MHz */
    RCC_CR |= 1u << 24;
    while (!(RCC_CR & (1u << 25))) {
    }
    RCC_CFGR |= 2;
    while ((RCC_CFGR & 0xC) != 8) {
    }
    RCC_APB2ENR = 1u << 14 | 1u << 2 | 1; /* USART1, port A, AFIO */
    RCC_APB1ENR = 1;                      /* TIM2 */
}

/* PA9 is TX of USART1: 115 200 baud. */
static inline void uart_begin(void)
{
    GPIOA_CRH = (GPIOA_CRH & ~0xF0u) | 0xB0u;
    USART1_BRR = 72000000 / 115200;
    USART1_CR1 = 1u << 13 | 1u << 3 | 1u << 2;
}

static inline void uart_say(const char *text)
{
    for (; *text; text++) {
        while (!(USART1_SR & 0x80)) {
        }
        USART1_DR = (uint8_t)*text;
    }
    while (!(USART1_SR & 0x40)) {
    }
}

#define WAIT_FOR_INTERRUPT() __asm volatile("wfi" ::: "memory")
#endif
