/*
 * What an image sees of the world through ADC1, SPI1, I2C1 and the flash, told on USART1 as hexadecimal numbers:
 * the supply at PC0, a word of an SPI device at PA4 to PA7, two bytes of an I2C device 50h, and how often it has run.
 * Built by `make wiring.elf` in a copy of examples/stm32-image.
 */
#include "chip.h"

#define ADC_SR WORD(0x40012400)
#define ADC_CR2 WORD(0x40012408)
#define ADC_SQR3 WORD(0x40012434)
#define ADC_DR WORD(0x4001244C)
#define SPI_CR1 WORD(0x40013000)
#define SPI_SR WORD(0x40013008)
#define SPI_DR WORD(0x4001300C)
#define I2C_CR1 WORD(0x40005400)
#define I2C_CR2 WORD(0x40005404)
#define I2C_DR WORD(0x40005410)
#define I2C_SR1 WORD(0x40005414)
#define I2C_SR2 WORD(0x40005418)
#define I2C_CCR WORD(0x4000541C)
#define FLASH_KEYR WORD(0x40022004)
#define FLASH_CR WORD(0x40022010)
#define FLASH_AR WORD(0x40022014)
#define PAGE 0x0800FC00
#define HALF(address) (*(volatile uint16_t *)(address))

static void say(const char *name, uint32_t value)
{
    char text[10];
    uart_say(name);
    for (unsigned i = 0; i < 8; i++) {
        text[i] = "0123456789ABCDEF"[value >> (28 - 4 * i) & 15];
    }
    text[8] = '\n';
    text[9] = 0;
    uart_say(text);
}

static void until(volatile uint32_t *status, uint32_t flag)
{
    while (!(*status & flag)) {
    }
}

static uint32_t converted(uint32_t channel)
{
    ADC_SQR3 = channel;
    ADC_CR2 |= 1u << 22;
    until(&ADC_SR, 2);
    return ADC_DR;
}

static uint32_t read_i2c(void)
{
    I2C_CR2 = 36;
    I2C_CCR = 180;
    I2C_CR1 = 1;
    I2C_CR1 = 0x101;
    until(&I2C_SR1, 1);
    I2C_DR = 0xA0;
    until(&I2C_SR1, 2);
    (void)I2C_SR2;
    I2C_DR = 0x12;
    until(&I2C_SR1, 4);
    I2C_CR1 = 0xD01; /* START, ACK, POS */
    until(&I2C_SR1, 1);
    I2C_DR = 0xA1;
    until(&I2C_SR1, 2);
    (void)I2C_SR2;
    I2C_CR1 = 0x801;
    until(&I2C_SR1, 4);
    I2C_CR1 = 0x201;
    uint32_t first = I2C_DR;
    return first << 8 | I2C_DR;
}

static uint32_t runs(void)
{
    uint16_t before = HALF(PAGE);
    uint16_t now = before == 0xFFFF ? 1 : (uint16_t)(before + 1);
    FLASH_KEYR = 0x45670123;
    FLASH_KEYR = 0xCDEF89AB;
    FLASH_CR = 2;
    FLASH_AR = PAGE;
    FLASH_CR = 2 | 64;
    FLASH_CR = 1;
    HALF(PAGE) = now;
    FLASH_CR = 128;
    return HALF(PAGE);
}

int main(void)
{
    clock_72_mhz();
    RCC_CFGR |= 2u << 14; /* ADC: 12 MHz */
    RCC_APB2ENR |= 1u << 4 | 1u << 9 | 1u << 12;
    RCC_APB1ENR |= 1u << 21;
    GPIOA_CRL = 0xB4B34444;
    GPIOA_BSRR = 1u << 4;
    uart_begin();
    ADC_CR2 = 1;
    ADC_CR2 = 1u << 23 | 1u << 20 | 7u << 17 | 1;
    say("supply ", converted(10));
    say("temperature ", converted(16));
    SPI_CR1 = 0xB54; /* 16 bits, SSM, SSI, SPE, PCLK2 / 8, MSTR */
    GPIOA_BRR = 1u << 4;
    SPI_DR = 0x1234;
    until(&SPI_SR, 1);
    say("spi ", SPI_DR);
    GPIOA_BSRR = 1u << 4;
    say("i2c ", read_i2c());
    say("runs ", runs());
    uart_say("done\n");
    for (;;) {
        WAIT_FOR_INTERRUPT();
    }
}
