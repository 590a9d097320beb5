"""Peripherals: what a register reads, when a pin changes and when an interrupt is due, at 72 MHz."""

import pytest

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.registers import name_of
from tests.features.stm32.conftest import (
    FLASH_ACR,
    GPIOA,
    LOW_HANDLER,
    RCC_APB1ENR,
    RCC_CFGR,
    RCC_CR,
    TIM2,
    USART1,
    Bench,
)

_SYSTICK, _CYCLES, _AFIO, _EXTI = 0xE000E010, 0xE0001000, 0x40010000, 0x40010400
_CR1, _DIER, _SR, _EGR, _CCMR1, _CCER, _CNT, _PSC, _ARR, _CCR1 = (
    TIM2 + offset for offset in (0x00, 0x0C, 0x10, 0x14, 0x18, 0x20, 0x24, 0x28, 0x2C, 0x34)
)
_INTERRUPTS = 0xE000E200
"""Pending interrupts, by their numbers."""


# --- clocks


@pytest.mark.parametrize(
    ("config", "mhz"),
    [
        (0, 8),
        (1, 8),
        (2 | 7 << 18, 36),  # HSI / 2 * 9
        (2 | 14 << 18, 64),  # HSI / 2 * 16
        (2 | 1 << 16 | 7 << 18, 72),
        (2 | 3 << 16 | 7 << 18, 36),
        (2 | 1 << 16 | 7 << 18 | 8 << 4, 36),
        (2 | 1 << 16 | 7 << 18 | 12 << 4, 72 / 64),
    ],
)
def test_the_core_runs_as_rcc_is_set(bench: Bench, config: int, mhz: float) -> None:
    bench.write(RCC_CFGR, config)
    assert bench.chip.cells[c.CYCLE] / c.GRAINS == pytest.approx(72 / mhz, rel=1e-12)


def test_an_oscillator_is_ready_once_it_is_on_and_the_switched_clock_is_told(bench: Bench) -> None:
    bench.write(RCC_CR, 1)
    assert bench.read(RCC_CR) & 0x02020002 == 2
    bench.write(RCC_CR, 0x01010001)
    assert bench.read(RCC_CR) & 0x02020002 == 0x02020002
    assert bench.read(RCC_CFGR) & 0xC == 8


def test_dwt_counts_cycles_of_the_core(bench: Bench) -> None:
    bench.write(_CYCLES, 1)
    bench.write(_CYCLES + 4, 10)
    bench.run(1000)
    assert bench.read(_CYCLES + 4) == 1010
    bench.write(RCC_CFGR, 2 | 1 << 16 | 7 << 18 | 8 << 4)
    bench.run(1000)
    assert bench.read(_CYCLES + 4) == 1510


# --- SysTick


def test_systick_reaches_0_each_reload_plus_1_cycles(bench: Bench) -> None:
    bench.write(_SYSTICK + 4, 999)
    bench.write(_SYSTICK + 8, 0)
    bench.write(_SYSTICK, 5)
    bench.run(300)
    assert bench.read(_SYSTICK + 8) == 700
    bench.run(699)
    assert bench.read(_SYSTICK) == 5
    bench.run(1)
    assert bench.read(_SYSTICK) == 0x10005
    assert bench.read(_SYSTICK) == 5
    bench.run(1000)
    assert bench.read(_SYSTICK) == 0x10005


@pytest.mark.parametrize(("control", "taken"), [(7, 3), (5, 0)])
def test_systick_pends_its_exception_only_if_it_is_told_to(control: int, taken: int) -> None:
    bench = Bench(handlers={15: LOW_HANDLER})
    bench.write(_SYSTICK + 4, 99)
    bench.write(_SYSTICK, control)
    bench.run(350)
    assert bench.chip.interrupts.get(15, (0, 0.0))[0] == taken


# --- timers


def _timer(bench: Bench, prescaler: int, reload: int, *, control: int = 0) -> None:
    bench.write(_PSC, prescaler)
    bench.write(_ARR, reload)
    bench.write(_CR1, control)
    bench.write(_EGR, 1)
    bench.write(_SR, 0)
    bench.write(_CR1, control | 1)


def test_a_timer_of_a_halved_bus_counts_at_72_mhz_and_updates_at_its_end(bench: Bench) -> None:
    _timer(bench, 0, 999)
    bench.run(999)
    assert (bench.read(_CNT), bench.read(_SR) & 1) == (999, 0)
    bench.run(1)
    assert (bench.read(_CNT), bench.read(_SR) & 1) == (0, 1)


def test_a_prescaler_waits_for_an_update(bench: Bench) -> None:
    _timer(bench, 0, 99)
    bench.write(_PSC, 71)
    bench.run(100)
    assert bench.read(_CNT) == 0
    bench.run(71)
    assert bench.read(_CNT) == 0
    bench.run(1)
    assert bench.read(_CNT) == 1


@pytest.mark.parametrize(("preload", "second"), [(0, 50), (0x80, 150)])
def test_the_reload_counts_at_once_or_from_the_update_on_with_preload(bench: Bench, preload: int, second: int) -> None:
    _timer(bench, 0, 99, control=preload)
    bench.write(_ARR, 49)
    bench.run(second - 1)
    before = bench.read(_CNT)
    bench.run(1)
    assert (before, bench.read(_CNT)) == (49, 0)


def test_compare_toggles_its_pin_each_time_the_counter_reaches_it(bench: Bench) -> None:
    bench.write(GPIOA, 0x4444444B)  # PA0 is channel 1
    bench.write(_CCMR1, 0x30)
    bench.write(_CCR1, 40)
    bench.write(_CCER, 1)
    begin = bench.chip.now_counts
    _timer(bench, 0, 99)
    bench.run(250)
    assert [(at - begin, pin) for at, pin in bench.edges()] == [(40, "A0+"), (140, "A0-"), (240, "A0+")]


def test_pwm_is_high_below_its_compare_value_and_takes_a_preloaded_one_with_the_update(bench: Bench) -> None:
    bench.write(GPIOA, 0x4444444B)
    bench.write(_CCMR1, 0x68)
    bench.write(_CCR1, 30)
    bench.write(_CCER, 1)
    begin = bench.chip.now_counts
    _timer(bench, 0, 99)
    bench.write(_CCR1, 60)
    bench.run(199)
    edges = [(at - begin, pin) for at, pin in bench.edges()]
    assert edges == [(0, "A0+"), (30, "A0-"), (100, "A0+"), (160, "A0-")]


def test_one_pulse_stops_at_the_update(bench: Bench) -> None:
    _timer(bench, 0, 99, control=8)
    bench.run(500)
    assert (bench.read(_CNT), bench.read(_CR1) & 1, bench.read(_SR) & 1) == (0, 0, 1)


def test_flags_are_cleared_by_0_and_not_set_by_1(bench: Bench) -> None:
    _timer(bench, 0, 99)
    bench.write(_CCR1, 50)
    bench.run(120)
    assert bench.read(_SR) & 3 == 3
    bench.write(_SR, 0xFFFD)
    assert bench.read(_SR) & 3 == 1


def test_a_timer_asks_for_its_interrupt_as_long_as_its_flag_stands(bench: Bench) -> None:
    _timer(bench, 0, 99)
    bench.write(_DIER, 1)
    bench.run(100)
    assert bench.read(_INTERRUPTS) >> 28 & 1 == 1


# --- pins


@pytest.mark.parametrize(
    ("mode", "latch", "outside", "level"),
    [
        (0x3, 1, 0, 1),
        (0x3, 0, 1, 0),
        (0x7, 0, 1, 0),  # open drain pulls down
        (0x7, 1, 1, 1),
        (0x7, 1, 0, 0),
        (0x4, 1, 0, 0),  # an input
        (0x8, 0, 1, 1),
    ],
)
def test_a_pin_has_the_level_of_its_mode(bench: Bench, mode: int, latch: int, outside: int, level: int) -> None:
    bench.chip.drive(0, level=bool(outside))
    bench.write(GPIOA + 0x0C, latch)
    bench.write(GPIOA, 0x44444440 | mode)
    assert bench.read(GPIOA + 8) & 1 == level


@pytest.mark.parametrize("pull", [0, 1])
def test_an_input_that_nothing_drives_has_the_level_of_its_pull(bench: Bench, pull: int) -> None:
    bench.write(GPIOA + 0x0C, pull)
    bench.write(GPIOA, 0x44444448)
    assert bench.read(GPIOA + 8) & 1 == pull


def test_bits_are_set_and_reset_in_one_write_and_setting_wins(bench: Bench) -> None:
    bench.write(GPIOA, 0x33333333)
    bench.write(GPIOA + 0x0C, 0b0110)
    bench.write(GPIOA + 0x10, 0b0110 << 16 | 0b0011)
    assert bench.read(GPIOA + 0x0C) == 0b0011
    bench.write(GPIOA + 0x14, 1)
    assert bench.read(GPIOA + 0x0C) == 0b0010


def test_a_bit_is_written_by_its_alias_alone(bench: Bench) -> None:
    bits = 0x42000000 + 32 * (GPIOA + 0x0C - 0x40000000)
    bench.write(GPIOA, 0x33333333)
    bench.write(GPIOA + 0x0C, 0b0100)
    bench.write(bits + 4 * 1, 1)
    assert bench.read(GPIOA + 0x0C) == 0b0110
    assert [bench.read(bits + 4 * bit) for bit in range(4)] == [0, 1, 1, 0]


def test_a_bit_of_the_ram_is_written_by_its_alias_alone(bench: Bench) -> None:
    bits = 0x22000000 + 32 * 0x101
    bench.write(bits + 4 * 3, 1)
    bench.write(bits + 4 * 5, 0xFF)
    bench.write(bits + 4 * 3, 0)
    assert bench.chip.word(0x20000100) == 0b100000 << 8
    assert [bench.read(bits + 4 * bit) for bit in (3, 5)] == [0, 1]


@pytest.mark.parametrize(("port", "rising", "falling", "seen"), [(0, 1, 0, 1), (0, 0, 1, 0), (1, 1, 0, 0)])
def test_exti_sees_the_edges_of_its_port_that_it_is_told_to(
    bench: Bench, port: int, rising: int, falling: int, seen: int
) -> None:
    bench.chip.drive(0, level=False)
    bench.write(_AFIO + 8, port)
    bench.write(_EXTI, 1)
    bench.write(_EXTI + 8, rising)
    bench.write(_EXTI + 12, falling)
    bench.chip.drive(0, level=True)
    assert bench.read(_EXTI + 0x14) == seen
    assert bench.read(_INTERRUPTS) >> 6 & 1 == seen
    bench.write(_EXTI + 0x14, 1)
    assert bench.read(_EXTI + 0x14) == 0


# --- USART


def _usart(bench: Bench) -> None:
    bench.write(USART1 + 8, 625)  # 115 200 baud
    bench.write(USART1 + 0xC, 0x200C)


def test_a_byte_is_sent_in_10_bits_and_the_next_one_waits(bench: Bench) -> None:
    _usart(bench)
    bench.write(USART1 + 4, ord("a"))
    assert bench.read(USART1) & 0xC0 == 0x80
    bench.write(USART1 + 4, ord("b"))
    assert bench.read(USART1) & 0xC0 == 0
    bench.run(6249)
    assert bench.chip.sent(0) == b""
    bench.run(1)
    assert (bench.chip.sent(0), bench.read(USART1) & 0xC0) == (b"a", 0x80)
    bench.run(6250)
    assert (bench.chip.sent(0), bench.read(USART1) & 0xC0) == (b"ab", 0xC0)


def test_bytes_arrive_one_after_the_other_and_are_lost_where_nobody_reads(bench: Bench) -> None:
    _usart(bench)
    bench.chip.give(0, b"xyz")
    bench.run(6250)
    assert (bench.read(USART1) & 0x28, bench.read(USART1 + 4), bench.read(USART1) & 0x28) == (0x20, ord("x"), 0)
    bench.run(12500)
    assert (bench.read(USART1) & 0x28, bench.read(USART1 + 4)) == (0x28, ord("y"))


# --- watchdog, and what is not modelled


def test_the_watchdog_bites_when_it_is_not_refreshed(bench: Bench) -> None:
    bench.write(0x40003008, 9)  # 10 * 4 / 40 kHz = 1 ms
    bench.write(0x40003000, 0xCCCC)
    bench.run(71_000)
    bench.write(0x40003000, 0xAAAA)
    bench.run(71_999)
    assert bench.chip.cells[c.FAULT] == 0
    bench.run(2)
    assert bench.chip.cells[c.FAULT] == c.FAULT_WATCHDOG


def _strange(bench: Bench) -> list[tuple[str, int, int]]:
    cells = bench.chip.cells
    places = [c.STRANGE + c.STRANGE_FIELDS * i for i in range(cells[c.STRANGE_COUNT])]
    return [(name_of(cells[at]), cells[at + 1], cells[at + 2]) for at in places]


def test_what_is_not_modelled_is_counted_by_place_and_kind(bench: Bench) -> None:
    assert (bench.read(0x40012800), bench.read(0x40012800)) == (0, 0)
    bench.write(0x40005C40, 1)
    bench.write(TIM2 + 0x48, 1)
    bench.write(TIM2 + 0x48, 0)
    bench.write(TIM2 + 0x50, 0)
    assert _strange(bench) == [
        ("ADC2 offset 0x0", c.STRANGE_READ, 2),
        ("USB offset 0x40", c.STRANGE_WRITE, 1),
        ("TIM2 DCR", c.STRANGE_BITS, 1),
        ("TIM2 offset 0x50", c.STRANGE_WRITE, 1),
    ]


def test_a_peripheral_without_its_clock_reads_0_and_takes_nothing(bench: Bench) -> None:
    bench.write(RCC_APB1ENR, 0)
    bench.write(_ARR, 5)
    assert bench.read(_ARR) == 0
    bench.write(RCC_APB1ENR, 1)
    assert bench.read(_ARR) == 0xFFFF
    assert _strange(bench) == [("TIM2 ARR", c.STRANGE_NO_CLOCK, 2)]


def test_the_flash_takes_its_wait_states(bench: Bench) -> None:
    bench.write(FLASH_ACR, 0x12)
    assert bench.chip.cells[c.WAIT_STATES] == 2


def test_tx_is_high_between_bytes_while_its_usart_is_on(bench: Bench) -> None:
    bench.write(GPIOA + 4, 0x444444B4)
    assert bench.read(GPIOA + 8) >> 9 & 1 == 0
    _usart(bench)
    assert bench.read(GPIOA + 8) >> 9 & 1 == 1
