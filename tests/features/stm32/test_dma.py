"""DMA1: sizes, increments, circular mode, priorities, errors, interrupts and requests, by RM0008, section 13."""

import pytest

from steptwin.features.stm32.chip import dma
from tests.features.stm32.conftest import GPIOA, TIM2, USART1, Bench

_DMA, _AHBENR, _RAM, _PENDING = 0x40020000, 0x40021014, 0x20000100, 0xE000E200
_DIER, _SR, _EGR, _PSC, _ARR = (TIM2 + at for at in (0x0C, 0x10, 0x14, 0x28, 0x2C))
_UPDATE = 1 << 8


def _channel(bench: Bench, channel: int, control: int, count: int, peripheral: int, memory: int) -> None:
    place = _DMA + 8 + 20 * (channel - 1)
    for at, value in ((0x04, count), (0x08, peripheral), (0x0C, memory), (0x00, control)):
        bench.write(place + at, value)


def _count(bench: Bench, channel: int) -> int:
    return bench.read(_DMA + 0x0C + 20 * (channel - 1))


def _flags(bench: Bench, channel: int) -> int:
    return bench.read(_DMA) >> 4 * (channel - 1) & 0xF


def _fill(bench: Bench, *words: int) -> None:
    bench.set_memory(_RAM, b"".join(word.to_bytes(4, "little") for word in words))


def _bench(bench: Bench) -> Bench:
    bench.write(_AHBENR, 1)
    return bench


def _updates(bench: Bench, counts: int = 100) -> None:
    """Let TIM2's updates request channel 2."""
    bench.write(_ARR, counts - 1)
    bench.write(_EGR, 1)
    bench.write(_DIER, _UPDATE)
    bench.write(TIM2, 1)


def test_an_update_moves_a_word_to_bsrr_each_time_round_and_round(bench: Bench) -> None:
    _bench(bench)
    bench.write(GPIOA, 0x33333333)
    _fill(bench, 1, 1 << 16, 2, 2 << 16)
    _channel(bench, 2, 0x0AB7, 4, GPIOA + 0x10, _RAM)  # 32 bits, memory increments, circular, to the peripheral
    begin = bench.chip.now_counts
    _updates(bench)
    bench.run(550)
    edges = [(at - begin, pin) for at, pin in bench.edges()]
    assert edges == [(100, "A0+"), (200, "A0-"), (300, "A1+"), (400, "A1-"), (500, "A0+")]
    assert _count(bench, 2) == 3


def test_half_and_complete_are_flagged_and_ask_for_the_interrupt(bench: Bench) -> None:
    _bench(bench)
    _channel(bench, 2, 0x0AB7, 4, TIM2 + 0x34, _RAM)
    _updates(bench)
    seen = []
    for _ in range(5):
        bench.run(100)
        seen.append(_flags(bench, 2))
        bench.write(_DMA + 4, dma.GIF << 4)
    assert seen == [0, dma.HTIF | dma.GIF, 0, dma.TCIF | dma.GIF, 0]
    assert bench.read(_PENDING) >> 12 & 1 == 1


def test_a_single_flag_is_cleared_and_the_global_one_with_the_last(bench: Bench) -> None:
    _bench(bench)
    _channel(bench, 2, 0x0A91, 2, TIM2 + 0x34, _RAM)
    _updates(bench)
    bench.run(250)
    assert _flags(bench, 2) == 7
    bench.write(_DMA + 4, dma.HTIF << 4)
    assert _flags(bench, 2) == dma.TCIF | dma.GIF
    bench.write(_DMA + 4, dma.TCIF << 4)
    assert _flags(bench, 2) == 0


def test_a_channel_ends_after_its_last_transfer_and_is_locked_while_it_is_enabled(bench: Bench) -> None:
    _bench(bench)
    _channel(bench, 2, 0x0A91, 2, TIM2 + 0x34, _RAM)
    bench.write(_DMA + 0x20, 77)
    bench.write(_DMA + 0x24, 77)
    assert (_count(bench, 2), bench.read(_DMA + 0x24)) == (2, TIM2 + 0x34)
    _updates(bench)
    bench.run(500)
    assert _count(bench, 2) == 0
    bench.write(_DMA + 0x1C, 0)
    bench.write(_DMA + 0x20, 77)
    assert _count(bench, 2) == 77


@pytest.mark.parametrize(
    ("psize", "msize", "moved"),
    [
        # RM0008, table 76: source of 4 items at the peripheral's side, what the memory has then
        (0, 0, "b0b1b2b3"),
        (0, 1, "b000b100b200b300"),
        (0, 2, "b0000000b1000000b2000000b3000000"),
        (1, 0, "b0b2b4b6"),
        (1, 1, "b0b1b2b3b4b5b6b7"),
        (1, 2, "b0b10000b2b30000b4b50000b6b70000"),
        (2, 0, "b0b4b8bc"),
        (2, 1, "b0b1b4b5b8b9bcbd"),
        (2, 2, "b0b1b2b3b4b5b6b7b8b9babbbcbdbebf"),
    ],
)
def test_sizes_cut_or_fill_with_0_as_the_table_says(bench: Bench, psize: int, msize: int, moved: str) -> None:
    _bench(bench)
    bench.set_memory(_RAM, bytes(range(0xB0, 0xC0)))
    _channel(bench, 1, 0x40C1 | psize << 8 | msize << 10, 4, _RAM, _RAM + 0x100)
    bench.run(4 * 6)
    assert bench.memory(_RAM + 0x100, 16).hex() == moved.ljust(32, "0")
    assert _flags(bench, 1) == 7


def test_memory_to_memory_takes_its_time_and_stops(bench: Bench) -> None:
    _bench(bench)
    _channel(bench, 1, 0x4AE1, 4, _RAM, _RAM + 0x100)  # circular mode is none from memory to memory
    bench.run(11)
    assert _count(bench, 1) == 3
    bench.run(100)
    assert _count(bench, 1) == 0


@pytest.mark.parametrize(("priorities", "first"), [((0, 0), 2), ((0, 1), 7), ((3, 2), 2)])
def test_of_two_requests_the_higher_priority_is_first_then_the_lower_number(
    bench: Bench, priorities: tuple[int, int], first: int
) -> None:
    _bench(bench)
    bench.write(GPIOA, 0x33333333)
    _fill(bench, 1, 1 << 16)
    for channel, priority, memory in ((2, priorities[0], _RAM), (7, priorities[1], _RAM + 4)):
        _channel(bench, channel, 0x0A11 | priority << 12, 1, GPIOA + 0x10, memory)
    bench.write(TIM2 + 0x38, 0)  # compare 2 is channel 7; it matches with the update
    _updates(bench)
    bench.write(_DIER, _UPDATE | 1 << 10)
    bench.run(150)
    assert bench.read(GPIOA + 0x0C) == (0 if first == 2 else 1)


@pytest.mark.parametrize("place", [0x30000000, 0x20005000])
def test_a_place_that_is_not_there_is_an_error_that_disables_the_channel(bench: Bench, place: int) -> None:
    _bench(bench)
    _channel(bench, 2, 0x0A99, 2, TIM2 + 0x34, place)
    _updates(bench)
    bench.run(150)
    assert _flags(bench, 2) == dma.TEIF | dma.GIF
    assert bench.read(_DMA + 0x1C) & 1 == 0
    assert bench.read(_PENDING) >> 12 & 1 == 1


def test_a_usart_sends_and_receives_by_its_channels(bench: Bench) -> None:
    _bench(bench)
    bench.set_memory(_RAM, b"hello")
    bench.write(USART1 + 8, 625)
    bench.write(USART1 + 0x14, 0xC0)
    _channel(bench, 4, 0x91, 5, USART1 + 4, _RAM)
    _channel(bench, 5, 0x81, 3, USART1 + 4, _RAM + 0x100)
    bench.write(USART1 + 0xC, 0x200C)
    bench.chip.give(0, b"abc")
    bench.run(6250 * 5)
    assert bench.chip.sent(0) == b"hello"
    assert bench.memory(_RAM + 0x100, 3) == b"abc"
    assert (_flags(bench, 4), _flags(bench, 5)) == (7, 7)


@pytest.mark.parametrize(("withdrawn", "left"), [(False, 2), (True, 3)])
def test_a_request_that_was_not_served_waits_for_the_channel_until_its_enable_is_cleared(
    bench: Bench, withdrawn: bool, left: int
) -> None:
    _bench(bench)
    _channel(bench, 2, 0x0A91, 1, TIM2 + 0x34, _RAM)
    _updates(bench)
    bench.run(250)
    assert _count(bench, 2) == 0
    if withdrawn:
        bench.write(_DIER, 0)
        bench.write(_DIER, _UPDATE)
    bench.write(_DMA + 0x1C, 0)
    _channel(bench, 2, 0x0A91, 3, TIM2 + 0x34, _RAM)
    assert _count(bench, 2) == left
