"""TIM1 to TIM4 (RM0008, sections 14 and 15): update, compare, toggle, PWM, one pulse, preload; `timer_inputs` has more.

A timer that runs has no steps: its counter follows from an instant and a phase. It is looked at when a register is
read or written, and at the next event that somebody waits for. The phase counts up from 0 to 0; the counter is the
phase (counting up), the reload less the phase (down), or one and then the other (centre-aligned).
"""

from typing import Final

import numpy as np

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.adc import trigger_adc
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.dma import request_dma, withdraw_dma
from steptwin.features.stm32.chip.gpio import set_device_pin
from steptwin.features.stm32.chip.nvic import FIRST_IRQ, set_line

CR1, CR2, SMCR, DIER, SR, EGR, CCMR1, CCMR2, CCER, CNT, PSC, ARR, RCR, CCR1 = range(14)
BDTR: Final = 17
BASES: Final = np.array([(at - c.PERIPHERALS) // 4 for at in (0x40012C00, 0x40000000, 0x40000400, 0x40000800)])
_UPDATE_IRQ: Final = np.array([25, 28, 29, 30])
_COMPARE_IRQ: Final = np.array([27, 28, 29, 30])
_LATE_TICKS: Final = 0xC000
"""A compare value that is further ahead was meant to be just ahead, and is behind."""
_TRIGGER_IRQ: Final = 26
_DMA: Final = np.array([[5, 2, 3, 6, 4], [2, 5, 7, 1, 7], [3, 6, 0, 2, 3], [7, 1, 4, 5, 0]])
"""Channels of update and compare 1 to 4 (RM0008, table 78); 0 is none."""
CEN, UDIS, URS, OPM, DIRECTION, ARPE = 1, 2, 4, 8, 0x10, 0x80
UIF: Final = 1


@integer
def selection(s: Cells, timer: int, channel: int) -> int:
    """Return CCxS of a channel: 0 for an output, else the input that it captures."""
    return s[c.VALUE + int(BASES[timer]) + CCMR1 + channel // 2] >> 8 * (channel % 2) & 3


@integer
def _mode(s: Cells, timer: int, channel: int) -> int:
    """Return OCxM of a channel, and 8 if its compare register is preloaded; 0 for an input."""
    word = s[c.VALUE + int(BASES[timer]) + CCMR1 + channel // 2] >> 8 * (channel % 2)
    return 0 if word & 3 else word >> 4 & 7 | word & 8


@integer
def _shows(s: Cells, timer: int, channel: int) -> bool:
    """Return whether a channel drives its pin."""
    base = c.VALUE + int(BASES[timer])
    if s[base + CCER] >> 4 * channel & 1 == 0 or selection(s, timer, channel):
        return False
    return timer > 0 or s[base + BDTR] >> 15 & 1 != 0


@integer
def show(s: Cells, timer: int, channel: int) -> None:
    """Set the pin of a channel to the channel's level."""
    inverted = s[c.VALUE + int(BASES[timer]) + CCER] >> 4 * channel + 1 & 1
    level = s[c.OUTPUT + 4 * timer + channel] ^ inverted if _shows(s, timer, channel) else 0
    set_device_pin(s, s[c.CHANNEL_PIN + 4 * timer + channel], level)


@integer
def _set_output(s: Cells, timer: int, channel: int, level: int) -> None:
    if s[c.OUTPUT + 4 * timer + channel] != level:
        s[c.OUTPUT + 4 * timer + channel] = level
        if s[c.VALUE + int(BASES[timer]) + CR2] >> 4 & 7 == 4 + channel:
            s[c.TIMER_PULSES] |= 1 << timer if level else 1 << 16 + timer
        show(s, timer, channel)


@integer
def set_timer_lines(s: Cells, timer: int) -> None:
    """Ask for the timer's interrupts."""
    base = c.VALUE + int(BASES[timer])
    asked = s[base + SR] & s[base + DIER]
    if timer:
        set_line(s, int(_UPDATE_IRQ[timer]), 1 if asked & 0x5F else 0)
    else:
        set_line(s, int(_UPDATE_IRQ[0]), asked & UIF)
        set_line(s, int(_COMPARE_IRQ[0]), 1 if asked & 0x1E else 0)
        set_line(s, _TRIGGER_IRQ, asked >> 6 & 1)


@integer
def _centred(s: Cells, timer: int) -> int:
    """Return CMS: 0, or when a centre-aligned timer flags its compares: 1 counting down, 2 up, 3 both."""
    return s[c.VALUE + int(BASES[timer]) + CR1] >> 5 & 3


@integer
def _period(s: Cells, timer: int) -> int:
    """Return the ticks from 0 to 0; a counter beyond its end counts on to 65 535 once."""
    if _centred(s, timer):
        return 2 * s[c.RELOAD + timer]
    return s[c.RELOAD + timer] + 1 if s[c.COUNTER + timer] <= s[c.RELOAD + timer] else 0x10000


@integer
def counts_down(s: Cells, timer: int) -> bool:
    """Return whether the counter falls now."""
    if _centred(s, timer):
        return s[c.COUNTER + timer] >= s[c.RELOAD + timer]
    return s[c.VALUE + int(BASES[timer]) + CR1] & DIRECTION != 0


@integer
def counter_value(s: Cells, timer: int) -> int:
    """Return the counter."""
    phase, reload = s[c.COUNTER + timer], s[c.RELOAD + timer]
    if _centred(s, timer):
        return phase if phase <= reload else 2 * reload - phase
    if s[c.VALUE + int(BASES[timer]) + CR1] & DIRECTION:
        return reload - phase & 0xFFFF
    return phase


@integer
def set_counter(s: Cells, timer: int, value: int) -> None:
    """Set the counter at `AT`; one that falls or is centre-aligned begins within its reload."""
    reload = s[c.RELOAD + timer]
    if _centred(s, timer):
        s[c.COUNTER + timer] = min(value, reload)
    elif s[c.VALUE + int(BASES[timer]) + CR1] & DIRECTION:
        s[c.COUNTER + timer] = reload - min(value, reload)
    else:
        s[c.COUNTER + timer] = value
    s[c.COUNTER_AT + timer] = s[c.AT]


@integer
def _ticks_to_phase(s: Cells, timer: int, phase: int) -> int:
    """Return the ticks until a phase is reached next, at least 1; `NEVER` if it is not."""
    period, now = _period(s, timer), s[c.COUNTER + timer]
    if phase > now:
        return phase - now if phase < period else c.NEVER
    return period - now + phase if phase <= s[c.RELOAD + timer] or phase < period else c.NEVER


@integer
def _ticks_to(s: Cells, timer: int, value: int) -> int:
    """Return the ticks until the counter reaches a value next, at least 1; `NEVER` if it does not."""
    control, reload = s[c.VALUE + int(BASES[timer]) + CR1], s[c.RELOAD + timer]
    if control & 0x70 == 0:
        period, now = _period(s, timer), s[c.COUNTER + timer]
        if value > now:
            return value - now if value < period else c.NEVER
        return period - now + value if value <= reload else c.NEVER
    if value > reload:
        return c.NEVER
    if control & 0x60 == 0:
        return _ticks_to_phase(s, timer, reload - value)
    down = _ticks_to_phase(s, timer, 2 * reload - value if value else 0)
    return min(_ticks_to_phase(s, timer, value), down)


@integer
def _is_awaited(s: Cells, timer: int, bit: int) -> bool:
    """Return whether somebody would notice an event: update is 0, the channels are 1 to 4."""
    base = c.VALUE + int(BASES[timer])
    if bit and selection(s, timer, bit - 1):
        return False
    awaited = s[c.TIMER_AWAITED + timer] >> bit & 1
    if awaited or not s[base + SR] >> bit & 1 or s[base + DIER] >> bit & 0x101:
        return True
    if bit:
        return _shows(s, timer, bit - 1)
    return s[base + CR1] & OPM != 0 or _has_preload(s, timer)


@integer
def _has_preload(s: Cells, timer: int) -> bool:
    base = c.VALUE + int(BASES[timer])
    if s[base + PSC] != s[c.PRESCALER + timer] or s[base + ARR] != s[c.RELOAD + timer]:
        return True
    for channel in range(4):
        if s[base + CCR1 + channel] != s[c.COMPARE + 4 * timer + channel]:
            return True
        if _shows(s, timer, channel) and _mode(s, timer, channel) & 7 >= 6:
            return True
    return False


@integer
def _runs(s: Cells, timer: int) -> bool:
    """Return whether the counter follows from the time: not from a trigger's edges, nor held by a gate."""
    held = s[c.TIMER_HELD + timer] != 0
    return s[c.VALUE + int(BASES[timer]) + CR1] & CEN != 0 and s[c.RELOAD + timer] != 0 and not held


@integer
def schedule_timer(s: Cells, timer: int) -> None:
    """Find when the timer's next event is that somebody waits for."""
    if not _runs(s, timer):
        s[c.DUES + c.TIMER_DUE + timer] = c.NEVER
        return
    ticks = c.NEVER
    if _is_awaited(s, timer, 0):
        ticks = _ticks_to_phase(s, timer, 0)
        if _centred(s, timer):
            ticks = min(ticks, _ticks_to_phase(s, timer, s[c.RELOAD + timer]))
    for channel in range(4):
        if _is_awaited(s, timer, channel + 1):
            ticks = min(ticks, _ticks_to(s, timer, s[c.COMPARE + 4 * timer + channel]))
    due = c.NEVER if ticks == c.NEVER else s[c.COUNTER_AT + timer] + ticks * s[c.COUNTER_TICK + timer]
    s[c.DUES + c.TIMER_DUE + timer] = due


@integer
def count_to(s: Cells, timer: int, now: int) -> None:
    """Let the counter of a timer that runs pass on to an instant before its next awaited event, or to that event."""
    if not _runs(s, timer):
        s[c.COUNTER_AT + timer] = now
        return
    ticks = (now - s[c.COUNTER_AT + timer]) // s[c.COUNTER_TICK + timer]
    s[c.COUNTER_AT + timer] += ticks * s[c.COUNTER_TICK + timer]
    period = _period(s, timer)
    value = s[c.COUNTER + timer] + ticks
    if value >= period:
        value = (value - period) % (period if _centred(s, timer) else s[c.RELOAD + timer] + 1)
    s[c.COUNTER + timer] = value


@integer
def load(s: Cells, timer: int) -> None:
    """Take over the preloaded registers, as an update does."""
    base = c.VALUE + int(BASES[timer])
    s[c.PRESCALER + timer], s[c.RELOAD + timer] = s[base + PSC], s[base + ARR]
    if s[base + CR1] & 0x70:
        last = 2 * s[c.RELOAD + timer] - 1 if _centred(s, timer) else s[c.RELOAD + timer]
        s[c.COUNTER + timer] = min(s[c.COUNTER + timer], max(last, 0))
    for channel in range(4):
        s[c.COMPARE + 4 * timer + channel] = s[base + CCR1 + channel]
    set_tick(s, timer)


@integer
def set_tick(s: Cells, timer: int) -> None:
    """Set the length of a tick: the APB's clock, doubled if the APB is divided, by the prescaler (RM0008, 7.2)."""
    divider = s[c.VALUE + (0x40021004 - c.PERIPHERALS) // 4] >> (8 if timer else 11) & 7
    cycles = 1 << max(divider - 4, 0)  # 2 << (divider - 4), halved
    s[c.COUNTER_TICK + timer] = s[c.CYCLE] * cycles * (s[c.PRESCALER + timer] + 1)


@integer
def timer_event(s: Cells, timer: int) -> None:
    """Do what happens at the instant `AT`, which is the timer's next awaited event."""
    count_to(s, timer, s[c.AT])
    phase = s[c.COUNTER + timer]
    note_count(s, timer, phase == 0 or (_centred(s, timer) != 0 and phase == s[c.RELOAD + timer]))


@integer
def note_count(s: Cells, timer: int, wraps: bool) -> None:
    """Do what the present count brings: an update if it wraps, compares and levels of the channels."""
    base = c.VALUE + int(BASES[timer])
    centred = _centred(s, timer)
    value = counter_value(s, timer)
    if wraps and not s[base + CR1] & UDIS:
        s[c.OVERRUNS + FIRST_IRQ + int(_UPDATE_IRQ[timer])] += s[base + SR] & s[base + DIER] & UIF
        s[base + SR] |= UIF
        update(s, timer)
        if s[base + CR1] & OPM:
            s[base + CR1] &= ~CEN
        if not centred and s[base + CR1] & DIRECTION:
            value = s[c.RELOAD + timer]
    down = counts_down(s, timer)
    for channel in range(4):
        mode = _mode(s, timer, channel) & 7
        matches = s[c.COMPARE + 4 * timer + channel] == value and not selection(s, timer, channel)
        if matches and (not centred or centred & (1 if down else 2)):
            late = s[base + SR] & s[base + DIER] & 2 << channel
            s[c.OVERRUNS + FIRST_IRQ + int(_COMPARE_IRQ[timer])] += 1 if late else 0
            compare(s, timer, channel)
        if mode >= 6:
            _set_output(s, timer, channel, _pwm_level(s, timer, channel, value, down))
        elif matches and mode in (1, 2):
            _set_output(s, timer, channel, mode & 1)
        elif matches and mode == 3:
            _set_output(s, timer, channel, 1 - s[c.OUTPUT + 4 * timer + channel])
    set_timer_lines(s, timer)
    schedule_timer(s, timer)


@integer
def _pwm_level(s: Cells, timer: int, channel: int, value: int, down: bool) -> int:
    """Return a channel's level in a PWM mode: active below its compare value, counting down also at it (15.3.9)."""
    limit = s[c.COMPARE + 4 * timer + channel]
    active = value <= limit if down else value < limit
    return 1 if active == (_mode(s, timer, channel) & 7 == 6) else 0


@integer
def update(s: Cells, timer: int) -> None:
    """Take over the preloaded registers; ask for DMA, and trigger others."""
    base = c.VALUE + int(BASES[timer])
    if s[base + DIER] >> 8 & 1:
        request_dma(s, int(_DMA[timer, 0]))
    if s[base + CR2] >> 4 & 7 == 2:
        s[c.TIMER_PULSES] |= 1 << timer
    trigger_adc(s, 5 * timer)
    load(s, timer)


@integer
def compare(s: Cells, timer: int, channel: int) -> None:
    """Flag a compare or capture; ask for DMA, and trigger others."""
    base = c.VALUE + int(BASES[timer])
    s[base + SR] |= 2 << channel
    if s[base + DIER] >> 9 + channel & 1:
        request_dma(s, int(_DMA[timer, 1 + channel]))
    if channel == 0 and s[base + CR2] >> 4 & 7 == 3:
        s[c.TIMER_PULSES] |= 1 << timer
    trigger_adc(s, 5 * timer + 1 + channel)


@integer
def generate_update(s: Cells, timer: int) -> None:
    """Begin at phase 0, as UG and the slave mode "reset" do; that is an update unless URS or UDIS forbid it."""
    base = c.VALUE + int(BASES[timer])
    if s[base + CR2] >> 4 & 7 == 0:
        s[c.TIMER_PULSES] |= 1 << timer
    if s[base + CR1] & (URS | UDIS):
        load(s, timer)
    else:
        s[base + SR] |= UIF
        update(s, timer)
    s[c.COUNTER + timer], s[c.COUNTER_AT + timer] = 0, s[c.AT]


@integer
def read_timer(s: Cells, timer: int, word: int) -> int:
    """Return a register at the instant `AT`."""
    if word in (CNT, CR1):
        count_to(s, timer, s[c.AT])
    base = c.VALUE + int(BASES[timer])
    if word == CNT:
        return counter_value(s, timer)
    if word == CR1 and s[c.TIMER_FALLS + timer]:
        return s[base + CR1] | DIRECTION
    if word == CR1 and _centred(s, timer):
        return s[base + CR1] & ~DIRECTION | (DIRECTION if counts_down(s, timer) else 0)
    if CCR1 <= word < CCR1 + 4 and s[base + SR] and selection(s, timer, word - CCR1):
        s[base + SR] &= ~(2 << word - CCR1)  # reading a capture clears its flag (15.4.5)
        set_timer_lines(s, timer)
    return s[base + word]


@integer
def _set_channels(s: Cells, timer: int, shown: bool) -> None:
    """Set the outputs whose mode gives them a level now, and the pins of all if what shows them has changed."""
    for channel in range(4):
        mode = _mode(s, timer, channel) & 7
        if mode in (4, 5):
            _set_output(s, timer, channel, mode & 1)
        elif mode >= 6:
            value, down = counter_value(s, timer), counts_down(s, timer)
            _set_output(s, timer, channel, _pwm_level(s, timer, channel, value, down))
        if shown:
            show(s, timer, channel)


@integer
def _note_late_compare(s: Cells, timer: int, channel: int) -> None:
    """Count a compare value that a free-running counter with an interrupt has just passed: it waits a whole turn."""
    base = c.VALUE + int(BASES[timer])
    waits = s[base + CR1] & (CEN | 0x70) == CEN and s[base + DIER] >> 1 + channel & 1 and s[c.RELOAD + timer] == 0xFFFF
    if waits and _ticks_to(s, timer, s[c.COMPARE + 4 * timer + channel]) > _LATE_TICKS:
        s[c.OVERRUNS + FIRST_IRQ + int(_COMPARE_IRQ[timer])] += 1


@integer
def write_timer(s: Cells, timer: int, word: int, value: int, before: int) -> None:
    """Write a register, whose value is stored already, at the instant `AT`."""
    base = c.VALUE + int(BASES[timer])
    new = s[base + word]
    s[base + word] = before
    count_to(s, timer, s[c.AT])
    value_before = counter_value(s, timer)
    s[base + word] = new
    if word == SR:
        s[base + SR] = before & value
    elif word == DIER:
        for event in range(5):
            if before & ~new & 1 << 8 + event:
                withdraw_dma(s, int(_DMA[timer, event]))
    elif word == CNT:
        set_counter(s, timer, value & 0xFFFF)
    elif word == CR1:
        if (before ^ new) & 0x70:
            set_counter(s, timer, value_before)
        if (new ^ before) & CEN and s[base + CR2] >> 4 & 7 == 1:
            s[c.TIMER_PULSES] |= 1 << timer if new & CEN else 1 << 16 + timer
    elif word == ARR and not s[base + CR1] & ARPE:
        s[c.RELOAD + timer] = new
        if s[base + CR1] & 0x70:
            set_counter(s, timer, value_before)
    elif CCR1 <= word < CCR1 + 4 and selection(s, timer, word - CCR1):
        s[base + word] = before
    elif CCR1 <= word < CCR1 + 4 and not _mode(s, timer, word - CCR1) & 8:
        s[c.COMPARE + 4 * timer + word - CCR1] = new
        _note_late_compare(s, timer, word - CCR1)
    elif word == EGR:
        s[base + EGR] = 0
        if value & 1:
            generate_update(s, timer)
        for channel in range(4):
            if value >> 1 + channel & 1:
                compare(s, timer, channel)
    if word not in (SR, DIER):
        _set_channels(s, timer, word in (CCER, BDTR))
    set_timer_lines(s, timer)
    schedule_timer(s, timer)
