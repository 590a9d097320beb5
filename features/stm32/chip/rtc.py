"""RTC: seconds, alarm and overflow of its counter (RM0008, section 18), behind the backup domain's lock (5.4.1)."""

from typing import Final

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.gpio import PR, RTSR, set_exti_lines
from steptwin.features.stm32.chip.nvic import set_line
from steptwin.features.stm32.chip.watchdogs import GRAINS_PER_SECOND, LSI_HZ

BASE: Final = c.VALUE + (0x40002800 - c.PERIPHERALS) // 4
CRH, CRL, PRLH, PRLL, DIVH, DIVL, CNTH, CNTL, ALRH, ALRL = range(10)
SECF, ALRF, OWF, RSF, CNF, RTOFF = 1, 2, 4, 8, 16, 32
_BDCR: Final = c.VALUE + (0x40021020 - c.PERIPHERALS) // 4
_PWR_CR: Final = c.VALUE + (0x40007000 - c.PERIPHERALS) // 4
DBP: Final = 0x100
LSE_HZ: Final = 32_768
_IRQ: Final = 3
_ALARM_LINE: Final = 17


@integer
def backup_is_open(s: Cells) -> bool:
    """Return whether the registers of BKP and RTC can be written."""
    return s[_PWR_CR] & DBP != 0


@integer
def _clock_hz(s: Cells) -> int:
    """Return the frequency of RTC's clock, as RCC's BDCR chooses it; 0 for none."""
    source = s[_BDCR] >> 8 & 3 if s[_BDCR] >> 15 & 1 else 0
    if source == 1:
        return LSE_HZ
    if source == 2:
        return LSI_HZ
    return s[c.CRYSTAL_HZ] // 128 if source == 3 else 0


@integer
def _second_grains(s: Cells) -> int:
    """Return the time from one count to the next; 0 while it does not count."""
    hz = _clock_hz(s)
    prescaler = (s[BASE + PRLH] & 15) << 16 | s[BASE + PRLL]
    return GRAINS_PER_SECOND * (prescaler + 1) // hz if hz else 0


@integer
def start_rtc(s: Cells) -> None:
    """Begin a second, after a change of clock or prescaler."""
    grains = _second_grains(s)
    s[c.DUES + c.RTC_DUE] = s[c.AT] + grains if grains else c.NEVER


@integer
def rtc_event(s: Cells) -> None:
    """Count a second."""
    start_rtc(s)
    count = (s[BASE + CNTH] << 16 | s[BASE + CNTL]) + 1 & 0xFFFFFFFF
    s[BASE + CNTH], s[BASE + CNTL] = count >> 16, count & 0xFFFF
    s[BASE + CRL] |= SECF if count else SECF | OWF
    if count == s[BASE + ALRH] << 16 | s[BASE + ALRL]:
        s[BASE + CRL] |= ALRF
        if s[c.VALUE + RTSR] >> _ALARM_LINE & 1:
            s[c.VALUE + PR] |= 1 << _ALARM_LINE
            set_exti_lines(s)
    _set_line(s)


@integer
def _set_line(s: Cells) -> None:
    set_line(s, _IRQ, 1 if s[BASE + CRL] & s[BASE + CRH] & (SECF | ALRF | OWF) else 0)


@integer
def read_rtc(s: Cells, word: int) -> int:
    """Return a register; PRL and ALR can only be written."""
    if word in (PRLH, PRLL, ALRH, ALRL):
        return 0
    if word in (DIVH, DIVL):
        hz = _clock_hz(s)
        left = (s[c.DUES + c.RTC_DUE] - s[c.AT]) * hz // GRAINS_PER_SECOND if hz else s[BASE + DIVL]
        return left >> 16 & 15 if word == DIVH else left & 0xFFFF
    return s[BASE + word]


@integer
def write_rtc(s: Cells, word: int, value: int, before: int) -> None:
    """Write a register, whose value is stored already, if the lock is open; the counters need CNF (18.3.3)."""
    if not backup_is_open(s) or (word >= PRLH and not s[BASE + CRL] & CNF):
        s[BASE + word] = before
    elif word == CRL:
        flags = before & value & (SECF | ALRF | OWF)
        s[BASE + CRL] = flags | value & CNF | RTOFF | RSF  # read values are synchronous at once
    elif word in (PRLH, PRLL):
        start_rtc(s)
    _set_line(s)
