"""What a test gets of a running image: the fixture, USARTs, pins, variables, snapshots."""

import numpy as np
import pytest

from steptwin.features.stm32.pin_log import PinLog
from steptwin.features.stm32.tools import ExpectationError, ImageTools
from steptwin.host.common.errors import InputError
from tests.features.stm32.examples import example_board


@pytest.fixture
def tools() -> ImageTools:
    """Return the compare stepper, 10 ms after power-up."""
    return example_board("compare_stepper")[1]


def test_expect_reads_what_a_usart_sends_once(tools: ImageTools) -> None:
    assert tools.uart.expect("read", within_s=0.0) == "read"
    assert tools.uart.read() == "y\n"
    began_s = tools.now_s
    with pytest.raises(ExpectationError, match=r"^USART1 has not sent 'ready' within 0\.002 s, but ''$"):
        tools.uart.expect("ready", within_s=0.002)
    assert tools.now_s - began_s == pytest.approx(0.002, abs=1e-5)
    assert tools.uart.text == "ready\n"


def test_a_pin_has_its_edges_since_power_up(tools: ImageTools) -> None:
    history = tools.pin("PA0").history
    assert [each.level for each in history[:4]] == [1, 0, 1, 0]
    assert history[0].t_s == pytest.approx(0.7475e-3, abs=2e-6)  # "ready" at 115 200 baud, and 200 us for DIR
    assert tools.pin("PA4").level == 1
    assert tools.pin("PB3").history == []
    with pytest.raises(InputError, match=r"^'PF1': is no pin from PA0 to PE15"):
        tools.pin("PF1")


def test_variables_are_read_and_written_by_their_symbols(tools: ImageTools) -> None:
    axes = tools.symbol("axes")
    assert axes.size_bytes == 64
    step, direction, target, position = np.frombuffer(axes.content[:16], np.int32).tolist()
    assert (step, direction, target) == (1, 2, 0)
    assert position == len(tools.pin("PA0").history) // 2
    axes.content = axes.content[:16] + bytes(48)
    assert axes.content[16:] == bytes(48)
    with pytest.raises(InputError, match=r"^axes: has 64 bytes, not 3$"):
        axes.content = b"abc"
    with pytest.raises(InputError, match=r"^axes: has 64 bytes and is no integer: use its content$"):
        _ = axes.value
    with pytest.raises(InputError, match=r"^variable 'axis' is unknown: did you mean axes\?$"):
        tools.symbol("axis")


def test_an_integer_has_a_value_within_its_bits() -> None:
    _, tools = example_board("systick_stepper")
    left = tools.symbol("left")
    assert 0 < left.value == left.signed <= 1000
    left.value = -1
    assert (left.value, left.signed) == (0xFFFFFFFF, -1)
    with pytest.raises(InputError, match=r"^left: 4294967296 does not fit into its 32 bits$"):
        left.value = 1 << 32
    assert tools.symbol("running").size_bytes == 1


def test_memory_that_is_not_there_is_refused(tools: ImageTools) -> None:
    assert tools.read_memory(0x08000000, 4) == tools.read_memory(0, 4)
    with pytest.raises(InputError, match=r"^0x20004FFE: 4 bytes there are neither RAM nor flash$"):
        tools.read_memory(0x20004FFE, 4)
    with pytest.raises(InputError, match=r"^0x40000000: 1 bytes there are neither RAM nor flash$"):
        tools.write_memory(0x40000000, b"\0")


def _edges_of(tools: ImageTools, dt_s: float) -> list[tuple[int, int]]:
    """Let time pass; return the edges of STEP meanwhile, in counts since its beginning."""
    begin_counts = tools.chip.now_counts
    tools.wait(dt_s)
    counts, levels = tools.firmware.edges.of(0)
    new = counts > begin_counts
    return list(zip((counts[new] - begin_counts).tolist(), levels[new].tolist(), strict=True))


@pytest.mark.parametrize("times", [3, pytest.param(1000, marks=pytest.mark.slow)])
def test_restored_snapshots_go_on_without_a_difference(tools: ImageTools, times: int) -> None:
    board_began = tools.now_s
    snapshot = tools.snapshot()
    reference, content = _edges_of(tools, 0.002), tools.symbol("axes").content
    assert len(reference) >= 4
    for _ in range(times):
        tools.restore(snapshot)
        assert _edges_of(tools, 0.002) == reference
        assert tools.symbol("axes").content == content
    assert tools.now_s - board_began == pytest.approx(0.002 * (times + 1), abs=1e-4 * times)


def test_a_restored_pin_changes_at_once_and_texts_are_unread_again(tools: ImageTools) -> None:
    snapshot = tools.snapshot()
    level = tools.pin("PA0").level
    tools.uart.read()
    while tools.pin("PA0").level == level:
        tools.wait(2e-6)
    tools.restore(snapshot)
    assert tools.pin("PA0").history[-1].level == level
    assert tools.uart.read() == "ready\n"


def test_old_edges_are_dropped_when_there_are_too_many() -> None:
    log = PinLog(edges_max=4)
    for at in range(10):
        log.add(np.array([2 * at, 2 * at + 1]), np.array([2 * 7 + 1, 2 * 7]))
    counts, levels = log.of(7)
    assert counts.tolist() == [16, 17, 18, 19]
    assert levels.tolist() == [1, 0, 1, 0]
    assert log.of(6)[0].size == 0


def test_a_failed_test_shows_what_the_usarts_sent() -> None:
    board, _ = example_board("compare_stepper")
    assert board.parts["stm32"].in_words() == "USART1: ready"
