"""Accesses to the peripherals and the system space, at the instant `AT`."""

from typing import Final

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip import gpio, registers
from steptwin.features.stm32.chip.adc import CR2 as CR2_OF_ADC
from steptwin.features.stm32.chip.adc import read_adc, write_adc
from steptwin.features.stm32.chip.bookkeeping import note_strange
from steptwin.features.stm32.chip.can import read_can, write_can
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.clocks import write_rcc
from steptwin.features.stm32.chip.dma import write_dma
from steptwin.features.stm32.chip.events import next_due
from steptwin.features.stm32.chip.flash import write_flash
from steptwin.features.stm32.chip.i2c import read_i2c, write_i2c
from steptwin.features.stm32.chip.libunicorn import read_memory, write_memory
from steptwin.features.stm32.chip.rtc import backup_is_open, read_rtc, write_rtc
from steptwin.features.stm32.chip.spi import read_spi, write_spi
from steptwin.features.stm32.chip.system import read_system, write_system
from steptwin.features.stm32.chip.timer_inputs import route_inputs
from steptwin.features.stm32.chip.timers import CCER, CCMR1, CCMR2, CR2, SMCR, read_timer, write_timer
from steptwin.features.stm32.chip.usarts import listen, read_usart, write_usart
from steptwin.features.stm32.chip.watchdogs import read_wwdg, write_iwdg, write_wwdg

RCC, GPIO, AFIO, EXTI, TIMER = registers.RCC, registers.GPIO, registers.AFIO, registers.EXTI, registers.TIMER
USART, IWDG, FLASH, CAN, DMA = registers.USART, registers.IWDG, registers.FLASH, registers.CAN, registers.DMA
ADC, WWDG, RTC, BKP = registers.ADC, registers.WWDG, registers.RTC, registers.BKP
SPI, I2C = registers.SPI, registers.I2C
RAM, RAM_BITS, PERIPHERAL_BITS = 0x20000000, 0x22000000, 0x42000000
"""The RAM, and the aliases of single bits of RAM and peripherals (PM0056, 2.2.5)."""
_SPACE: Final = 0xE0000000


@integer
def read(s: Cells, address: int, size: int) -> int:
    """Return what 1, 2 or 4 bytes of a peripheral read, or a bit by its alias, at the instant `AT`."""
    if address < c.PERIPHERALS:
        place = RAM + (address - RAM_BITS >> 5)
        return read_memory(s, place, 1) >> (address >> 2 & 7) & 1
    if PERIPHERAL_BITS <= address < _SPACE:
        return _read_word(s, c.PERIPHERALS + (address - PERIPHERAL_BITS >> 5 & ~3)) >> (address >> 2 & 31) & 1
    return _read_word(s, address & ~3) >> 8 * (address & 3) & (1 << 8 * size) - 1


@integer
def _read_word(s: Cells, address: int) -> int:
    if address >= _SPACE:
        return read_system(s, address)
    word = (address - c.PERIPHERALS) // 4
    device = s[c.DEVICE + word] if word < c.REGISTER_WORDS else 0
    if device == 0:
        note_strange(s, address, c.STRANGE_READ)
        return 0
    if not _has_clock(s, word):
        note_strange(s, address, c.STRANGE_NO_CLOCK)
        return 0
    kind, number = device // 16, device % 16
    if kind == GPIO and word % gpio.PORT_WORDS == gpio.IDR:
        return s[c.LEVELS + number]
    if kind == TIMER:
        return read_timer(s, number, word % 256)
    if kind == USART:
        return read_usart(s, number, word % 256)
    if kind == CAN:
        return read_can(s, word % 256)
    if kind == ADC:
        return read_adc(s, word % 256)
    if kind == WWDG:
        return read_wwdg(s, word % 256)
    if kind == RTC:
        return read_rtc(s, word % 256)
    if kind == SPI:
        return read_spi(s, number, word % 256)
    if kind == I2C:
        return read_i2c(s, number, word % 256)
    return s[c.VALUE + word]


@integer
def _has_clock(s: Cells, word: int) -> bool:
    clock = s[c.CLOCK + word]
    return clock < 0 or s[c.VALUE + clock // 32] >> clock % 32 & 1 != 0


@integer
def write(s: Cells, address: int, size: int, value: int) -> None:
    """Write 1, 2 or 4 bytes of a peripheral, or a bit by its alias, at the instant `AT`.

    A part of a word leaves the others 0, as on the chip's peripheral buses. A bit's word is read and written.
    """
    if address < c.PERIPHERALS:
        place, bit = RAM + (address - RAM_BITS >> 5), 1 << (address >> 2 & 7)
        before = read_memory(s, place, 1)
        write_memory(s, place, 1, before | bit if value & 1 else before & ~bit)
        return
    if address >= _SPACE:
        write_system(s, address, size, value)
    elif address >= PERIPHERAL_BITS:
        word, bit = c.PERIPHERALS + (address - PERIPHERAL_BITS >> 5 & ~3), 1 << (address >> 2 & 31)
        before = _read_word(s, word)
        _write_word(s, word, before | bit if value & 1 else before & ~bit)
    else:
        _write_word(s, address & ~3, (value & (1 << 8 * size) - 1) << 8 * (address & 3))
    next_due(s)


@integer
def _write_word(s: Cells, address: int, value: int) -> None:
    word = (address - c.PERIPHERALS) // 4
    device = s[c.DEVICE + word] if word < c.REGISTER_WORDS else 0
    if device == 0:
        note_strange(s, address, c.STRANGE_WRITE)
        return
    if not _has_clock(s, word):
        note_strange(s, address, c.STRANGE_NO_CLOCK)
        return
    before, writable = s[c.VALUE + word], s[c.WRITABLE + word]
    s[c.VALUE + word] = before & ~writable | value & writable
    if value & writable & ~s[c.MODELLED + word]:
        note_strange(s, address, c.STRANGE_BITS)
    if device // 16 in (RCC, GPIO, AFIO, EXTI, TIMER, USART):
        _write_usual(s, word, value, before)
    else:
        _write_other(s, word, value, before)


@integer
def _write_usual(s: Cells, word: int, value: int, before: int) -> None:
    """Let a peripheral act that most firmwares use all the time."""
    kind, number = s[c.DEVICE + word] // 16, s[c.DEVICE + word] % 16
    if kind == RCC:
        write_rcc(s, word)
    elif kind == GPIO:
        gpio.write_gpio(s, number, word % gpio.PORT_WORDS, value)
    elif kind == AFIO:
        gpio.route_channels(s)
        route_inputs(s)
    elif kind == EXTI:
        if word in (gpio.PR, gpio.SWIER):
            s[c.VALUE + word] = before
        gpio.write_exti(s, word, value)
    elif kind == TIMER:
        write_timer(s, number, word % 256, value, before)
        if word % 256 in (CR2, SMCR, CCMR1, CCMR2, CCER):
            route_inputs(s)
    elif kind == USART:
        write_usart(s, number, word % 256, value, before)
        listen(s, number)


@integer
def _write_other(s: Cells, word: int, value: int, before: int) -> None:
    kind, number = s[c.DEVICE + word] // 16, s[c.DEVICE + word] % 16
    if kind == FLASH:
        write_flash(s, word % 256, value, before)
    elif kind == CAN:
        write_can(s, word % 256, value, before)
    elif kind == DMA:
        write_dma(s, word % 256, value, before)
    elif kind == ADC:
        write_adc(s, word % 256, value, before)
        if word % 256 == CR2_OF_ADC:
            route_inputs(s)
    elif kind == IWDG:
        write_iwdg(s, word % 256, value)
    elif kind == WWDG:
        write_wwdg(s, word % 256, value, before)
    elif kind == RTC:
        write_rtc(s, word % 256, value, before)
    elif kind == SPI:
        write_spi(s, number, word % 256, value, before)
    elif kind == I2C:
        write_i2c(s, number, word % 256, value, before)
    elif kind == BKP and not backup_is_open(s):
        s[c.VALUE + word] = before
