"""The devices' events in order of time."""

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.can import can_event
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.system import systick_event
from steptwin.features.stm32.chip.timers import timer_event
from steptwin.features.stm32.chip.usarts import usart_received, usart_sent


@integer
def next_due(s: Cells) -> None:
    """Find the next event."""
    due = c.NEVER
    for device in range(c.DEVICES):
        due = min(due, s[c.DUES + device])
    s[c.DUE] = due


@integer
def act(s: Cells) -> None:
    """Let each device act whose event is the next one."""
    at = s[c.DUE]
    s[c.AT] = at
    if s[c.DUES + c.SYSTICK_DUE] == at:
        systick_event(s)
    for timer in range(c.TIMERS):
        if s[c.DUES + c.TIMER_DUE + timer] == at:
            timer_event(s, timer)
    for usart in range(c.USARTS):
        if s[c.DUES + c.SENT_DUE + usart] == at:
            usart_sent(s, usart)
        if s[c.DUES + c.RECEIVED_DUE + usart] == at:
            usart_received(s, usart)
    if s[c.DUES + c.CAN_DUE] == at:
        can_event(s)
    if s[c.DUES + c.WATCHDOG_DUE] == at:
        s[c.DUES + c.WATCHDOG_DUE] = c.NEVER
        s[c.FAULT] = c.FAULT_WATCHDOG
    next_due(s)
