"""The devices' events in order of time, and the processor's accesses between them."""

from steptwin.features.stm32.chip import bus
from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.adc import adc_event
from steptwin.features.stm32.chip.can import can_event
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.cost import part_cycles
from steptwin.features.stm32.chip.events import next_due
from steptwin.features.stm32.chip.i2c import i2c_event
from steptwin.features.stm32.chip.libunicorn import read_register
from steptwin.features.stm32.chip.nvic import PC
from steptwin.features.stm32.chip.rtc import rtc_event
from steptwin.features.stm32.chip.spi import spi_event
from steptwin.features.stm32.chip.system import systick_event
from steptwin.features.stm32.chip.timer_inputs import serve_inputs
from steptwin.features.stm32.chip.timers import timer_event
from steptwin.features.stm32.chip.transfers import dma_event, serve_dma
from steptwin.features.stm32.chip.usarts import usart_received, usart_sent
from steptwin.features.stm32.chip.watchdogs import iwdg_event, wwdg_event


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
    if s[c.DUES + c.DMA_DUE] == at:
        dma_event(s)
    if s[c.DUES + c.ADC_DUE] == at:
        adc_event(s)
    for number in range(c.SERIALS):
        if s[c.DUES + c.SPI_DUE + number] == at:
            spi_event(s, number)
        if s[c.DUES + c.I2C_DUE + number] == at:
            i2c_event(s, number)
    if s[c.DUES + c.RTC_DUE] == at:
        rtc_event(s)
    if s[c.DUES + c.WWDG_DUE] == at:
        wwdg_event(s)
    if s[c.DUES + c.WATCHDOG_DUE] == at:
        iwdg_event(s)
    serve_events(s)


@integer
def serve_events(s: Cells) -> None:
    """Let timers and DMA1 take what has just happened at the instant `AT`."""
    if s[c.TIMER_PULSES]:
        serve_inputs(s)
    if s[c.DMA_PULSES] | s[c.DMA_LEVELS]:
        serve_dma(s)
    next_due(s)


@integer
def arrive(s: Cells) -> None:
    """Let the time be that of the instruction that accesses a register, and let devices act that were due before."""
    at = s[c.NOW]
    if s[c.BLOCK_SIZE]:
        at += part_cycles(s, s[c.BLOCK], read_register(s, PC)) * s[c.CYCLE]
    while s[c.DUE] <= at:
        act(s)
    s[c.AT] = at


@integer
def read(s: Cells, address: int, size: int) -> int:
    """Return what the processor's present instruction reads from a peripheral."""
    arrive(s)
    return bus.read(s, address, size)


@integer
def write(s: Cells, address: int, size: int, value: int) -> None:
    """Let the processor's present instruction write to a peripheral."""
    arrive(s)
    bus.write(s, address, size, value)
    if s[c.TIMER_PULSES] | s[c.DMA_PULSES] | s[c.DMA_LEVELS]:
        serve_events(s)
