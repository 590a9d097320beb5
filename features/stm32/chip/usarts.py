"""USART1 to USART3: bytes out and in, their flags and interrupts (RM0008, section 27)."""

from typing import Final

import numpy as np

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.dma import OF_USARTS, set_dma_level
from steptwin.features.stm32.chip.gpio import set_device_pin
from steptwin.features.stm32.chip.nvic import FIRST_IRQ, set_line

SR, DR, BRR, CR1, CR2, CR3 = range(6)
BASES: Final = np.array([(at - c.PERIPHERALS) // 4 for at in (0x40013800, 0x40004400, 0x40004800)])
_TX_PINS: Final = np.array([9, 2, 16 + 10])
"""The pin of each TX without a remap: 16 * port + pin."""
_FIRST_IRQ: Final = 37
ORE, IDLE, RXNE, TC, TXE = 8, 16, 32, 64, 128
UE, TE, RE = 1 << 13, 8, 4
DMAR, DMAT = 64, 128
_DMA: Final = np.array([[4, 5], [7, 6], [2, 3]])
"""Channels of sender and receiver (RM0008, table 78)."""


@integer
def _byte_grains(s: Cells, usart: int) -> int:
    """Return the time of a byte with its start and stop bits, without a divider that of 16."""
    divider = s[c.VALUE + (0x40021004 - c.PERIPHERALS) // 4] >> (8 if usart else 11) & 7
    cycle = s[c.CYCLE] << max(divider - 3, 0)
    base = c.VALUE + int(BASES[usart])
    return max(s[base + BRR], 16) * cycle * (11 if s[base + CR1] >> 12 & 1 else 10)


@integer
def set_usart_line(s: Cells, usart: int) -> None:
    """Ask for the interrupt, and for DMA (27.3.13)."""
    base = c.VALUE + int(BASES[usart])
    status, control = s[base + SR], s[base + CR1]
    asked = status & control & (TXE | TC | RXNE | IDLE) != 0 or (status & ORE != 0 and control & RXNE != 0)
    set_line(s, _FIRST_IRQ + usart, 1 if asked else 0)
    by_dma = s[base + CR3]
    if by_dma & (DMAT | DMAR) or s[c.DMA_LEVELS]:
        set_dma_level(s, OF_USARTS, int(_DMA[usart, 0]), 1 if by_dma & DMAT and status & TXE and control & UE else 0)
        set_dma_level(s, OF_USARTS, int(_DMA[usart, 1]), 1 if by_dma & DMAR and status & RXNE else 0)


@integer
def _begin_byte(s: Cells, usart: int) -> None:
    """Let the byte that waits be sent."""
    base = c.VALUE + int(BASES[usart])
    s[c.SHIFTING + usart], s[c.WAITING + usart] = s[c.WAITING + usart], -1
    s[c.DUES + c.SENT_DUE + usart] = s[c.AT] + _byte_grains(s, usart)
    s[base + SR] |= TXE


@integer
def usart_sent(s: Cells, usart: int) -> None:
    """End the byte that is being sent; begin the next one."""
    base = c.VALUE + int(BASES[usart])
    s[c.SENT + usart * c.TEXT_CAPACITY + s[c.SENT_COUNT + usart] % c.TEXT_CAPACITY] = s[c.SHIFTING + usart]
    s[c.SENT_COUNT + usart] += 1
    s[c.SHIFTING + usart] = -1
    s[c.DUES + c.SENT_DUE + usart] = c.NEVER
    if s[c.WAITING + usart] >= 0:
        _begin_byte(s, usart)
    else:
        s[base + SR] |= TC
    set_usart_line(s, usart)


@integer
def listen(s: Cells, usart: int) -> None:
    """Let the next byte arrive that the other side has given, if it has and nothing arrives yet."""
    if s[c.DUES + c.RECEIVED_DUE + usart] == c.NEVER and s[c.ARRIVED_COUNT + usart] < s[c.GIVEN_COUNT + usart]:
        s[c.DUES + c.RECEIVED_DUE + usart] = s[c.AT] + _byte_grains(s, usart)


@integer
def usart_received(s: Cells, usart: int) -> None:
    """Take a byte that has arrived; it is lost if the one before has not been read, or nobody listens."""
    base = c.VALUE + int(BASES[usart])
    byte = s[c.GIVEN + usart * c.TEXT_CAPACITY + s[c.ARRIVED_COUNT + usart] % c.TEXT_CAPACITY]
    s[c.ARRIVED_COUNT + usart] += 1
    s[c.DUES + c.RECEIVED_DUE + usart] = c.NEVER
    if s[base + CR1] & UE and s[base + CR1] & RE:
        if s[base + SR] & RXNE:
            s[base + SR] |= ORE
            s[c.OVERRUNS + FIRST_IRQ + _FIRST_IRQ + usart] += 1
        else:
            s[base + DR] = byte
            s[base + SR] |= RXNE
        if s[c.ARRIVED_COUNT + usart] == s[c.GIVEN_COUNT + usart]:
            s[base + SR] |= IDLE
    listen(s, usart)
    set_usart_line(s, usart)


@integer
def read_usart(s: Cells, usart: int, word: int) -> int:
    """Return a register; a read of DR takes the byte and clears the flags that stood in SR."""
    base = c.VALUE + int(BASES[usart])
    value = s[base + word]
    if word == DR:
        s[base + SR] &= ~(RXNE | ORE | IDLE)
        set_usart_line(s, usart)
    return value


@integer
def write_usart(s: Cells, usart: int, word: int, value: int, before: int) -> None:
    """Write a register, whose value is stored already."""
    base = c.VALUE + int(BASES[usart])
    if word == DR:
        s[base + DR] = before
        if s[base + CR1] & UE and s[base + CR1] & TE:
            s[c.WAITING + usart] = value & 0xFF
            s[base + SR] &= ~(TXE | TC)
            if s[c.SHIFTING + usart] < 0:
                _begin_byte(s, usart)
    elif word == SR:
        s[base + SR] = before & (value | ~(TC | RXNE))
    elif word == CR1 and (value ^ before) & (UE | TE):
        on = value & (UE | TE) == UE | TE
        set_device_pin(s, int(_TX_PINS[usart]), 1 if on else 0)  # TX is high between bytes
    set_usart_line(s, usart)
