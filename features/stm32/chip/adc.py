"""ADC1: regular conversions, one, scanned or continuous, by software or a timer, with DMA and watchdog (RM0008, 11)."""

from typing import Final

import numpy as np

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.dma import request_dma
from steptwin.features.stm32.chip.nvic import set_line

BASE: Final = c.VALUE + (0x40012400 - c.PERIPHERALS) // 4
SR, CR1, CR2, SMPR1, SMPR2 = range(5)
HTR, LTR, SQR1, SQR3, DR = 9, 10, 11, 13, 19
AWD, EOC, STRT = 1, 2, 16
EOCIE, AWDIE, SCAN, AWDSGL, AWDEN = 32, 64, 256, 512, 1 << 23
ADON, CONT, CAL, RSTCAL, DMA, ALIGN, EXTTRIG, SWSTART, TSVREFE = 1, 2, 4, 8, 256, 1 << 11, 1 << 20, 1 << 22, 1 << 23
_BY_SOFTWARE: Final = 7
_TRIGGERS: Final = np.array([1, 2, 3, 5 + 2, 10, 15 + 4, -1, -1])
"""By EXTSEL, 5 * timer + event, of which 0 is the update and 1 to 4 are the compares (RM0008, table 69)."""
_SAMPLE_HALVES: Final = np.array([3, 15, 27, 57, 83, 111, 143, 479])
"""Sampling times in halves of a cycle; a conversion takes 12.5 cycles more (11.6)."""
_CONVERT_HALVES: Final = 25
_IRQ: Final = 18
_TEMPERATURE: Final = 16


@integer
def _channel(s: Cells, place: int) -> int:
    """Return the channel at a place of the regular sequence, from 0 on."""
    return s[BASE + SQR3 - place // 6] >> 5 * (place % 6) & 31


@integer
def _length(s: Cells) -> int:
    return (s[BASE + SQR1] >> 20 & 15) + 1 if s[BASE + CR1] & SCAN else 1


@integer
def _begin(s: Cells, place: int) -> None:
    """Begin the conversion of a place of the sequence."""
    s[c.ADC_PLACE] = place
    channel = _channel(s, place)
    time = s[BASE + SMPR2] >> 3 * channel if channel < 10 else s[BASE + SMPR1] >> 3 * (channel - 10)
    config = s[c.VALUE + (0x40021004 - c.PERIPHERALS) // 4]
    cycle = (s[c.CYCLE] << max((config >> 11 & 7) - 3, 0)) * 2 * ((config >> 14 & 3) + 1)
    halves = int(_SAMPLE_HALVES[time & 7]) + _CONVERT_HALVES
    s[c.DUES + c.ADC_DUE] = s[c.AT] + halves * cycle // 2


@integer
def trigger_adc(s: Cells, event: int) -> None:
    """Start the regular sequence if it waits for this event: 5 * timer + number."""
    if s[c.ADC_AWAITED] == event:
        _start(s)


@integer
def _start(s: Cells) -> None:
    s[BASE + SR] |= STRT
    _begin(s, 0)


@integer
def adc_event(s: Cells) -> None:
    """End a conversion; begin the next one of the sequence, or the sequence again."""
    s[c.DUES + c.ADC_DUE] = c.NEVER
    place, control, config = s[c.ADC_PLACE], s[BASE + CR2], s[BASE + CR1]
    channel = _channel(s, place)
    value = s[c.ADC_INPUT + channel] if channel < _TEMPERATURE or control & TSVREFE else 0
    s[BASE + DR] = value << 4 if control & ALIGN else value
    guarded = config & AWDEN != 0 and (config & AWDSGL == 0 or config & 31 == channel)
    if guarded and not s[BASE + LTR] <= value <= s[BASE + HTR]:
        s[BASE + SR] |= AWD
    if control & DMA:
        request_dma(s, 1)
    if place + 1 < _length(s):
        _begin(s, place + 1)
    else:
        s[BASE + SR] |= EOC
        if control & CONT:
            _begin(s, 0)
    set_adc_line(s)


@integer
def set_adc_line(s: Cells) -> None:
    """Ask for the interrupt."""
    status, enabled = s[BASE + SR], s[BASE + CR1]
    asked = (status & EOC and enabled & EOCIE) or (status & AWD and enabled & AWDIE)
    set_line(s, _IRQ, 1 if asked else 0)


@integer
def read_adc(s: Cells, word: int) -> int:
    """Return a register; a read of DR clears EOC."""
    value = s[BASE + word]
    if word == DR:
        s[BASE + SR] &= ~EOC
        set_adc_line(s)
    return value


@integer
def write_adc(s: Cells, word: int, value: int, before: int) -> None:
    """Write a register, whose value is stored already, at the instant `AT`."""
    if word == SR:
        s[BASE + SR] = before & value
    elif word == CR2:
        s[BASE + CR2] &= ~(CAL | RSTCAL | SWSTART)  # calibrated at once
        source = value >> 17 & 7
        by_event = value & (ADON | EXTTRIG) == ADON | EXTTRIG
        s[c.ADC_AWAITED] = int(_TRIGGERS[source]) if by_event else -1
        if not value & ADON:
            s[c.DUES + c.ADC_DUE] = c.NEVER
        elif before & ADON and (value == before or (by_event and source == _BY_SOFTWARE and value & SWSTART)):
            _start(s)  # by ADON alone, written to a converter that is on (11.3.1), or by software
    set_adc_line(s)
