"""The registers of the peripherals as tables: place, reset value, bits that can be written, bits that are modelled.

A bit that can be written but is not modelled is counted when the firmware sets it. What no table has is counted at each
access. The sections are those of ST's reference manual RM0008, revision 21.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from steptwin.features.stm32.chip import cells as c
from steptwin.host.common.arrays import Int64Array

PLAIN, RCC, GPIO, AFIO, EXTI, TIMER, USART, IWDG, FLASH, CAN, DMA, ADC, WWDG, RTC, BKP, SPI, I2C = range(1, 18)
"""What acts on a write: nothing, or the functions of a module."""


class Register(NamedTuple):
    """A register of a kind of peripheral."""

    name: str
    offset: int
    reset: int = 0
    writable: int = 0
    modelled: int = -1
    """Bits whose effect is modelled, or which have none that a program could see; -1: all."""


class Peripheral(NamedTuple):
    """A peripheral: its name, section of RM0008, what acts on it, its number, base, clock and registers."""

    name: str
    section: str
    kind: int
    number: int
    base: int
    clock: tuple[int, int] | None
    """Offset in RCC and bit of its clock; None if it always runs."""
    registers: Sequence[Register]


_WORD, _HALF = 0xFFFFFFFF, 0xFFFF
_AHB, _APB2, _APB1 = 0x14, 0x18, 0x1C

_RCC = (
    Register("CR", 0x00, 0x83, 0x010D00F9, 0x010500F9),  # the clock security system is not modelled
    Register("CFGR", 0x04, 0, 0x07FFFFF3, 0x003FFFF3 | 0xC000),  # nor is the clock output MCO
    Register("CIR", 0x08, 0, 0x009F1F00, 0x009F0000),
    Register("APB2RSTR", 0x0C, 0, 0x38FFFD, 0),
    Register("APB1RSTR", 0x10, 0, 0x3AFEC9FF, 0),
    Register("AHBENR", 0x14, 0x14, 0x557),
    Register("APB2ENR", 0x18, 0, 0x38FFFD),
    Register("APB1ENR", 0x1C, 0, 0x3AFEC9FF),
    Register("BDCR", 0x20, 0, 0x18305),
    Register("CSR", 0x24, 0x0C000000, 0x01000001),
)
_FLASH = (
    Register("ACR", 0x00, 0x30, 0x1F),
    Register("KEYR", 0x04),
    Register("OPTKEYR", 0x08),
    Register("SR", 0x0C, 0, 0x34),
    Register("CR", 0x10, 0x80, 0x16F7, 0x14C7),  # without option bytes
    Register("AR", 0x14, 0, _WORD),
    Register("OBR", 0x1C, 0x03FFFFFC),
    Register("WRPR", 0x20, _WORD),
)
_GPIO = (
    Register("CRL", 0x00, 0x44444444, _WORD),
    Register("CRH", 0x04, 0x44444444, _WORD),
    Register("IDR", 0x08),
    Register("ODR", 0x0C, 0, _HALF),
    Register("BSRR", 0x10),
    Register("BRR", 0x14),
    Register("LCKR", 0x18, 0, 0x1FFFF, 0),
)
_AFIO = (
    Register("EVCR", 0x00, 0, 0xFF, 0),
    Register("MAPR", 0x04, 0, 0x071FFFFF, 0x07001FC0 | 0x100000),  # the timers' remaps, and SWJ, which frees pins
    *(Register(f"EXTICR{i + 1}", 0x08 + 4 * i, 0, _HALF) for i in range(4)),
)
_EXTI = tuple(
    Register(name, 4 * i, 0, 0xFFFFF, 0x2FFFF) for i, name in enumerate(("IMR", "EMR", "RTSR", "FTSR", "SWIER", "PR"))
)
_TIMER = (
    Register("CR1", 0x00, 0, 0x3FF),
    Register("CR2", 0x04, 0, 0x7FFD, 0x70),  # without TI1S and idle states
    Register("SMCR", 0x08, 0, 0xFF77, 0xF7),  # without ETR
    Register("DIER", 0x0C, 0, 0x7FFF, 0x1F5F),  # without commutation and break
    Register("SR", 0x10, 0, 0x1EFF),
    Register("EGR", 0x14, 0, 0xFF, 0x1F),
    Register("CCMR1", 0x18, 0, _HALF),  # filters pass each edge
    Register("CCMR2", 0x1C, 0, _HALF),
    Register("CCER", 0x20, 0, 0x3FFF, 0x3333),
    Register("CNT", 0x24, 0, _HALF),
    Register("PSC", 0x28, 0, _HALF),
    Register("ARR", 0x2C, _HALF, _HALF),
    *(Register(f"CCR{i + 1}", 0x34 + 4 * i, 0, _HALF) for i in range(4)),
    Register("DCR", 0x48, 0, 0x1F1F, 0),
    Register("DMAR", 0x4C, 0, _HALF, 0),
)
_ADVANCED_TIMER = (*_TIMER, Register("RCR", 0x30, 0, 0xFF, 0), Register("BDTR", 0x44, 0, _HALF, 0x8C00))
_USART = (
    Register("SR", 0x00, 0xC0, 0x3FF),
    Register("DR", 0x04, 0, 0x1FF, 0xFF),
    Register("BRR", 0x08, 0, _HALF),
    Register("CR1", 0x0C, 0, 0x3FFF, 0x30FC),  # without parity, wake-up and break
    Register("CR2", 0x10, 0, 0x7F6F, 0x3000),
    Register("CR3", 0x14, 0, 0x7FF, 0xC1),  # without flow control
    Register("GTPR", 0x18, 0, _HALF, 0),
)
_CAN = (
    Register("MCR", 0x00, 0x00010002, 0x000100FF, 0x000100DF),  # without wake-up by the bus
    Register("MSR", 0x04, 0x00000C02),
    Register("TSR", 0x08, 0x1C000000),
    Register("RF0R", 0x0C),
    Register("RF1R", 0x10),
    Register("IER", 0x14, 0, 0x00038F7F),
    Register("ESR", 0x18, 0, 0x70),
    Register("BTR", 0x1C, 0x01230000, 0xC37F03FF),
    *(
        Register(f"T{name}{i}R", 0x180 + 16 * i + 4 * place, 0, writable, modelled)
        for i in range(3)
        for place, (name, writable, modelled) in enumerate(
            (("I", _WORD, -1), ("DT", 0xFFFF010F, 0xFFFF000F), ("DL", _WORD, -1), ("DH", _WORD, -1))
        )
    ),
    *(
        Register(f"R{name}{i}R", 0x1B0 + 16 * i + 4 * place)
        for i in range(2)
        for place, name in enumerate(("I", "DT", "DL", "DH"))
    ),
    Register("FMR", 0x200, 0x2A1C0E01, 1),
    *(
        Register(name, at, 0, 0x3FFF)
        for name, at in (("FM1R", 0x204), ("FS1R", 0x20C), ("FFA1R", 0x214), ("FA1R", 0x21C))
    ),
    *(Register(f"F{i // 2}R{i % 2 + 1}", 0x240 + 4 * i, 0, _WORD) for i in range(28)),
)
_DMA = (
    Register("ISR", 0x00),
    Register("IFCR", 0x04),
    *(
        Register(f"{name}{i + 1}", 0x08 + 20 * i + 4 * place, 0, writable)
        for i in range(7)
        for place, (name, writable) in enumerate((("CCR", 0x7FFF), ("CNDTR", _HALF), ("CPAR", _WORD), ("CMAR", _WORD)))
    ),
)
_ADC = (
    Register("SR", 0x00, 0, 0x1F),
    Register("CR1", 0x04, 0, 0x00CFFFFF, 0x0080037F),  # without injected channels, and one by one
    Register("CR2", 0x08, 0, 0x00FEF90F, 0x00DE090F),
    Register("SMPR1", 0x0C, 0, 0x00FFFFFF),
    Register("SMPR2", 0x10, 0, 0x3FFFFFFF),
    *(Register(f"JOFR{i + 1}", 0x14 + 4 * i, 0, 0xFFF, 0) for i in range(4)),
    Register("HTR", 0x24, 0xFFF, 0xFFF),
    Register("LTR", 0x28, 0, 0xFFF),
    Register("SQR1", 0x2C, 0, 0x00FFFFFF),
    Register("SQR2", 0x30, 0, 0x3FFFFFFF),
    Register("SQR3", 0x34, 0, 0x3FFFFFFF),
    Register("JSQR", 0x38, 0, 0x003FFFFF, 0),
    *(Register(f"JDR{i + 1}", 0x3C + 4 * i) for i in range(4)),
    Register("DR", 0x4C),
)
_WWDG = (
    Register("CR", 0x00, 0x7F, 0xFF),
    Register("CFR", 0x04, 0x7F, 0x3FF),
    Register("SR", 0x08, 0, 1),
)
_RTC = (
    Register("CRH", 0x00, 0, 7),
    Register("CRL", 0x04, 0x20, 0x1F),
    Register("PRLH", 0x08, 0, 0xF),
    Register("PRLL", 0x0C, 0x8000, _HALF),
    Register("DIVH", 0x10),
    Register("DIVL", 0x14, 0x8000),
    Register("CNTH", 0x18, 0, _HALF),
    Register("CNTL", 0x1C, 0, _HALF),
    Register("ALRH", 0x20, _HALF, _HALF),
    Register("ALRL", 0x24, _HALF, _HALF),
)
_SPI = (
    Register("CR1", 0x00, 0, _HALF, 0x0BFF),  # without CRC, one wire, and receiving alone
    Register("CR2", 0x04, 0, 0xE7, 0xE7),
    Register("SR", 0x08, 2, 0x10),
    Register("DR", 0x0C, 0, _HALF),
    Register("CRCPR", 0x10, 7, _HALF),
    Register("RXCRCR", 0x14),
    Register("TXCRCR", 0x18),
    Register("I2SCFGR", 0x1C, 0, 0xFBF, 0),
    Register("I2SPR", 0x20, 2, 0x3FF, 0),
)
_I2C = (
    Register("CR1", 0x00, 0, 0xBFFB, 0x8F81),  # without SMBus and PEC
    Register("CR2", 0x04, 0, 0x1F3F, 0x0F3F),  # without LAST
    Register("OAR1", 0x08, 0, 0xC3FF, 0x4000),  # it is a master alone
    Register("OAR2", 0x0C, 0, 0xFF, 0),
    Register("DR", 0x10, 0, 0xFF),
    Register("SR1", 0x14, 0, 0xDF00),
    Register("SR2", 0x18),
    Register("CCR", 0x1C, 0, 0xCFFF),
    Register("TRISE", 0x20, 2, 0x3F),
)
_IWDG = (
    Register("KR", 0x00, 0, _HALF),
    Register("PR", 0x04, 0, 7),
    Register("RLR", 0x08, 0xFFF, 0xFFF),
    Register("SR", 0x0C),
)
_BKP = (
    *(Register(f"DR{i + 1}", 4 + 4 * i, 0, _HALF) for i in range(10)),
    Register("RTCCR", 0x2C, 0, 0x3FF, 0),
    Register("CR", 0x30, 0, 3, 0),
    Register("CSR", 0x34, 0, 4, 0),
)
_PWR = (Register("CR", 0x00, 0, 0x1FF, 0x100), Register("CSR", 0x04, 0, 0x100, 0))

PERIPHERALS: Final = (
    Peripheral("RCC", "7.3", RCC, 0, 0x40021000, None, _RCC),
    Peripheral("FLASH", "3.4", FLASH, 0, 0x40022000, None, _FLASH),
    Peripheral("AFIO", "9.4", AFIO, 0, 0x40010000, (_APB2, 0), _AFIO),
    Peripheral("EXTI", "10.3", EXTI, 0, 0x40010400, None, _EXTI),
    *(
        Peripheral(f"GPIO{port}", "9.2", GPIO, i, 0x40010800 + 0x400 * i, (_APB2, 2 + i), _GPIO)
        for i, port in enumerate("ABCDE")
    ),
    Peripheral("TIM1", "14.4", TIMER, 0, 0x40012C00, (_APB2, 11), _ADVANCED_TIMER),
    *(Peripheral(f"TIM{2 + i}", "15.4", TIMER, 1 + i, 0x40000000 + 0x400 * i, (_APB1, i), _TIMER) for i in range(3)),
    Peripheral("USART1", "27.6", USART, 0, 0x40013800, (_APB2, 14), _USART),
    Peripheral("USART2", "27.6", USART, 1, 0x40004400, (_APB1, 17), _USART),
    Peripheral("USART3", "27.6", USART, 2, 0x40004800, (_APB1, 18), _USART),
    Peripheral("CAN", "24.9", CAN, 0, 0x40006400, (_APB1, 25), _CAN),
    Peripheral("DMA1", "13.4", DMA, 0, 0x40020000, (_AHB, 0), _DMA),
    Peripheral("IWDG", "19.4", IWDG, 0, 0x40003000, None, _IWDG),
    Peripheral("SPI1", "25.5", SPI, 0, 0x40013000, (_APB2, 12), _SPI),
    Peripheral("SPI2", "25.5", SPI, 1, 0x40003800, (_APB1, 14), _SPI),
    *(Peripheral(f"I2C{1 + i}", "26.6", I2C, i, 0x40005400 + 0x400 * i, (_APB1, 21 + i), _I2C) for i in range(2)),
    Peripheral("WWDG", "20.6", WWDG, 0, 0x40002C00, (_APB1, 11), _WWDG),
    Peripheral("RTC", "18.4", RTC, 0, 0x40002800, (_APB1, 27), _RTC),
    Peripheral("ADC1", "11.12", ADC, 0, 0x40012400, (_APB2, 9), _ADC),
    Peripheral("BKP", "6.4", BKP, 0, 0x40006C00, (_APB1, 27), _BKP),
    Peripheral("PWR", "5.4", PLAIN, 0, 0x40007000, (_APB1, 28), _PWR),
)

NOT_MODELLED: Final = (
    (0x40000C00, 0x40002000, "TIM5 to TIM14"),
    (0x40003C00, 0x40004000, "SPI3"),
    (0x40004C00, 0x40005400, "UART4 or UART5"),
    (0x40005C00, 0x40006400, "USB"),
    (0x40007400, 0x40007800, "DAC"),
    (0x40012800, 0x40012C00, "ADC2"),
    (0x40013400, 0x40013800, "TIM8"),
    (0x40020400, 0x40020800, "DMA2"),
    (0x40023000, 0x40023400, "CRC"),
)
"""Peripherals that the chip or its larger sisters have and the twin does not: begin, end, name (RM0008, table 3)."""


def place_registers(state: Int64Array) -> None:
    """Write the tables into a chip's state, with all registers at their reset values."""
    for peripheral in PERIPHERALS:
        for register in peripheral.registers:
            word = (peripheral.base + register.offset - c.PERIPHERALS) // 4
            state[c.VALUE + word] = register.reset
            state[c.WRITABLE + word] = register.writable
            state[c.MODELLED + word] = register.modelled
            state[c.DEVICE + word] = 16 * peripheral.kind + peripheral.number
            state[c.CLOCK + word] = -1
            if peripheral.clock is not None:
                offset, bit = peripheral.clock
                state[c.CLOCK + word] = 32 * ((0x40021000 + offset - c.PERIPHERALS) // 4) + bit


def name_of(address: int) -> str:
    """Return the name of a register at an address, such as `TIM2 SMCR` or `DMA1 offset 0x8`; else the address."""
    for peripheral in PERIPHERALS:
        if peripheral.base <= address < peripheral.base + 0x400:
            found = next((each.name for each in peripheral.registers if each.offset == address - peripheral.base), None)
            return f"{peripheral.name} {found or f'offset 0x{address - peripheral.base:X}'}"
    named = (f"{name} offset 0x{address - begin:X}" for begin, end, name in NOT_MODELLED if begin <= address < end)
    return next(named, f"0x{address:08X}")


RESET_PRIORITIES: Final = np.array([0, -3, -2, -1])
"""Of the initial stack pointer, which is none, reset, NMI and HardFault."""
