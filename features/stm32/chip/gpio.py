"""Pins: modes, levels, the edges of those that are watched, and EXTI (RM0008, sections 9 and 10)."""

from typing import Final

import numpy as np

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.nvic import set_line
from steptwin.features.stm32.chip.outside import SELECT, ask

AFIO: Final = (0x40010000 - c.PERIPHERALS) // 4
MAPR: Final = AFIO + 1
EXTICR1: Final = AFIO + 2
EXTI: Final = (0x40010400 - c.PERIPHERALS) // 4
IMR, EMR, RTSR, FTSR, SWIER, PR = EXTI, EXTI + 1, EXTI + 2, EXTI + 3, EXTI + 4, EXTI + 5
GPIO: Final = (0x40010800 - c.PERIPHERALS) // 4
PORT_WORDS: Final = 0x400 // 4
CRL, CRH, IDR, ODR, BSRR, BRR = range(6)
_EXTI_IRQ: Final = np.array([6, 7, 8, 9, 10, 23, 23, 23, 23, 23, 40, 40, 40, 40, 40, 40])
_ALARM_IRQ: Final = 41
"""Of line 17, RTC's alarm."""

_PA, _PB, _PC, _PD, _PE = 0, 16, 32, 48, 64
CHANNEL_PINS: Final = np.array(
    [
        # timer, shift and mask of its remap in AFIO_MAPR, the remap, pins of channels 1 to 4 (RM0008, tables 43 to 46)
        [0, 6, 3, 0, _PA + 8, _PA + 9, _PA + 10, _PA + 11],
        [0, 6, 3, 1, _PA + 8, _PA + 9, _PA + 10, _PA + 11],
        [0, 6, 3, 3, _PE + 9, _PE + 11, _PE + 13, _PE + 14],
        [1, 8, 3, 0, _PA + 0, _PA + 1, _PA + 2, _PA + 3],
        [1, 8, 3, 1, _PA + 15, _PB + 3, _PA + 2, _PA + 3],
        [1, 8, 3, 2, _PA + 0, _PA + 1, _PB + 10, _PB + 11],
        [1, 8, 3, 3, _PA + 15, _PB + 3, _PB + 10, _PB + 11],
        [2, 10, 3, 0, _PA + 6, _PA + 7, _PB + 0, _PB + 1],
        [2, 10, 3, 2, _PB + 4, _PB + 5, _PB + 0, _PB + 1],
        [2, 10, 3, 3, _PC + 6, _PC + 7, _PC + 8, _PC + 9],
        [3, 12, 1, 0, _PB + 6, _PB + 7, _PB + 8, _PB + 9],
        [3, 12, 1, 1, _PD + 12, _PD + 13, _PD + 14, _PD + 15],
    ]
)


@integer
def route_channels(s: Cells) -> None:
    """Find the pin of each timer's channels, after a change of AFIO_MAPR."""
    for row in range(CHANNEL_PINS.shape[0]):
        if s[c.VALUE + MAPR] >> int(CHANNEL_PINS[row, 1]) & int(CHANNEL_PINS[row, 2]) == int(CHANNEL_PINS[row, 3]):
            for channel in range(4):
                s[c.CHANNEL_PIN + 4 * int(CHANNEL_PINS[row, 0]) + channel] = int(CHANNEL_PINS[row, 4 + channel])


@integer
def set_modes(s: Cells, port: int) -> None:
    """Read a port's modes, after a change of CRL or CRH (RM0008, 9.2.1)."""
    first = c.VALUE + GPIO + port * PORT_WORDS
    modes = s[first + CRL] | s[first + CRH] << 32
    push_pull = open_drain = alternate = pulled = 0
    for pin in range(16):
        mode, kind = modes >> 4 * pin & 3, modes >> 4 * pin + 2 & 3
        if mode:
            if kind & 2:
                alternate |= 1 << pin
            if kind & 1:
                open_drain |= 1 << pin
            else:
                push_pull |= 1 << pin
        elif kind == 2:
            pulled |= 1 << pin
    s[c.PUSH_PULL + port], s[c.OPEN_DRAIN + port] = push_pull, open_drain
    s[c.ALTERNATE + port], s[c.PULLED + port] = alternate, pulled
    s[c.WAS_OUTPUT + port] |= push_pull | open_drain
    s[c.LEFT_OUTPUT + port] |= s[c.WAS_OUTPUT + port] & ~(push_pull | open_drain)
    refresh(s, port)


@integer
def refresh(s: Cells, port: int) -> None:
    """Work out the levels of a port's pins at `AT`; keep the edges of those that are watched."""
    alternate, open_drain = s[c.ALTERNATE + port], s[c.OPEN_DRAIN + port]
    latch = s[c.VALUE + GPIO + port * PORT_WORDS + ODR]
    wanted = latch & ~alternate | s[c.BY_DEVICE + port] & alternate
    drives = s[c.PUSH_PULL + port] | open_drain & ~wanted
    driven = s[c.DRIVEN + port] & ~drives
    idle = latch & s[c.PULLED + port] | s[c.RELEASED + port] & ~s[c.PULLED + port]
    levels = (wanted & drives | s[c.OUTSIDE + port] & driven | idle & ~drives & ~driven) & 0xFFFF
    changed = levels ^ s[c.LEVELS + port]
    if not changed:
        return
    s[c.LEVELS + port] = levels
    if changed & s[c.INPUT_MASK + port]:
        s[c.INPUT_RISES + port] |= changed & levels
        s[c.INPUT_FALLS + port] |= changed & ~levels
        s[c.TIMER_PULSES] |= 1 << 8
    if changed & s[c.SELECT_MASK + port]:
        for pin in range(16):
            if changed & s[c.SELECT_MASK + port] & 1 << pin:
                ask(s, SELECT, 16 * port + pin, levels >> pin & 1)
    kept = changed & s[c.WATCHED + port]
    pin = 0
    while kept:
        if kept & 1:
            place = c.EDGES + 2 * s[c.EDGE_COUNT]
            s[place] = s[c.AT] // c.GRAINS
            s[place + 1] = 2 * (16 * port + pin) + (levels >> pin & 1)
            if s[c.EDGE_COUNT] < c.EDGE_CAPACITY - 1:
                s[c.EDGE_COUNT] += 1
        kept >>= 1
        pin += 1
    _trigger(s, port, changed & levels & s[c.VALUE + RTSR] | changed & ~levels & s[c.VALUE + FTSR])


@integer
def _trigger(s: Cells, port: int, pins: int) -> None:
    """Note edges that EXTI waits for, at lines that are of this port."""
    pin = 0
    while pins:
        if pins & 1 and s[c.VALUE + EXTICR1 + pin // 4] >> 4 * (pin % 4) & 0xF == port:
            s[c.VALUE + PR] |= 1 << pin
        pins >>= 1
        pin += 1
    set_exti_lines(s)


@integer
def set_exti_lines(s: Cells) -> None:
    """Ask for the interrupts of the pending lines of EXTI that are not masked."""
    asked, irqs = s[c.VALUE + PR] & s[c.VALUE + IMR], 0
    for pin in range(16):
        if asked >> pin & 1:
            irqs |= 1 << int(_EXTI_IRQ[pin])
    for irq in (6, 7, 8, 9, 10, 23, 40):
        set_line(s, irq, irqs >> irq & 1)
    set_line(s, _ALARM_IRQ, asked >> 17 & 1)


@integer
def write_gpio(s: Cells, port: int, word: int, value: int) -> None:
    """Write a register of a port, whose value is stored already where it is one that is kept."""
    latch = c.VALUE + GPIO + port * PORT_WORDS + ODR
    if word in (CRL, CRH):
        set_modes(s, port)
        return
    if word == BSRR:
        s[latch] = s[latch] & ~(value >> 16) & 0xFFFF | value & 0xFFFF
    elif word == BRR:
        s[latch] &= ~value & 0xFFFF
    if word in (ODR, BSRR, BRR):
        refresh(s, port)


@integer
def write_exti(s: Cells, register: int, value: int) -> None:
    """Write a register of EXTI: 1 clears a pending bit, and a bit of SWIER sets it."""
    if register == PR:
        s[c.VALUE + PR] &= ~value
        s[c.VALUE + SWIER] &= ~value
    elif register == SWIER:
        s[c.VALUE + PR] |= value & s[c.VALUE + IMR]
    set_exti_lines(s)


@integer
def set_device_pin(s: Cells, pin: int, level: int) -> None:
    """Set the level that a peripheral gives its pin, numbered 16 * port + pin."""
    port, bit = pin // 16, 1 << pin % 16
    before = s[c.BY_DEVICE + port]
    s[c.BY_DEVICE + port] = before | bit if level else before & ~bit
    if s[c.BY_DEVICE + port] != before:
        refresh(s, port)
