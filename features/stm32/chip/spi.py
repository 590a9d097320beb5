"""SPI1 and SPI2 as masters: a word out and one in, its time, flags, interrupts and DMA (RM0008, section 25)."""

from typing import Final

import numpy as np

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.dma import OF_SPIS, set_dma_level
from steptwin.features.stm32.chip.nvic import set_line
from steptwin.features.stm32.chip.outside import TRANSFER, ask

BASES: Final = np.array([(at - c.PERIPHERALS) // 4 for at in (0x40013000, 0x40003800)])
CR1, CR2, SR, DR = range(4)
MSTR, SPE, DFF = 4, 64, 1 << 11
RXDMAEN, TXDMAEN, RXNEIE, TXEIE, ERRIE = 1, 2, 64, 128, 32
RXNE, TXE, OVR, BSY = 1, 2, 64, 128
_FIRST_IRQ: Final = 35
_DMA: Final = np.array([[3, 2], [5, 4]])
"""Channels of sender and receiver (RM0008, table 78)."""


@integer
def set_spi_line(s: Cells, number: int) -> None:
    """Ask for the interrupt, and for DMA."""
    base = c.VALUE + int(BASES[number])
    status, control = s[base + SR], s[base + CR2]
    asked = (
        (status & RXNE and control & RXNEIE) or (status & TXE and control & TXEIE) or (status & OVR and control & ERRIE)
    )
    set_line(s, _FIRST_IRQ + number, 1 if asked else 0)
    if control & (RXDMAEN | TXDMAEN) or s[c.DMA_LEVELS]:
        sends = control & TXDMAEN and status & TXE and s[base + CR1] & SPE
        set_dma_level(s, OF_SPIS, int(_DMA[number, 0]), 1 if sends else 0)
        set_dma_level(s, OF_SPIS, int(_DMA[number, 1]), 1 if control & RXDMAEN and status & RXNE else 0)


@integer
def _begin(s: Cells, number: int) -> None:
    """Let the word that waits be shifted out."""
    base = c.VALUE + int(BASES[number])
    s[c.SPI_SHIFTING + number], s[c.SPI_WAITING + number] = s[c.SPI_WAITING + number], -1
    divider = s[c.VALUE + (0x40021004 - c.PERIPHERALS) // 4] >> (8 if number else 11) & 7
    cycle = s[c.CYCLE] << max(divider - 3, 0)
    bits = 16 if s[base + CR1] & DFF else 8
    s[c.DUES + c.SPI_DUE + number] = s[c.AT] + bits * (2 << (s[base + CR1] >> 3 & 7)) * cycle
    s[base + SR] |= TXE | BSY


@integer
def spi_event(s: Cells, number: int) -> None:
    """End a word: the device's one has come in; begin the next one."""
    base = c.VALUE + int(BASES[number])
    s[c.DUES + c.SPI_DUE + number] = c.NEVER
    answer = ask(s, TRANSFER, number, s[c.SPI_SHIFTING + number])
    if s[base + SR] & RXNE:
        s[base + SR] |= OVR
    else:
        s[base + DR] = answer & (0xFFFF if s[base + CR1] & DFF else 0xFF)
        s[base + SR] |= RXNE
    s[c.SPI_SHIFTING + number] = -1
    s[base + SR] &= ~BSY
    if s[c.SPI_WAITING + number] >= 0:
        _begin(s, number)
    set_spi_line(s, number)


@integer
def read_spi(s: Cells, number: int, word: int) -> int:
    """Return a register; a read of DR takes the word, and one of SR behind it clears OVR."""
    base = c.VALUE + int(BASES[number])
    value = s[base + word]
    if word == DR:
        s[base + SR] &= ~RXNE
        s[c.SPI_READ + number] = 1
    elif word == SR:
        if s[c.SPI_READ + number]:
            s[base + SR] &= ~OVR
        s[c.SPI_READ + number] = 0
    set_spi_line(s, number)
    return value


@integer
def write_spi(s: Cells, number: int, word: int, value: int, before: int) -> None:
    """Write a register, whose value is stored already."""
    base = c.VALUE + int(BASES[number])
    if word == DR:
        s[base + DR] = before
        s[c.SPI_WAITING + number] = value & (0xFFFF if s[base + CR1] & DFF else 0xFF)
        s[base + SR] &= ~TXE
    elif word == SR:
        s[base + SR] = before
    if (
        s[c.SPI_WAITING + number] >= 0
        and s[c.SPI_SHIFTING + number] < 0
        and s[base + CR1] & SPE
        and s[base + CR1] & MSTR
    ):
        _begin(s, number)
    set_spi_line(s, number)
