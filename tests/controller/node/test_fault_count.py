"""The reset that names the fault it answers (2018h): a later fault or emergency stop stays."""

import pytest

from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, State
from steptwin.protocol.sdo_frames import AbortCode
from tests.controller.bench_board import BenchBoard

NONE = 0xFFFF_FFFF
"""What is read as the age of a fault while there was none."""


def number(board: BenchBoard, axis: int = 0) -> int:
    return board.value(od.FAULT_NUMBER, axis)


def age_ms(board: BenchBoard) -> int:
    board.send(0x610, b"\x40\x18\x20\x02" + bytes(4))  # by SDO: the time of a call is the time of its frame
    return int.from_bytes(board.last(0x590)[4:], "little")


def stop(board: BenchBoard) -> None:
    assert board.write(od.EMERGENCY_STOP, 1) == 0


def reset(board: BenchBoard, answered: int) -> int:
    return board.write(od.FAULT_RESET, answered)


def test_a_reset_answers_the_last_fault_only(board: BenchBoard) -> None:
    assert (number(board), age_ms(board)) == (0, NONE)
    stop(board)
    assert number(board) == 1
    stop(board)  # in fault already: all the same a stop that its user wants to last
    assert number(board) == 2
    assert reset(board, 1) == AbortCode.DEVICE_STATE
    assert (board.state(), board.value(od.EMERGENCY_STOP)) == (State.FAULT, 1)
    assert reset(board, 3) == AbortCode.DEVICE_STATE
    assert reset(board, 2) == 0
    assert (board.state(), board.value(od.EMERGENCY_STOP)) == (State.SWITCH_ON_DISABLED, 0)
    assert number(board) == 2


def test_the_age_counts_from_the_last_fault(board: BenchBoard) -> None:
    stop(board)
    board.wait(250)
    assert age_ms(board) in (250, 251)
    stop(board)
    assert age_ms(board) <= 1


def test_a_reset_outside_fault_does_nothing(board: BenchBoard) -> None:
    board.enable()
    assert reset(board, 0) == 0
    assert board.state() is State.OPERATION_ENABLED
    assert reset(board, 1) == AbortCode.DEVICE_STATE


@pytest.mark.parametrize("enabled", [True, False])
def test_the_button_counts_with_the_drive_on_and_off_and_in_fault(board: BenchBoard, enabled: bool) -> None:
    if enabled:
        board.enable()
    else:
        stop(board)
    before = number(board)
    board.set_inputs(DigitalInput.ESTOP)
    board.wait(10)
    pressed = number(board)
    assert pressed > before
    assert reset(board, pressed) == 0  # obeyed, but the cause lasts
    assert board.state() is State.FAULT
    board.set_inputs(DigitalInput(0))
    board.wait(10)
    assert number(board) == pressed
    assert reset(board, before) == AbortCode.DEVICE_STATE
    assert reset(board, pressed) == 0
    assert board.state() is State.SWITCH_ON_DISABLED


def test_each_fault_counts(board: BenchBoard) -> None:
    board.enable()
    board.measure(supply_10mv=100)
    board.wait(10)
    assert (board.state(), number(board)) == (State.FAULT, 1)
    board.measure()
    assert reset(board, 1) == 0
    board.enable()
    board.measure(supply_10mv=100)
    board.wait(10)
    assert number(board) == 2
    assert reset(board, 1) == AbortCode.DEVICE_STATE


def test_numbers_outlive_a_reset_of_the_node(board: BenchBoard) -> None:
    stop(board)
    board.nmt(0x81)
    stop(board)
    assert number(board) == 2


def test_each_axis_counts_its_own(pair: BenchBoard) -> None:
    stop(pair)
    assert [number(pair, axis) for axis in (0, 1)] == [1, 0]


def test_a_pressed_button_counts_once_whatever_other_inputs_do(board: BenchBoard) -> None:
    board.enable()
    board.set_inputs(DigitalInput.ESTOP)
    board.wait(10)
    pressed = number(board)
    for levels in (DigitalInput.ESTOP | DigitalInput.HOME, DigitalInput.ESTOP):
        board.set_inputs(levels)
        assert number(board) == pressed
    board.set_inputs(DigitalInput(0))
    board.set_inputs(DigitalInput.ESTOP)
    assert number(board) == pressed + 1
