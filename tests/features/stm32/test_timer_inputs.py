"""Timers counting down and centred, captures, slave modes and encoders, by RM0008, section 15."""

import pytest

from tests.features.stm32.conftest import GPIOA, TIM2, Bench

_TIM3 = 0x40000400
_CR1, _CR2, _SMCR, _DIER, _SR, _EGR, _CCMR1, _CCER, _CNT, _PSC, _ARR, _CCR1 = (
    0x00, 0x04, 0x08, 0x0C, 0x10, 0x14, 0x18, 0x20, 0x24, 0x28, 0x2C, 0x34
)  # fmt: skip


def _write(bench: Bench, timer: int, **registers: int) -> None:
    for name, value in registers.items():
        bench.write(timer + globals()[f"_{name}"], value)


def _pin(bench: Bench, pin: int, *levels: int, after: int = 0) -> None:
    for level in levels:
        bench.chip.drive(pin, level=bool(level))
        if after:
            bench.run(after)


# --- down and centred


def test_a_timer_that_counts_down_updates_at_its_underflow(bench: Bench) -> None:
    _write(bench, TIM2, ARR=99, CR1=0x10, EGR=1, SR=0)
    bench.write(TIM2, 0x11)
    seen = []
    for counts in (1, 98, 1):
        bench.run(counts)
        seen.append((bench.read(TIM2 + _CNT), bench.read(TIM2 + _SR) & 1))
    assert seen == [(98, 0), (0, 0), (99, 1)]


def test_a_centred_timer_turns_at_reload_and_0_and_updates_at_both(bench: Bench) -> None:
    _write(bench, TIM2, ARR=100, CR1=0x60, EGR=1, SR=0)
    bench.write(TIM2, 0x61)
    seen = []
    for counts in (99, 1, 1, 98, 1):
        bench.run(counts)
        seen.append((bench.read(TIM2 + _CNT), bench.read(TIM2 + _SR) & 1, bench.read(TIM2) >> 4 & 1))
        bench.write(TIM2 + _SR, 0)
    assert seen == [(99, 0, 0), (100, 1, 1), (99, 0, 1), (1, 0, 1), (0, 1, 0)]


@pytest.mark.parametrize(("mode", "flags"), [(0x20, [0, 1]), (0x40, [1, 0]), (0x60, [1, 1])])
def test_a_centred_timer_flags_its_compares_down_up_or_both(bench: Bench, mode: int, flags: list[int]) -> None:
    _write(bench, TIM2, ARR=100, CR1=mode, CCR1=30, EGR=1, SR=0)
    bench.write(TIM2, mode | 1)
    seen = []
    for _ in range(2):
        bench.run(100)
        seen.append(bench.read(TIM2 + _SR) >> 1 & 1)
        bench.write(TIM2 + _SR, 0)
    assert seen == flags


def test_centred_pwm_is_symmetric(bench: Bench) -> None:
    bench.write(GPIOA, 0x4444444B)
    begin = bench.chip.now_counts
    _write(bench, TIM2, CCMR1=0x60, CCER=1, ARR=100, CCR1=30, CR1=0x60, EGR=1, SR=0)
    bench.write(TIM2, 0x61)
    bench.run(400)
    edges = [(at - begin, pin) for at, pin in bench.edges()]
    assert edges == [(0, "A0+"), (30, "A0-"), (170, "A0+"), (230, "A0-"), (370, "A0+")]


# --- captures


def test_an_edge_is_captured_with_its_count_and_a_second_one_overcaptures(bench: Bench) -> None:
    _write(bench, TIM2, ARR=0xFFFF, CCMR1=1, CCER=1, DIER=2, CR1=1)
    _pin(bench, 0, 0)
    bench.run(500)
    begin = bench.read(TIM2 + _CNT)
    _pin(bench, 0, 1)
    assert bench.read(0xE000E200) >> 28 & 1
    bench.run(100)
    _pin(bench, 0, 0, 1)
    assert bench.read(TIM2 + _SR) & 0x202 == 0x202
    assert bench.read(TIM2 + _CCR1) == begin + 100
    assert bench.read(TIM2 + _SR) & 0x202 == 0x200  # reading has cleared CC1IF


def test_two_channels_measure_both_edges_of_one_input(bench: Bench) -> None:
    # channel 1 the rises of TI1, channel 2 its falls; TI1's rise resets the counter (PWM input, 15.3.6)
    _write(bench, TIM2, ARR=0xFFFF, CCMR1=0x0201, CCER=0x31, SMCR=0x54, CR1=1)
    for _ in range(3):
        _pin(bench, 0, 1, after=300)
        _pin(bench, 0, 0, after=700)
    assert (bench.read(TIM2 + _CCR1), bench.read(TIM2 + _CCR1 + 4)) == (1000, 300)


def test_a_prescaled_capture_takes_each_fourth_edge(bench: Bench) -> None:
    _write(bench, TIM2, ARR=0xFFFF, CCMR1=0x09, CCER=1, CR1=1)
    seen = []
    for _ in range(8):
        _pin(bench, 0, 0, 1)
        seen.append(bench.read(TIM2 + _SR) >> 1 & 1)
        bench.write(TIM2 + _SR, 0)
    assert seen == [0, 0, 0, 1, 0, 0, 0, 1]


# --- slaves


def test_an_external_clock_counts_its_edges_after_the_prescaler(bench: Bench) -> None:
    _write(bench, TIM2, ARR=4, PSC=1, EGR=1, SR=0, CCMR1=1, SMCR=0x57, CR1=1)
    counts = []
    for _ in range(10):
        _pin(bench, 0, 0, 1, after=50)
        counts.append(bench.read(TIM2 + _CNT))
    assert counts == [0, 1, 1, 2, 2, 3, 3, 4, 4, 0]
    assert bench.read(TIM2 + _SR) & 0x41 == 0x41


def test_a_trigger_starts_and_a_gate_holds_the_counter(bench: Bench) -> None:
    _pin(bench, 0, 0)
    _write(bench, TIM2, ARR=0xFFFF, CCMR1=1, SMCR=0x56)
    bench.run(100)
    _pin(bench, 0, 1, after=100)
    assert (bench.read(TIM2 + _CNT), bench.read(TIM2) & 1) == (100, 1)
    _write(bench, TIM2, SMCR=0x55)
    _pin(bench, 0, 0, after=100)
    assert bench.read(TIM2 + _CNT) == 100
    _pin(bench, 0, 1, after=50)
    assert bench.read(TIM2 + _CNT) == 150


def test_updates_of_one_timer_clock_another(bench: Bench) -> None:
    _write(bench, _TIM3, ARR=0xFFFF, SMCR=0x17, CR1=1)  # ITR1 is TIM2
    _write(bench, TIM2, ARR=99, CR2=0x20, EGR=1, CR1=1)
    before = bench.read(_TIM3 + _CNT)
    bench.run(1050)
    assert bench.read(_TIM3 + _CNT) - before == 10


def test_a_gate_by_the_others_compare_lets_so_many_counts_pass(bench: Bench) -> None:
    _write(bench, TIM2, ARR=999, CCMR1=0x60, CCR1=300, CR2=0x40, EGR=1)
    _write(bench, _TIM3, ARR=0xFFFF, SMCR=0x15, CR1=1)
    bench.run(10)
    _write(bench, _TIM3, CNT=0)
    _write(bench, TIM2, EGR=1, CR1=1)
    bench.run(3000)
    assert bench.read(_TIM3 + _CNT) == 3 * 300


@pytest.mark.parametrize(("mode", "per_turn"), [(1, 2), (2, 2), (3, 4)])
def test_an_encoder_counts_both_ways_and_tells_its_direction(bench: Bench, mode: int, per_turn: int) -> None:
    _pin(bench, 0, 0)
    _pin(bench, 1, 0)
    _write(bench, TIM2, ARR=999, CCMR1=0x0101, SMCR=mode, CR1=1)
    forward = [(0, 1), (1, 1), (0, 0), (1, 0)]
    for _ in range(3):
        for pin, level in forward:
            _pin(bench, pin, level)
    assert (bench.read(TIM2 + _CNT), bench.read(TIM2) >> 4 & 1) == (3 * per_turn, 0)
    bench.write(TIM2 + _SR, 0)
    for _ in range(4):
        for pin, level in ((1, 1), (0, 1), (1, 0), (0, 0)):
            _pin(bench, pin, level)
    assert (bench.read(TIM2 + _CNT), bench.read(TIM2) >> 4 & 1) == (1000 - per_turn, 1)
    assert bench.read(TIM2 + _SR) & 1
