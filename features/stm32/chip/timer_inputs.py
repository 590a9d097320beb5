"""Timers by their inputs: capture, slave modes, external clock and encoder (RM0008, 15.3.5, 15.3.12 and 15.3.14).

The digital filters pass each edge at once.
"""

from typing import Final

import numpy as np

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.timers import (
    BASES,
    CCER,
    CCMR1,
    CCR1,
    CEN,
    CR1,
    DIRECTION,
    SMCR,
    SR,
    compare,
    count_to,
    counter_value,
    generate_update,
    note_count,
    schedule_timer,
    selection,
    set_timer_lines,
)

CR2: Final = 1
_RESET, _GATED, _TRIGGER, _CLOCK = 4, 5, 6, 7
"""Values of SMS."""
_TI1_EDGES, _TI1, _TI2 = 4, 5, 6
"""Values of TS; 0 to 3 are other timers."""
_MASTERS: Final = np.array([[-1, 1, 2, 3], [0, -1, 2, 3], [0, 1, -1, 3], [0, 1, 2, -1]])
"""By timer, the one behind ITR0 to ITR3 (RM0008, tables 82 and 86)."""
TIF, CC1OF = 64, 512
_EDGES: Final = 1 << 8
"""Bit of `TIMER_PULSES`: edges at inputs wait."""
_ADC_EVENTS: Final = 5


@integer
def _mode(s: Cells, timer: int) -> int:
    return s[c.VALUE + int(BASES[timer]) + SMCR] & 7


@integer
def _source(s: Cells, timer: int) -> int:
    return s[c.VALUE + int(BASES[timer]) + SMCR] >> 4 & 7


@integer
def _by_encoder(s: Cells, timer: int) -> bool:
    return 1 <= _mode(s, timer) <= 3


@integer
def _listens(s: Cells, timer: int, number: int) -> bool:
    """Return whether a timer needs the edges of its input TI1 to TI4, numbered from 0."""
    enabled = s[c.VALUE + int(BASES[timer]) + CCER]
    for channel in range(4):
        chosen = selection(s, timer, channel)
        if enabled >> 4 * channel & 1 and (
            (chosen == 1 and channel == number) or (chosen == 2 and channel ^ 1 == number)
        ):
            return True
    if _by_encoder(s, timer):
        return number < 2
    source = _source(s, timer)
    by_input = (number == 0 and source in (_TI1_EDGES, _TI1)) or (number == 1 and source == _TI2)
    return _mode(s, timer) >= _RESET and by_input


@integer
def route_inputs(s: Cells) -> None:
    """Find which pins and events matter to timers and ADC, after a change of their registers or of pins' places."""
    for port in range(c.PORTS):
        s[c.INPUT_MASK + port] = 0
    for timer in range(c.TIMERS):
        s[c.TIMER_AWAITED + timer] = 0
    for timer in range(c.TIMERS):
        for number in range(4):
            if _listens(s, timer, number):
                pin = s[c.CHANNEL_PIN + 4 * timer + number]
                s[c.INPUT_MASK + pin // 16] |= 1 << pin % 16
        mode, source = _mode(s, timer), _source(s, timer)
        if mode >= _RESET and source < 4 and int(_MASTERS[timer, source]) >= 0:
            master = int(_MASTERS[timer, source])
            by = s[c.VALUE + int(BASES[master]) + CR2] >> 4 & 7
            if by >= 2:
                s[c.TIMER_AWAITED + master] |= 1 if by == 2 else 2 if by == 3 else 1 | 2 << by - 4
        held = 1 if mode == _CLOCK or 1 <= mode <= 3 else 2 if mode == _GATED and not _gate_is_open(s, timer) else 0
        _hold(s, timer, held)
    if s[c.ADC_AWAITED] >= 0:
        s[c.TIMER_AWAITED + s[c.ADC_AWAITED] // _ADC_EVENTS] |= 1 << s[c.ADC_AWAITED] % _ADC_EVENTS
    for timer in range(c.TIMERS):
        schedule_timer(s, timer)


@integer
def _hold(s: Cells, timer: int, held: int) -> None:
    if s[c.TIMER_HELD + timer] != held:
        count_to(s, timer, s[c.AT])
        s[c.TIMER_HELD + timer], s[c.COUNTER_AT + timer] = held, s[c.AT]


@integer
def _gate_is_open(s: Cells, timer: int) -> bool:
    """Return the level of a trigger that is a gate: an input's, or of another timer CEN or a channel's."""
    source = _source(s, timer)
    if source in (_TI1, _TI2):
        number = source - _TI1
        pin = s[c.CHANNEL_PIN + 4 * timer + number]
        inverted = s[c.VALUE + int(BASES[timer]) + CCER] >> 4 * number + 1 & 1
        return s[c.LEVELS + pin // 16] >> pin % 16 & 1 != inverted
    master = int(_MASTERS[timer, source]) if source < 4 else -1
    if master < 0:
        return False
    base = c.VALUE + int(BASES[master])
    by = s[base + CR2] >> 4 & 7
    if by == 1:
        return s[base + CR1] & CEN != 0
    return by >= 4 and s[c.OUTPUT + 4 * master + by - 4] != 0


@integer
def serve_inputs(s: Cells) -> None:
    """Let timers take the edges at their inputs and the triggers of other timers that have happened at `AT`."""
    for _ in range(c.TIMERS):  # each timer may trigger the next one
        pulses = s[c.TIMER_PULSES]
        s[c.TIMER_PULSES] = 0
        if pulses & _EDGES:
            for timer in range(c.TIMERS):
                for number in range(4):
                    pin = s[c.CHANNEL_PIN + 4 * timer + number]
                    port, bit = pin // 16, 1 << pin % 16
                    rises, falls = s[c.INPUT_RISES + port] & bit, s[c.INPUT_FALLS + port] & bit
                    if rises | falls and _listens(s, timer, number):
                        _edge(s, timer, number, 1 if rises else 0)
            for port in range(c.PORTS):
                s[c.INPUT_RISES + port] = s[c.INPUT_FALLS + port] = 0
        for timer in range(c.TIMERS):
            source = _source(s, timer)
            master = int(_MASTERS[timer, source]) if source < 4 else -1
            if master >= 0 and pulses >> master & 1:
                _trigger(s, timer, 1)
            elif master >= 0 and pulses >> 16 + master & 1:
                _trigger(s, timer, 0)
    s[c.TIMER_PULSES] = 0


@integer
def _edge(s: Cells, timer: int, number: int, rises: int) -> None:
    """Take an edge of an input: it may be captured, count, or trigger."""
    count_to(s, timer, s[c.AT])
    enabled = s[c.VALUE + int(BASES[timer]) + CCER]
    falling = enabled >> 4 * number + 1 & 1
    for channel in range(4):
        chosen = selection(s, timer, channel)
        takes = (chosen == 1 and channel == number) or (chosen == 2 and channel ^ 1 == number)
        if takes and enabled >> 4 * channel & 1 and rises != enabled >> 4 * channel + 1 & 1:
            _capture(s, timer, channel)
    mode, source = _mode(s, timer), _source(s, timer)
    if 1 <= mode <= 3:
        if number < 2:
            _turn(s, timer, number, rises)
    elif mode >= _RESET and number == 0 and source == _TI1_EDGES:
        _trigger(s, timer, 1)
    elif mode >= _RESET and ((number == 0 and source == _TI1) or (number == 1 and source == _TI2)):
        _trigger(s, timer, rises ^ falling)


@integer
def _capture(s: Cells, timer: int, channel: int) -> None:
    """Store the counter, at each edge or each second, fourth or eighth one; flag what overwrites an unread one."""
    base = c.VALUE + int(BASES[timer])
    prescaler = s[base + CCMR1 + channel // 2] >> 8 * (channel % 2) + 2 & 3
    s[c.CAPTURE_EDGES + 4 * timer + channel] += 1
    if s[c.CAPTURE_EDGES + 4 * timer + channel] < 1 << prescaler:
        return
    s[c.CAPTURE_EDGES + 4 * timer + channel] = 0
    if s[base + SR] >> 1 + channel & 1:
        s[base + SR] |= CC1OF << channel
    s[base + CCR1 + channel] = counter_value(s, timer)
    compare(s, timer, channel)
    set_timer_lines(s, timer)


@integer
def _trigger(s: Cells, timer: int, active: int) -> None:
    """Let a timer follow its trigger: an edge to the active level, or for a gate also the other one (15.3.14)."""
    base, mode = c.VALUE + int(BASES[timer]), _mode(s, timer)
    if mode < _RESET or not (active or mode == _GATED):
        return
    s[base + SR] |= TIF
    count_to(s, timer, s[c.AT])
    if mode == _CLOCK:
        if s[base + CR1] & CEN:
            _count_edge(s, timer, 1)
    elif mode == _RESET:
        generate_update(s, timer)
    elif mode == _GATED:
        _hold(s, timer, 0 if active else 2)
    else:
        s[base + CR1] |= CEN
    set_timer_lines(s, timer)
    schedule_timer(s, timer)


@integer
def _count_edge(s: Cells, timer: int, step: int) -> None:
    """Count an edge up or down, after the prescaler."""
    s[c.TIMER_EDGES + timer] += 1
    if s[c.TIMER_EDGES + timer] <= s[c.PRESCALER + timer]:
        return
    s[c.TIMER_EDGES + timer] = 0
    period = s[c.RELOAD + timer] + 1
    s[c.COUNTER + timer] = (s[c.COUNTER + timer] + step) % period
    note_count(s, timer, s[c.COUNTER + timer] == (0 if step > 0 else period - 1))


@integer
def _turn(s: Cells, timer: int, number: int, rises: int) -> None:
    """Count an encoder's edge: at TI1 up if TI2 has the other level, at TI2 up if TI1 has the same (table 84)."""
    base, mode = c.VALUE + int(BASES[timer]), _mode(s, timer)
    if not s[base + CR1] & CEN or (mode == 1 and number == 0) or (mode == 2 and number == 1):
        return
    enabled = s[base + CCER]
    pin = s[c.CHANNEL_PIN + 4 * timer + 1 - number]
    other = s[c.LEVELS + pin // 16] >> pin % 16 & 1 ^ enabled >> 4 * (1 - number) + 1 & 1
    level = rises ^ enabled >> 4 * number + 1 & 1
    up = (level != other) if number == 0 else (level == other)
    s[base + CR1] = s[base + CR1] & ~DIRECTION
    s[c.TIMER_FALLS + timer] = 0 if up else 1
    _count_edge(s, timer, 1 if up else -1)
