"""A drive whose driver settles (2001h:06) takes no step until then: ENABLE at once, OPERATION ENABLED afterwards."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.node.pins import Pin
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, Mode, State
from tests.controller.bench_board import BenchBoard

SETTLING_MS = 200
US = 1e-3


@pytest.fixture
def board(fast_kernel: Kernel) -> BenchBoard:
    """A board whose drive is READY TO SWITCH ON, in profile velocity, and whose driver takes 200 ms."""
    board = BenchBoard(fast_kernel)
    board.nmt(1)
    board.write(od.MODE_OF_OPERATION, Mode.PROFILE_VELOCITY)
    assert board.write(od.SETTLING_US, 1000 * SETTLING_MS) == 0
    board.write(od.CONTROLWORD, 0x06)
    return board


def enable_level(board: BenchBoard) -> int:
    return board.firmware.nodes[0].pins.level(Pin.ENABLE)


@pytest.mark.parametrize("words", [(0x0F,), (0x07, 0x0F), (0x0F, 0x0F)])
def test_both_sides_of_the_time(board: BenchBoard, words: tuple[int, ...]) -> None:
    for word in words:
        board.write(od.CONTROLWORD, word)
        assert (board.state(), enable_level(board)) == (State.SWITCHED_ON, 1)
    board.wait(SETTLING_MS - US)
    assert board.state() is State.SWITCHED_ON
    board.write(od.TARGET_VELOCITY, 1_000_000)
    assert not board.firmware.motion.running_axes
    board.wait(US)
    assert board.state() is State.OPERATION_ENABLED
    assert not board.firmware.motion.running_axes  # no target from before moves it
    board.write(od.TARGET_VELOCITY, 1_000_000)
    board.wait(1)
    assert board.firmware.motion.running_axes


def test_it_counts_from_enable_not_from_the_last_word(board: BenchBoard) -> None:
    board.write(od.CONTROLWORD, 0x07)
    board.wait(SETTLING_MS - 1)
    board.write(od.CONTROLWORD, 0x0F)
    assert board.state() is State.SWITCHED_ON
    board.wait(1)
    assert board.state() is State.OPERATION_ENABLED


def test_once_settled_it_is_so_until_enable_falls(board: BenchBoard) -> None:
    board.write(od.CONTROLWORD, 0x0F)
    board.wait(SETTLING_MS)
    for word, state in ((0x07, State.SWITCHED_ON), (0x0F, State.OPERATION_ENABLED)):
        board.write(od.CONTROLWORD, word)
        assert board.state() is state
    for word in (0x06, 0x0F):
        board.write(od.CONTROLWORD, word)
    assert board.state() is State.SWITCHED_ON
    board.wait(SETTLING_MS)
    assert board.state() is State.OPERATION_ENABLED


@pytest.mark.parametrize(
    ("word", "state"),
    [(0x07, State.SWITCHED_ON), (0x06, State.READY_TO_SWITCH_ON), (0x00, State.SWITCH_ON_DISABLED)],
)
def test_the_last_command_decides(board: BenchBoard, word: int, state: State) -> None:
    board.write(od.CONTROLWORD, 0x0F)
    board.wait(SETTLING_MS / 2)
    board.write(od.CONTROLWORD, word)
    board.wait(SETTLING_MS)
    assert (board.state(), enable_level(board)) == (state, int(state is State.SWITCHED_ON))


def test_a_bit_of_the_word_that_enables_starts_nothing(board: BenchBoard) -> None:
    board.write(od.MODE_OF_OPERATION, Mode.PROFILE_POSITION)
    board.write(od.TARGET_POSITION, 100_000)
    board.write(od.CONTROLWORD, 0x0F | Control.START)
    board.wait(SETTLING_MS + 1)
    assert board.state() is State.OPERATION_ENABLED
    assert not board.firmware.motion.running_axes


def test_a_fault_while_it_settles(board: BenchBoard) -> None:
    board.write(od.CONTROLWORD, 0x0F)
    board.measure(supply_10mv=0)
    board.wait(2 * SETTLING_MS)
    assert (board.state(), enable_level(board)) == (State.FAULT, 0)


def test_without_the_time_it_is_enabled_at_once(board: BenchBoard) -> None:
    board.write(od.SETTLING_US, 0)
    board.write(od.CONTROLWORD, 0x0F)
    assert board.state() is State.OPERATION_ENABLED


def test_limits(board: BenchBoard) -> None:
    assert board.write(od.SETTLING_US, 10_000_000) == 0
    assert board.write(od.SETTLING_US, 10_000_001) == 0x0609_0031
