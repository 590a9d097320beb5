"""Safe torque off (STO): no pulse and no ENABLE at once, SWITCH ON DISABLED, and no command until the request ends."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.node.pins import Pin
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, ErrorCode, Mode, State, Status
from tests.controller.bench_board import BenchBoard

OFF, ON = DigitalInput.TORQUE_OFF, DigitalInput(0)


@pytest.fixture
def board(fast_kernel: Kernel) -> BenchBoard:
    return BenchBoard(fast_kernel)


def test_a_moving_axis_stops_at_once_and_loses_its_position(board: BenchBoard) -> None:
    board.enable(Mode.PROFILE_VELOCITY)
    board.write(od.TARGET_VELOCITY, 1_000_000)
    board.wait(500)
    board.set_inputs(OFF)
    stopped = board.value(od.POSITION_DEMAND)
    assert board.state() is State.SWITCH_ON_DISABLED
    assert board.firmware.nodes[0].pins.level(Pin.ENABLE) == 0
    assert not board.has(Status.VOLTAGE_ENABLED)
    assert not board.has(Status.POSITION_KNOWN)
    board.wait(100)
    assert board.value(od.POSITION_DEMAND) == stopped
    assert board.errors() == [ErrorCode.TORQUE_OFF]
    assert board.value(od.DIGITAL_INPUTS) & OFF


def test_no_command_enables_the_drive_until_the_request_ends(board: BenchBoard) -> None:
    board.set_inputs(OFF)
    for word in (0x06, 0x07, 0x0F, 0x06, 0x0F):
        assert board.write(od.CONTROLWORD, word) == 0
    assert board.state() is State.SWITCH_ON_DISABLED
    board.set_inputs(ON)
    board.wait(1)
    assert board.emergencies() == [ErrorCode.TORQUE_OFF, ErrorCode.NONE]
    assert board.state() is State.SWITCH_ON_DISABLED, "the last command does not act later"
    for word in (0x06, 0x0F):
        board.write(od.CONTROLWORD, word)
    assert board.state() is State.OPERATION_ENABLED


@pytest.mark.parametrize("words", [(0x06,), (0x06, 0x07)])
def test_a_drive_that_is_ready_falls_back(board: BenchBoard, words: tuple[int, ...]) -> None:
    for word in words:
        board.write(od.CONTROLWORD, word)
    board.set_inputs(OFF)
    assert board.state() is State.SWITCH_ON_DISABLED


def test_a_fault_can_be_reset_meanwhile(board: BenchBoard) -> None:
    board.enable()
    board.set_inputs(DigitalInput.ESTOP)
    board.wait(100)
    board.set_inputs(OFF)
    assert board.state() is State.FAULT
    board.write(od.CONTROLWORD, 0x80)
    assert board.state() is State.SWITCH_ON_DISABLED
