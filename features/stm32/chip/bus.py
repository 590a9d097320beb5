"""Accesses to the peripherals and the system space, at the instant `AT`."""

from typing import Final

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip import gpio, registers
from steptwin.features.stm32.chip.bookkeeping import note_strange
from steptwin.features.stm32.chip.can import read_can, write_can
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.clocks import write_rcc
from steptwin.features.stm32.chip.cost import forget_costs
from steptwin.features.stm32.chip.dma import write_dma
from steptwin.features.stm32.chip.events import next_due
from steptwin.features.stm32.chip.libunicorn import read_memory, write_memory
from steptwin.features.stm32.chip.system import read_system, write_system
from steptwin.features.stm32.chip.timers import read_timer, write_timer
from steptwin.features.stm32.chip.usarts import listen, read_usart, write_usart

RCC, GPIO, AFIO, EXTI, TIMER = registers.RCC, registers.GPIO, registers.AFIO, registers.EXTI, registers.TIMER
USART, IWDG, FLASH, CAN, DMA = registers.USART, registers.IWDG, registers.FLASH, registers.CAN, registers.DMA
RAM, RAM_BITS, PERIPHERAL_BITS = 0x20000000, 0x22000000, 0x42000000
"""The RAM, and the aliases of single bits of RAM and peripherals (PM0056, 2.2.5)."""
_SPACE: Final = 0xE0000000
_FLASH_ACR: Final = (0x40022000 - c.PERIPHERALS) // 4
_IWDG_KR: Final = (0x40003000 - c.PERIPHERALS) // 4
_LSI_HZ: Final = 40_000
"""RM0008, 7.2.5: 30 to 60 kHz."""
_GRAINS_PER_SECOND: Final = 72_000_000 * c.GRAINS


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
    kind, number = device // 16, device % 16
    if kind == RCC:
        write_rcc(s, word)
    elif kind == FLASH:
        if word == _FLASH_ACR and s[c.WAIT_STATES] != value & 7:
            s[c.WAIT_STATES] = value & 7
            forget_costs(s)
    elif kind == GPIO:
        gpio.write_gpio(s, number, word % gpio.PORT_WORDS, value)
    elif kind == AFIO:
        gpio.route_channels(s)
    elif kind == EXTI:
        if word in (gpio.PR, gpio.SWIER):
            s[c.VALUE + word] = before
        gpio.write_exti(s, word, value)
    elif kind == TIMER:
        write_timer(s, number, word % 256, value, before)
    elif kind == USART:
        write_usart(s, number, word % 256, value, before)
        listen(s, number)
    elif kind == CAN:
        write_can(s, word % 256, value, before)
    elif kind == DMA:
        write_dma(s, word % 256, value, before)
    elif kind == IWDG and word == _IWDG_KR:
        if value == 0xCCCC:
            s[c.WATCHDOG_ON] = 1
        if s[c.WATCHDOG_ON] and value in (0xCCCC, 0xAAAA):
            ticks = (s[c.VALUE + _IWDG_KR + 2] + 1) * (4 << min(s[c.VALUE + _IWDG_KR + 1], 6))
            s[c.DUES + c.WATCHDOG_DUE] = s[c.AT] + ticks * (_GRAINS_PER_SECOND // _LSI_HZ)
