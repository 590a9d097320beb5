"""RCC: the clocks as the firmware sets them, and what depends on them (RM0008, section 7)."""

from typing import Final

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.can import tell_can
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.rtc import start_rtc
from steptwin.features.stm32.chip.timers import count_to, schedule_timer, set_tick

RCC: Final = (0x40021000 - c.PERIPHERALS) // 4
CR, CFGR = RCC, RCC + 1
BDCR, CSR = RCC + 8, RCC + 9
HSI_HZ: Final = 8_000_000
CORE_HZ: Final = 72_000_000
"""The counts of the twin's time."""


@integer
def core_hz(s: Cells) -> int:
    """Return the frequency of the processor."""
    config = s[c.VALUE + CFGR]
    source, hz = config & 3, HSI_HZ
    if source == 1:
        hz = s[c.CRYSTAL_HZ]
    elif source == 2:
        into = HSI_HZ // 2 if not config >> 16 & 1 else s[c.CRYSTAL_HZ] // (2 if config >> 17 & 1 else 1)
        hz = into * min((config >> 18 & 15) + 2, 16)
    divider = config >> 4 & 15
    if divider >= 8:
        hz >>= divider - 7 if divider < 12 else divider - 6
    return hz


@integer
def cycles_now(s: Cells) -> int:
    """Return the cycles that DWT has counted at the instant `AT`."""
    if not s[c.CYCLES_ON]:
        return s[c.CYCLES_BASE]
    return s[c.CYCLES_BASE] + (s[c.AT] - s[c.CYCLES_BASE_AT]) // s[c.CYCLE]


@integer
def set_cycles(s: Cells, cycles: int) -> None:
    """Let DWT count on from a number of cycles."""
    s[c.CYCLES_BASE], s[c.CYCLES_BASE_AT] = cycles, s[c.AT]


@integer
def set_clocks(s: Cells) -> None:
    """Take over the clocks: what counts has its present value, and counts on by the new clock."""
    set_cycles(s, cycles_now(s))
    left = s[c.DUES + c.SYSTICK_DUE] - s[c.AT]
    before = s[c.CYCLE]
    for timer in range(c.TIMERS):
        count_to(s, timer, s[c.AT])
    s[c.CYCLE] = (CORE_HZ * c.GRAINS + core_hz(s) // 2) // core_hz(s)
    for timer in range(c.TIMERS):
        set_tick(s, timer)
        schedule_timer(s, timer)
    if s[c.DUES + c.SYSTICK_DUE] != c.NEVER:
        s[c.DUES + c.SYSTICK_DUE] = s[c.AT] + left // before * s[c.CYCLE]


@integer
def write_rcc(s: Cells, register: int) -> None:
    """Write a register, whose value is stored already: oscillators are ready at once, as the switched clock is."""
    if register == CR:
        on = s[c.VALUE + CR] & 0x01010001
        s[c.VALUE + CR] = s[c.VALUE + CR] & ~0x02020002 | on << 1
    elif register == CFGR:
        s[c.VALUE + CFGR] = s[c.VALUE + CFGR] & ~0xC | (s[c.VALUE + CFGR] & 3) << 2
        set_clocks(s)
        tell_can(s)
    elif register in (BDCR, CSR):
        s[c.VALUE + register] = s[c.VALUE + register] & ~2 | (s[c.VALUE + register] & 1) << 1
        if register == BDCR:
            start_rtc(s)
