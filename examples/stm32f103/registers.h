/* The registers of an STM32F103 that this example uses. Source: ST, reference manual RM0008. */
#ifndef REGISTERS_H
#define REGISTERS_H

#include <stdint.h>

typedef volatile uint32_t reg;

typedef struct {
    reg cr1, cr2, smcr, dier, sr, egr, ccmr[2], ccer, cnt, psc, arr, rcr, ccr[4];
} timer;

typedef struct {
    reg cr[2], idr, odr, bsrr, brr, lckr;
} gpio;

typedef struct {
    reg ccr, cndtr, cpar, cmar, reserved;
} dma_channel;

#define RCC_CR (*(reg *)0x40021000U)
#define RCC_CFGR (*(reg *)0x40021004U)
#define RCC_AHBENR (*(reg *)0x40021014U)
#define RCC_APB2ENR (*(reg *)0x40021018U)
#define RCC_APB1ENR (*(reg *)0x4002101CU)
#define FLASH_ACR (*(reg *)0x40022000U)
#define NVIC_ISER0 (*(reg *)0xE000E100U)
#define NVIC_IPR ((volatile uint8_t *)0xE000E400U)
#define TIM1_UP_IRQ 25U
#define TIM2_IRQ 28U
#define DMA1_CHANNEL ((dma_channel *)0x40020008U)
#define TIM1 ((timer *)0x40012C00U)
#define TIM2 ((timer *)0x40000000U)
#define TIM3 ((timer *)0x40000400U)
#define TIM4 ((timer *)0x40000800U)
#define GPIOA ((gpio *)0x40010800U)
#define GPIOB ((gpio *)0x40010C00U)

#endif
