"""The emergency stop by a program (2015h): from every state of the drive into FAULT, and out by a fault reset only."""

import pytest

from steptwin.protocol import cia402, od
from steptwin.protocol.cia402 import Control, ErrorCode, Mode, State, Status
from steptwin.protocol.sdo_frames import AbortCode
from tests.controller.bench_board import BenchBoard

WORDS = {
    State.SWITCH_ON_DISABLED: (),
    State.READY_TO_SWITCH_ON: (cia402.SHUTDOWN,),
    State.SWITCHED_ON: (cia402.SHUTDOWN, cia402.SWITCH_ON),
    State.OPERATION_ENABLED: (cia402.SHUTDOWN, cia402.SWITCH_ON, cia402.ENABLE_OPERATION),
    State.QUICK_STOP_ACTIVE: (cia402.SHUTDOWN, cia402.SWITCH_ON, cia402.ENABLE_OPERATION, cia402.QUICK_STOP),
}
ENABLING = (cia402.SHUTDOWN, cia402.SWITCH_ON, cia402.ENABLE_OPERATION)
HOLD_AFTER_QUICK_STOP = 6
RESET_NODE = 0x81
DETAIL = 3
"""Place of the detail in an EMCY, behind code and error register."""


def stop(board: BenchBoard) -> None:
    assert board.write(od.EMERGENCY_STOP, 1) == 0


def command(board: BenchBoard, *words: int) -> State:
    for word in words:
        assert board.write(od.CONTROLWORD, word) == 0
    return board.state()


def held(board: BenchBoard) -> bool:
    return bool(board.value(od.EMERGENCY_STOP))


@pytest.mark.parametrize("state", WORDS)
def test_every_state_leads_into_fault(board: BenchBoard, state: State) -> None:
    board.nmt(1)
    board.write(od.QUICK_STOP_OPTION, HOLD_AFTER_QUICK_STOP)
    assert command(board, *WORDS[state]) is state
    stop(board)
    assert (board.state(), held(board), board.value(od.ERROR_CODE)) == (State.FAULT, True, ErrorCode.ESTOP)
    board.wait(10)
    assert board.errors() == [ErrorCode.ESTOP]
    assert board.frames(0x090)[-1][DETAIL] == 1


def test_only_the_fault_reset_leads_out(board: BenchBoard) -> None:
    board.nmt(1)
    stop(board)
    assert command(board, *ENABLING, cia402.DISABLE_VOLTAGE, *ENABLING) is State.FAULT
    assert board.write(od.EMERGENCY_STOP, 0) == AbortCode.VALUE_TOO_LOW
    assert held(board)
    assert command(board, 0, Control.FAULT_RESET) is State.SWITCH_ON_DISABLED
    assert not held(board)
    assert command(board, *ENABLING) is State.OPERATION_ENABLED


def test_a_drive_in_fault_is_held_as_well(board: BenchBoard) -> None:
    board.enable()
    board.measure(supply_10mv=0)
    assert board.state() is State.FAULT
    stop(board)
    assert held(board)
    assert command(board, 0, Control.FAULT_RESET) is State.FAULT
    assert held(board)  # the supply is still missing, so nothing was reset
    board.measure()
    assert command(board, 0, Control.FAULT_RESET) is State.SWITCH_ON_DISABLED
    assert not held(board)


@pytest.mark.parametrize("stopping", [False, True])
def test_a_moving_axis_ramps_down_and_keeps_its_position(board: BenchBoard, stopping: bool) -> None:
    board.enable(Mode.PROFILE_VELOCITY)
    command(board, cia402.ENABLE_OPERATION)
    board.write(od.TARGET_VELOCITY, 1000 * 16_384)
    board.wait(500)
    assert board.value(od.VELOCITY_ACTUAL)
    if stopping:
        assert command(board, cia402.QUICK_STOP) is State.QUICK_STOP_ACTIVE
        board.wait(5)
    before_units = board.value(od.POSITION_DEMAND)
    stop(board)
    assert board.state() is State.FAULT_REACTION_ACTIVE
    board.wait(200)
    assert (board.state(), held(board)) == (State.FAULT, True)
    assert board.has(Status.TARGET_REACHED)
    ramp_units = (1000 * 16_384) ** 2 // (2 * 20_000 * 16_384)
    assert 0 < board.value(od.POSITION_DEMAND) - before_units <= 1.1 * ramp_units


def test_a_reset_of_the_node_ends_it(board: BenchBoard) -> None:
    stop(board)
    board.nmt(RESET_NODE)
    assert (board.state(), held(board)) == (State.SWITCH_ON_DISABLED, False)
