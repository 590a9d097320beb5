"""IWDG and WWDG: a watchdog that is not refreshed in time ends the run (RM0008, sections 19 and 20)."""

from typing import Final

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.nvic import set_line

_IWDG: Final = c.VALUE + (0x40003000 - c.PERIPHERALS) // 4
KR, PR, RLR = range(3)
LSI_HZ: Final = 40_000
"""RM0008, 7.2.5: 30 to 60 kHz."""
GRAINS_PER_SECOND: Final = 72_000_000 * c.GRAINS
BASE: Final = c.VALUE + (0x40002C00 - c.PERIPHERALS) // 4
CR, CFR, SR = range(3)
WDGA, EWI, EWIF = 0x80, 0x200, 1
_LAST: Final = 0x40
"""The counter's last value: below it the watchdog bites (20.3)."""
_WWDG_IRQ: Final = 0


@integer
def write_iwdg(s: Cells, word: int, value: int) -> None:
    """Start or refresh IWDG by its key register."""
    if word != KR:
        return
    if value == 0xCCCC:
        s[c.WATCHDOG_ON] = 1
    if s[c.WATCHDOG_ON] and value in (0xCCCC, 0xAAAA):
        ticks = (s[_IWDG + RLR] + 1) * (4 << min(s[_IWDG + PR], 6))
        s[c.DUES + c.WATCHDOG_DUE] = s[c.AT] + ticks * (GRAINS_PER_SECOND // LSI_HZ)


@integer
def iwdg_event(s: Cells) -> None:
    """Bite."""
    s[c.DUES + c.WATCHDOG_DUE] = c.NEVER
    s[c.FAULT] = c.FAULT_WATCHDOG


@integer
def _tick_grains(s: Cells) -> int:
    """Return a tick of WWDG: 4096 cycles of PCLK1, and a power of 2."""
    divider = s[c.VALUE + (0x40021004 - c.PERIPHERALS) // 4] >> 8 & 7
    return (s[c.CYCLE] << max(divider - 3, 0)) * 4096 << (s[BASE + CFR] >> 7 & 3)


@integer
def wwdg_counter(s: Cells) -> int:
    """Return WWDG's counter at `AT`, which counts down from its last refresh."""
    return s[c.WWDG_START] - (s[c.AT] - s[c.WWDG_START_AT]) // _tick_grains(s) & 0x7F


@integer
def wwdg_event(s: Cells) -> None:
    """Warn when the counter reaches its last value; bite a tick later."""
    if wwdg_counter(s) == _LAST:
        s[BASE + SR] = EWIF
        s[c.DUES + c.WWDG_DUE] = s[c.AT] + _tick_grains(s)
        _set_line(s)
    else:
        _bite(s)


@integer
def _bite(s: Cells) -> None:
    s[c.DUES + c.WWDG_DUE] = c.NEVER
    s[c.FAULT], s[c.FAULT_AT] = c.FAULT_WATCHDOG, 1


@integer
def _set_line(s: Cells) -> None:
    set_line(s, _WWDG_IRQ, 1 if s[BASE + SR] and s[BASE + CFR] & EWI else 0)


@integer
def read_wwdg(s: Cells, word: int) -> int:
    """Return a register."""
    if word == CR:
        return s[BASE + CR] & WDGA | wwdg_counter(s)
    return s[BASE + word]


@integer
def write_wwdg(s: Cells, word: int, value: int, before: int) -> None:
    """Write a register, whose value is stored already; WDGA stays, and a refresh above the window bites."""
    if word == CR:
        s[BASE + CR] = value & 0x7F | (value | before) & WDGA
        early = before & WDGA != 0 and wwdg_counter(s) > s[BASE + CFR] & 0x7F
        s[c.WWDG_START], s[c.WWDG_START_AT] = value & 0x7F, s[c.AT]
        if s[BASE + CR] & WDGA:
            s[c.DUES + c.WWDG_DUE] = s[c.AT] + ((value & 0x7F) - _LAST) * _tick_grains(s)
            if early or not value & _LAST:
                _bite(s)
    elif word == CFR:
        s[BASE + CFR] = value & 0x3FF | before & EWI
    else:
        s[BASE + SR] = before & value
    _set_line(s)
