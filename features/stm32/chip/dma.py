"""DMA1's registers, requests and interrupts (RM0008, section 13); `transfers` moves the data."""

from typing import Final

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.nvic import set_line

BASE: Final = c.VALUE + (0x40020000 - c.PERIPHERALS) // 4
ISR, IFCR, CCR1 = 0, 1, 2
CHANNEL_WORDS: Final = 5
EN, DIR, CIRC, PINC, MINC, MEM2MEM = 1, 16, 32, 64, 128, 1 << 14
GIF, TCIF, HTIF, TEIF = 1, 2, 4, 8
OF_USARTS, OF_SPIS, OF_I2CS = 0, 1, 2
"""Places of the kinds of peripherals in `DMA_LEVELS`."""
TRANSFER_CYCLES: Final = 6
"""Of a transfer from memory to memory (AN2548, 2.2): five of the bus and an idle one."""
_FIRST_IRQ: Final = 11


@integer
def request_dma(s: Cells, channel: int) -> None:
    """Request one transfer of a channel, numbered from 1; 0 is none."""
    if channel:
        s[c.DMA_PULSES] |= 1 << channel - 1


@integer
def withdraw_dma(s: Cells, channel: int) -> None:
    """Withdraw a request that has not been served."""
    if channel:
        s[c.DMA_PULSES] &= ~(1 << channel - 1)


@integer
def set_dma_level(s: Cells, kind: int, channel: int, level: int) -> None:
    """Set whether a peripheral requests transfers of a channel, numbered from 1."""
    bit = 1 << 8 * kind + channel - 1
    if level:
        s[c.DMA_LEVELS] |= bit
    else:
        s[c.DMA_LEVELS] &= ~bit


@integer
def set_dma_lines(s: Cells) -> None:
    """Ask for the channels' interrupts."""
    for channel in range(c.DMA_CHANNELS):
        enabled = s[BASE + CCR1 + CHANNEL_WORDS * channel] & (TCIF | HTIF | TEIF)
        set_line(s, _FIRST_IRQ + channel, 1 if s[BASE + ISR] >> 4 * channel & enabled else 0)


@integer
def set_dma_flags(s: Cells, channel: int, flags: int) -> None:
    """Set flags of a channel, numbered from 0, and the flag of any of them."""
    s[BASE + ISR] |= (flags | GIF) << 4 * channel
    set_dma_lines(s)


@integer
def write_dma(s: Cells, word: int, value: int, before: int) -> None:
    """Write a register, whose value is stored already; those of an enabled channel are locked (13.4.4 to 13.4.6)."""
    if word < CCR1:
        s[BASE + word] = before if word == ISR else 0
        if word == IFCR:
            for channel in range(c.DMA_CHANNELS):
                bits = value >> 4 * channel & 0xF
                cleared = 0xF if bits & GIF else bits
                left = s[BASE + ISR] >> 4 * channel & (TCIF | HTIF | TEIF) & ~cleared
                s[BASE + ISR] &= ~(0xF << 4 * channel)
                s[BASE + ISR] |= (left | GIF if left else 0) << 4 * channel
        set_dma_lines(s)
        return
    channel, register = (word - CCR1) // CHANNEL_WORDS, (word - CCR1) % CHANNEL_WORDS
    control = BASE + CCR1 + CHANNEL_WORDS * channel
    if register:
        if s[control] & EN:
            s[BASE + word] = before
        return
    if value & EN and before & EN:
        s[control] = value & 0xF | before & ~0xF  # only the interrupts' enables may change
    elif value & EN:
        s[c.DMA_TOTAL + channel] = s[control + 1]
        if value & MEM2MEM:
            s[c.DUES + c.DMA_DUE] = min(s[c.DUES + c.DMA_DUE], s[c.AT] + TRANSFER_CYCLES * s[c.CYCLE])
    set_dma_lines(s)
