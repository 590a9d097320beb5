"""DMA1's transfers: which request is served first, and what is read and written where (RM0008, 13.3).

A transfer on request happens at its request's instant; where a request stands on, the next one some cycles later.
"""

from typing import Final

from steptwin.features.stm32.chip import bus
from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.dma import (
    BASE,
    CCR1,
    CHANNEL_WORDS,
    CIRC,
    DIR,
    EN,
    HTIF,
    MEM2MEM,
    MINC,
    PINC,
    TCIF,
    TEIF,
    TRANSFER_CYCLES,
    set_dma_flags,
)
from steptwin.features.stm32.chip.libunicorn import read_memory, write_memory

_RAM: Final = 0x20000000
_SYSTEM_MEMORY: Final = 0x1FFFF000
_PERIPHERALS_END: Final = c.PERIPHERALS + 4 * c.REGISTER_WORDS


@integer
def serve_dma(s: Cells) -> None:
    """Make a transfer of each channel that is requested, by priority and then by number."""
    served = 0
    while True:
        levels = s[c.DMA_LEVELS]
        asked = (s[c.DMA_PULSES] | levels | levels >> 8 | levels >> 16) & 0x7F
        best, rank, again = -1, 4, 0
        for channel in range(c.DMA_CHANNELS):
            if asked >> channel & 1 and _can_transfer(s, channel):
                if served >> channel & 1:
                    again = 1
                elif 3 - _priority(s, channel) < rank:
                    best, rank = channel, 3 - _priority(s, channel)
        if best < 0:
            if again:
                s[c.DUES + c.DMA_DUE] = min(s[c.DUES + c.DMA_DUE], s[c.AT] + TRANSFER_CYCLES * s[c.CYCLE])
            return
        served |= 1 << best
        s[c.DMA_PULSES] &= ~(1 << best)
        _transfer(s, best)


@integer
def _can_transfer(s: Cells, channel: int) -> bool:
    control = BASE + CCR1 + CHANNEL_WORDS * channel
    return s[control] & (EN | MEM2MEM) == EN and s[control + 1] != 0


@integer
def _priority(s: Cells, channel: int) -> int:
    return s[BASE + CCR1 + CHANNEL_WORDS * channel] >> 12 & 3


@integer
def dma_event(s: Cells) -> None:
    """Make the next transfer from memory to memory, of the channel that comes first."""
    best, rank, waits = -1, 4, 0
    for channel in range(c.DMA_CHANNELS):
        control = BASE + CCR1 + CHANNEL_WORDS * channel
        if s[control] & (EN | MEM2MEM) == EN | MEM2MEM and s[control + 1]:
            waits += s[control + 1]
            if 3 - _priority(s, channel) < rank:
                best, rank = channel, 3 - _priority(s, channel)
    s[c.DUES + c.DMA_DUE] = s[c.AT] + TRANSFER_CYCLES * s[c.CYCLE] if waits > 1 else c.NEVER
    if best >= 0:
        _transfer(s, best)


@integer
def _transfer(s: Cells, channel: int) -> None:
    """Move one item; a place that is not there, or cannot be written, disables the channel (13.3.5)."""
    control = BASE + CCR1 + CHANNEL_WORDS * channel
    config, left, total = s[control], s[control + 1], s[c.DMA_TOTAL + channel]
    done = total - left
    of_peripheral, of_memory = 1 << min(config >> 8 & 3, 2), 1 << min(config >> 10 & 3, 2)
    # the lower bits of an address are ignored (13.4.5)
    peripheral = (s[control + 2] & ~(of_peripheral - 1)) + (done * of_peripheral if config & PINC else 0)
    memory = (s[control + 3] & ~(of_memory - 1)) + (done * of_memory if config & MINC else 0)
    source, source_size, target, target_size = peripheral, of_peripheral, memory, of_memory
    if config & DIR:
        source, source_size, target, target_size = memory, of_memory, peripheral, of_peripheral
    if not _is_there(s, source, 0) or not _is_there(s, target, 1):
        s[control] &= ~EN
        set_dma_flags(s, channel, TEIF)
        return
    by_bus = source >= c.PERIPHERALS
    value = bus.read(s, source, source_size) if by_bus else read_memory(s, source, source_size)
    value &= (1 << 8 * min(source_size, target_size)) - 1
    if target >= c.PERIPHERALS:
        bus.write(s, target, target_size, value)
    else:
        write_memory(s, target, target_size, value)
    left -= 1
    flags = HTIF if left == total // 2 and left else 0
    if left == 0:
        flags = TCIF
        if config & CIRC and not config & MEM2MEM:
            left = total
    s[control + 1] = left
    if flags:
        set_dma_flags(s, channel, flags)


@integer
def _is_there(s: Cells, address: int, written: int) -> bool:
    if _RAM <= address < s[c.RAM_END] or c.PERIPHERALS <= address < _PERIPHERALS_END:
        return True
    in_flash = c.FLASH_START <= address < s[c.FLASH_END] or address < s[c.FLASH_END] - c.FLASH_START
    return not written and (in_flash or _SYSTEM_MEMORY <= address < _SYSTEM_MEMORY + 0x1000)
