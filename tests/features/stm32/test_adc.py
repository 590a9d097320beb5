"""ADC1: times, sequences, triggers, the analog watchdog, DMA and the chip's own sensors, by RM0008, section 11."""

import pytest

from tests.features.stm32.conftest import RCC_CFGR, TIM2, Bench

_ADC, _DMA, _RAM, _PENDING = 0x40012400, 0x40020000, 0x20000100, 0xE000E200
_SR, _CR1, _CR2, _SMPR1, _SMPR2, _HTR, _LTR = (_ADC + at for at in (0, 4, 8, 0xC, 0x10, 0x24, 0x28))
_SQR1, _SQR2, _SQR3, _DR = (_ADC + at for at in (0x2C, 0x30, 0x34, 0x4C))
_SOFTWARE = 7 << 17 | 1 << 20 | 1
_START = _SOFTWARE | 1 << 22
_CYCLE_COUNTS = 6
"""An ADC cycle at 72 MHz / 6 = 12 MHz."""


def _on(bench: Bench, control: int = 0, *channels: int) -> None:
    bench.write(RCC_CFGR, bench.read(RCC_CFGR) | 2 << 14)
    bench.write(_SQR1, max(len(channels) - 1, 0) << 20 | sum(each << 5 * i for i, each in enumerate(channels[12:])))
    bench.write(_SQR2, sum(each << 5 * i for i, each in enumerate(channels[6:12])))
    bench.write(_SQR3, sum(each << 5 * i for i, each in enumerate(channels[:6])))
    bench.write(_CR2, _SOFTWARE | control)
    for channel in range(16):
        bench.chip.set_voltage(channel, 0.1 * channel)


def _code(volts: float) -> int:
    return round(volts / 3.3 * 4095)


@pytest.mark.parametrize(("time", "cycles"), [(0, 14), (1, 20), (2, 26), (3, 41), (4, 54), (5, 68), (6, 84), (7, 252)])
def test_a_conversion_takes_its_sampling_time_and_12_and_a_half_cycles(bench: Bench, time: int, cycles: int) -> None:
    _on(bench, 0, 3)
    bench.write(_SMPR2, time << 9)
    bench.write(_CR2, _START)
    bench.run(cycles * _CYCLE_COUNTS - 1)
    assert bench.read(_SR) == 0x10
    bench.run(1)
    assert bench.read(_SR) == 0x12
    assert (bench.read(_DR), bench.read(_SR)) == (_code(0.3), 0x10)


def test_adon_written_again_starts_a_conversion(bench: Bench) -> None:
    _on(bench, 0, 5)
    bench.write(_CR2, 1)
    bench.run(200)
    assert bench.read(_SR) == 0
    bench.write(_CR2, 1)
    bench.run(14 * _CYCLE_COUNTS)
    assert bench.read(_DR) == _code(0.5)


def test_a_scanned_sequence_is_moved_by_dma_and_begins_again_in_continuous_mode(bench: Bench) -> None:
    bench.write(0x40021014, 1)
    for at, value in ((0x0C, 4), (0x10, _DR), (0x14, _RAM), (0x08, 0x05A1)):  # 16 bits, circular, memory increments
        bench.write(_DMA + at, value)
    bench.write(_CR1, 1 << 8)
    channels = (0, 1, 2, 3, 4, 5, 6, 15)
    _on(bench, 1 << 8 | 2, *channels)
    bench.write(_CR2, _START | 1 << 8 | 2)
    bench.run(14 * 8 * _CYCLE_COUNTS)
    assert bench.read(_SR) & 2 == 0  # DMA has read DR
    moved = bench.memory(_RAM, 8)
    assert [int.from_bytes(moved[at : at + 2], "little") for at in (0, 2, 4, 6)] == [
        _code(0.1 * channel) for channel in channels[4:]
    ]
    bench.run(14 * 4 * _CYCLE_COUNTS)
    assert int.from_bytes(bench.memory(_RAM, 8)[:2], "little") == 0


def test_left_alignment_shifts_by_4(bench: Bench) -> None:
    _on(bench, 0, 15)
    bench.write(_CR2, _START | 1 << 11)
    bench.run(14 * _CYCLE_COUNTS)
    assert bench.read(_DR) == _code(1.5) << 4


@pytest.mark.parametrize(("volts", "barks"), [(0.99, 1), (1.01, 0), (1.99, 0), (2.01, 1)])
def test_the_analog_watchdog_barks_outside_of_its_thresholds(bench: Bench, volts: float, barks: int) -> None:
    _on(bench, 0, 2)
    bench.write(_LTR, _code(1.0))
    bench.write(_HTR, _code(2.0))
    bench.write(_CR1, 1 << 23 | 1 << 6)
    bench.chip.set_voltage(2, volts)
    bench.write(_CR2, _START)
    bench.run(14 * _CYCLE_COUNTS)
    assert bench.read(_SR) & 1 == barks
    assert bench.read(_PENDING) >> 18 & 1 == barks


def test_compare_2_of_tim2_starts_it_by_extsel_3(bench: Bench) -> None:
    _on(bench, 0, 1)
    bench.write(_CR2, 3 << 17 | 1 << 20 | 1)
    bench.write(TIM2 + 0x2C, 999)
    bench.write(TIM2 + 0x38, 500)
    bench.write(TIM2 + 0x14, 1)
    bench.write(TIM2, 1)
    bench.run(500 + 14 * _CYCLE_COUNTS - 1)
    assert bench.read(_SR) & 2 == 0
    bench.run(1)
    assert bench.read(_SR) & 2 == 2


@pytest.mark.parametrize(("channel", "volts"), [(16, 1.43 - 0.0043 * 35), (17, 1.2)])
def test_the_chips_own_sensors_need_tsvrefe(bench: Bench, channel: int, volts: float) -> None:
    _on(bench, 0, channel)
    bench.chip.set_temperature(60.0)
    for control, code in ((0, 0), (1 << 23, _code(volts))):
        bench.write(_CR2, _SOFTWARE | control)
        bench.write(_CR2, _START | control)
        bench.run(14 * _CYCLE_COUNTS)
        assert bench.read(_DR) == code
