"""I2C1 and I2C2 as masters: start, address, bytes both ways, stop; flags, interrupts, DMA (RM0008, section 26)."""

from typing import Final

import numpy as np

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.dma import OF_I2CS, set_dma_level
from steptwin.features.stm32.chip.nvic import set_line
from steptwin.features.stm32.chip.outside import READ, START, STOP, WRITE, ask

BASES: Final = np.array([(at - c.PERIPHERALS) // 4 for at in (0x40005400, 0x40005800)])
CR1, CR2, OAR1, OAR2, DR, SR1, SR2, CCR, TRISE = range(9)
PE, START_BIT, STOP_BIT, ACK, POS, SWRST = 1, 1 << 8, 1 << 9, 1 << 10, 1 << 11, 1 << 15
ITERREN, ITEVTEN, ITBUFEN, DMAEN = 1 << 8, 1 << 9, 1 << 10, 1 << 11
SB, ADDR, BTF, RXNE, TXE, AF = 1, 2, 4, 64, 128, 1 << 10
MSL, BUSY, TRA = 1, 2, 4
_FIRST_IRQ: Final = 31
_DMA: Final = np.array([[6, 7], [4, 5]])
"""Channels of sender and receiver (RM0008, table 78)."""
IDLE, STARTING, ADDRESSING, SENDING, RECEIVING, HOLDING = range(6)
"""What happens on the wires; HOLDING: the clock is held low until the firmware goes on."""
_BYTE_BITS: Final = 9


@integer
def _bit_grains(s: Cells, number: int) -> int:
    """Return the length of a bit: 2 CCR cycles of PCLK1, in fast mode 3 or 25 (26.6.8)."""
    config = s[c.VALUE + int(BASES[number]) + CCR]
    cycle = s[c.CYCLE] << max((s[c.VALUE + (0x40021004 - c.PERIPHERALS) // 4] >> 8 & 7) - 3, 0)
    factor = 2 if not config >> 15 & 1 else 25 if config >> 14 & 1 else 3
    return max(config & 0xFFF, 1) * factor * cycle


@integer
def set_i2c_lines(s: Cells, number: int) -> None:
    """Ask for the interrupts of events and errors, and for DMA."""
    base = c.VALUE + int(BASES[number])
    status, control = s[base + SR1], s[base + CR2]
    event = status & (SB | ADDR | BTF) or (control & ITBUFEN and status & (RXNE | TXE))
    set_line(s, _FIRST_IRQ + 2 * number, 1 if control & ITEVTEN and event else 0)
    set_line(s, _FIRST_IRQ + 2 * number + 1, 1 if control & ITERREN and status & AF else 0)
    if control & DMAEN or s[c.DMA_LEVELS]:
        set_dma_level(s, OF_I2CS, int(_DMA[number, 0]), 1 if control & DMAEN and status & TXE else 0)
        set_dma_level(s, OF_I2CS, int(_DMA[number, 1]), 1 if control & DMAEN and status & RXNE else 0)


@integer
def _let(s: Cells, number: int, action: int, bits: int) -> None:
    """Let something happen on the wires for so many bits."""
    s[c.I2C_STATE + number] = action
    s[c.DUES + c.I2C_DUE + number] = s[c.AT] + bits * _bit_grains(s, number)
    s[c.DUE] = min(s[c.DUE], s[c.DUES + c.I2C_DUE + number])  # a read may begin it, too


@integer
def _hold(s: Cells, number: int) -> None:
    s[c.I2C_STATE + number], s[c.DUES + c.I2C_DUE + number] = HOLDING, c.NEVER


@integer
def _go_on(s: Cells, number: int) -> bool:
    """Do a stop or start that the firmware has asked for, between two bytes; return False if it has not."""
    base = c.VALUE + int(BASES[number])
    if s[base + CR1] & STOP_BIT and s[base + SR2] & MSL:
        ask(s, STOP, number, 0)
        s[base + CR1] &= ~STOP_BIT
        if s[base + SR2] & TRA:
            s[base + SR1] &= ~(TXE | BTF)  # of a receiver two bytes may still be read
        s[base + SR2] &= ~(MSL | BUSY | TRA)
        s[c.I2C_STATE + number], s[c.DUES + c.I2C_DUE + number] = IDLE, c.NEVER
    if s[base + CR1] & (START_BIT | PE) == START_BIT | PE:
        _let(s, number, STARTING, 1)
        return True
    return s[c.I2C_STATE + number] == IDLE


@integer
def i2c_event(s: Cells, number: int) -> None:
    """End what happens on the wires."""
    base, state = c.VALUE + int(BASES[number]), s[c.I2C_STATE + number]
    _hold(s, number)
    if state == STARTING:
        s[base + CR1] &= ~START_BIT
        s[base + SR1] = s[base + SR1] & ~(TXE | BTF) | SB
        s[base + SR2] = s[base + SR2] & ~TRA | MSL | BUSY
    elif state == ADDRESSING:
        reads = s[c.I2C_SHIFTING + number] & 1
        if ask(s, START, number, s[c.I2C_SHIFTING + number]):
            s[base + SR1] |= ADDR
            if not reads:
                s[base + SR2] |= TRA
        else:
            s[base + SR1] |= AF
            _go_on(s, number)
    elif state == SENDING:
        _sent(s, number)
    elif state == RECEIVING:
        _received(s, number)
    set_i2c_lines(s, number)


@integer
def _sent(s: Cells, number: int) -> None:
    base = c.VALUE + int(BASES[number])
    if not ask(s, WRITE, number, s[c.I2C_SHIFTING + number]):
        s[base + SR1] = s[base + SR1] & ~TXE | AF
    if s[c.I2C_WAITING + number] >= 0 and not s[base + SR1] & AF:
        _send(s, number)
    elif not _go_on(s, number) and not s[base + SR1] & AF:
        s[base + SR1] |= BTF


@integer
def _send(s: Cells, number: int) -> None:
    base = c.VALUE + int(BASES[number])
    s[c.I2C_SHIFTING + number], s[c.I2C_WAITING + number] = s[c.I2C_WAITING + number], -1
    s[base + SR1] = s[base + SR1] & ~BTF | TXE
    _let(s, number, SENDING, _BYTE_BITS)


@integer
def _received(s: Cells, number: int) -> None:
    """Take a byte; go on with the next one if this one is acknowledged (26.3.3)."""
    base = c.VALUE + int(BASES[number])
    byte = ask(s, READ, number, 0) & 0xFF
    acknowledged = s[c.I2C_ACK + number] if s[base + CR1] & POS else s[base + CR1] & ACK
    s[c.I2C_MORE + number] = 1 if acknowledged else 0
    if s[base + SR1] & RXNE:
        s[c.I2C_SHIFTING + number] = byte
        s[base + SR1] |= BTF
        _go_on(s, number)
        return
    s[base + DR] = byte
    s[base + SR1] |= RXNE
    if not _go_on(s, number) and acknowledged:
        _receive(s, number)


@integer
def _receive(s: Cells, number: int) -> None:
    s[c.I2C_ACK + number] = s[c.VALUE + int(BASES[number]) + CR1] & ACK
    _let(s, number, RECEIVING, _BYTE_BITS)


@integer
def read_i2c(s: Cells, number: int, word: int) -> int:
    """Return a register; SR2 clears ADDR, after which bytes follow, and DR takes a byte."""
    base = c.VALUE + int(BASES[number])
    value = s[base + word]
    if word == SR2 and s[base + SR1] & ADDR:
        s[base + SR1] &= ~ADDR
        if value & TRA:
            s[base + SR1] |= TXE
        elif not s[base + SR1] & BTF:
            _receive(s, number)
    elif word == DR:
        if s[base + SR1] & BTF and not s[base + SR2] & TRA:
            s[base + DR] = s[c.I2C_SHIFTING + number]
            s[base + SR1] &= ~BTF
            if s[c.I2C_STATE + number] == HOLDING and not _go_on(s, number) and s[c.I2C_MORE + number]:
                _receive(s, number)
        else:
            s[base + SR1] &= ~RXNE
    set_i2c_lines(s, number)
    return value


@integer
def write_i2c(s: Cells, number: int, word: int, value: int, before: int) -> None:
    """Write a register, whose value is stored already."""
    base = c.VALUE + int(BASES[number])
    if word == CR1:
        if value & SWRST or not value & PE:
            s[base + SR1] = s[base + SR2] = 0
            s[c.I2C_STATE + number], s[c.DUES + c.I2C_DUE + number] = IDLE, c.NEVER
            s[c.I2C_WAITING + number] = -1
            s[base + CR1] &= ~(START_BIT | STOP_BIT)
        elif s[c.I2C_STATE + number] in (IDLE, HOLDING) and (not s[base + SR1] & (SB | ADDR) or value & STOP_BIT):
            _go_on(s, number)
    elif word == SR1:
        s[base + SR1] = before & (value | ~(0xDF00))
    elif word == DR:
        s[base + DR] = before
        if s[base + SR1] & SB:
            s[base + SR1] &= ~(SB | TXE | RXNE | BTF)
            s[c.I2C_SHIFTING + number], s[c.I2C_WAITING + number] = value & 0xFF, -1
            _let(s, number, ADDRESSING, _BYTE_BITS)
        elif s[base + SR2] & TRA:
            s[c.I2C_WAITING + number] = value & 0xFF
            s[base + SR1] &= ~(TXE | BTF)
            if s[c.I2C_STATE + number] == HOLDING:
                _send(s, number)
    set_i2c_lines(s, number)
