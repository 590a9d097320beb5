"""RTC, the backup domain's lock, and WWDG, by RM0008, sections 18, 5.4 and 20."""

import pytest

from steptwin.features.stm32.chip import cells as c
from tests.features.stm32.conftest import Bench

_RTC, _BDCR, _PWR_CR, _BKP, _PENDING = 0x40002800, 0x40021020, 0x40007000, 0x40006C00, 0xE000E200
_CRH, _CRL, _PRLL, _DIVL, _CNTH, _CNTL, _ALRH, _ALRL = (_RTC + at for at in (0, 4, 0xC, 0x14, 0x18, 0x1C, 0x20, 0x24))
_WWDG = 0x40002C00
_TICK = 4096 * 2
"""A tick of WWDG at PCLK1 = 36 MHz."""


def _open(bench: Bench) -> None:
    bench.write(_PWR_CR, 0x100)
    bench.write(_BDCR, 1 << 15 | 1 << 8 | 1)


def _configure(bench: Bench, *values: tuple[int, int]) -> None:
    bench.write(_CRL, 16)
    for address, value in values:
        bench.write(address, value)
    bench.write(_CRL, 0)


def test_the_backup_domain_is_locked_until_dbp_is_set(bench: Bench) -> None:
    bench.write(_BKP + 4, 5)
    bench.write(_CRH, 1)
    assert (bench.read(_BKP + 4), bench.read(_CRH)) == (0, 0)
    bench.write(_PWR_CR, 0x100)
    bench.write(_BKP + 4, 5)
    bench.write(_CRH, 1)
    assert (bench.read(_BKP + 4), bench.read(_CRH)) == (5, 1)


def test_it_counts_by_lse_over_prescaler_plus_1_and_flags_each_second(bench: Bench) -> None:
    _open(bench)
    _configure(bench, (_PRLL, 31))  # 1024 Hz: 70 312.5 counts
    bench.write(_CRH, 1)
    bench.run(70_312)
    assert (bench.read(_CNTL), bench.read(_CRL) & 1, bench.read(_DIVL)) == (0, 0, 0)
    bench.run(1)
    assert (bench.read(_CNTL), bench.read(_CRL) & 1, bench.read(_PENDING) >> 3 & 1) == (1, 1, 1)
    bench.write(_CRL, 0)
    assert bench.read(_CRL) == 0x28  # RTOFF and RSF


def test_counters_are_written_in_configuration_mode_alone(bench: Bench) -> None:
    _open(bench)
    bench.write(_CNTL, 7)
    assert bench.read(_CNTL) == 0
    _configure(bench, (_CNTL, 7))
    assert bench.read(_CNTL) == 7


def test_the_alarm_is_an_interrupt_by_line_17_of_exti(bench: Bench) -> None:
    _open(bench)
    _configure(bench, (_PRLL, 31), (_ALRH, 0), (_ALRL, 2))
    bench.write(0x40010400, 1 << 17)
    bench.write(0x40010408, 1 << 17)
    bench.run(70_313)
    assert (bench.read(_CRL) & 2, bench.read(_PENDING + 4)) == (0, 0)
    bench.run(70_313)
    assert (bench.read(_CRL) & 2, bench.read(_PENDING + 4)) == (2, 1 << 9)


def test_it_flags_the_overflow(bench: Bench) -> None:
    _open(bench)
    _configure(bench, (_PRLL, 31), (_CNTH, 0xFFFF), (_CNTL, 0xFFFF))
    bench.run(70_313)
    assert (bench.read(_CNTL), bench.read(_CRL) & 7) == (0, 5)


def test_wwdg_warns_at_40h_and_bites_below(bench: Bench) -> None:
    bench.write(_WWDG + 4, 0x200 | 0x7F)
    bench.write(_WWDG, 0x80 | 0x43)
    bench.run(3 * _TICK - 1)
    assert (bench.read(_WWDG), bench.read(_WWDG + 8)) == (0xC1, 0)
    bench.run(1)
    assert (bench.read(_WWDG), bench.read(_WWDG + 8), bench.read(_PENDING) & 1) == (0xC0, 1, 1)
    bench.run(_TICK - 1)
    assert bench.chip.cells[c.FAULT] == 0
    bench.run(1)
    assert (bench.chip.cells[c.FAULT], bench.chip.cells[c.FAULT_AT]) == (c.FAULT_WATCHDOG, 1)


@pytest.mark.parametrize(("ticks", "bites"), [(14, True), (15, False)])
def test_wwdg_must_not_be_refreshed_above_its_window(bench: Bench, ticks: int, bites: bool) -> None:
    bench.write(_WWDG + 4, 0x70)
    bench.write(_WWDG, 0xFF)
    bench.run(ticks * _TICK)
    bench.write(_WWDG, 0xFF)
    assert bool(bench.chip.cells[c.FAULT]) == bites
