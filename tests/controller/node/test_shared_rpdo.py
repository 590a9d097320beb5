"""One RPDO for several axes, by dummies, and an RPDO that is expected in time (CiA 301, section 7.5.2.35)."""

import struct

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import AbortConnection, ErrorCode, Mode, State
from steptwin.protocol.frame import COB_ID_INVALID
from steptwin.protocol.nmt import NmtCommand, NmtState
from tests.controller.bench_board import BenchBoard
from tests.controller.node.test_lost_host import errors, moving, states

SHARED = 0x4A0
DUMMY_32 = 0x0007_0020
TARGET = 0x607A_0020
COMMUNICATION, MAPPING = 0x1402_00, 0x1602_00
"""Of RPDO3."""


def share_targets(board: BenchBoard) -> None:
    """Let both axes take their targets from one RPDO3, each from its own half."""
    board.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    for axis in (0, 1):
        words = [DUMMY_32, DUMMY_32]
        words[axis] = TARGET
        for address, value in (
            (COMMUNICATION + od.PDO_COB_ID, SHARED | COB_ID_INVALID),
            (MAPPING, 0),
            (MAPPING + 1, words[0]),
            (MAPPING + 2, words[1]),
            (MAPPING, 2),
            (COMMUNICATION + od.PDO_COB_ID, SHARED),
        ):
            assert board.write(address, value, axis) == 0


def test_one_frame_carries_the_targets_of_two_axes(pair: BenchBoard) -> None:
    share_targets(pair)
    pair.enable(Mode.CYCLIC_SYNCHRONOUS_POSITION)
    for i in (*range(30), 29, 29, 29):  # the last target again, since the drives extrapolate by one period
        pair.wait(10)
        pair.send(SHARED, struct.pack("<ii", 100 * i, -300 * i))
        pair.send(0x080, b"")
    pair.wait(25)
    assert [pair.value(od.POSITION_DEMAND, axis) for axis in (0, 1)] == [2900, -8700]
    assert [pair.value(od.RPDO_VALUES_REFUSED, axis) for axis in (0, 1)] == [0, 0]


# --- event timer

TIMEOUT = 0x1403_00 + od.PDO_EVENT_TIMER
"""Of RPDO4, which carries the PVT records."""


def expect_records(board: BenchBoard, *axes: int, timeout_ms: int = 50) -> None:
    for axis in axes:
        assert board.write(TIMEOUT, timeout_ms, axis) == 0


def test_no_time_limit_by_default(pair: BenchBoard) -> None:
    moving(pair)
    pair.wait(900)
    assert errors(pair, 0) == []


def test_an_rpdo_that_stays_away_stops_all_that_move_in_step(pair: BenchBoard) -> None:
    """The last records came when the motion began; the queue still holds 950 ms."""
    expect_records(pair, 0)
    moving(pair)
    pair.wait(49.99)
    assert states(pair) == [State.OPERATION_ENABLED] * 2
    pair.wait(0.02)
    assert states(pair) == [State.FAULT_REACTION_ACTIVE] * 2
    assert errors(pair, 0) == ["5082110400000000"]
    assert [pair.value(od.ERROR_CODE, axis) for axis in (0, 1)] == [ErrorCode.RPDO_TIMEOUT, ErrorCode.GROUP_STOPPED]
    assert [node.nmt_state for node in pair.firmware.nodes] == [NmtState.OPERATIONAL] * 2


def test_each_frame_begins_the_time_again(pair: BenchBoard) -> None:
    expect_records(pair, 0)
    moving(pair)
    for _ in range(10):
        pair.wait(49)
        pair.record(0, 0, 1, 200)  # an old number, which is ignored
    assert states(pair) == [State.OPERATION_ENABLED] * 2


def test_the_time_begins_with_the_first_frame_and_ends_outside_of_operational(board: BenchBoard) -> None:
    expect_records(board, 0)
    board.nmt(NmtCommand.START)
    board.wait(200)
    assert errors(board, 0) == []
    board.record(0, 0, 1, 200)
    board.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    board.wait(200)
    assert errors(board, 0) == []


def test_the_error_ends_with_the_next_frame_of_a_drive_that_is_off(board: BenchBoard) -> None:
    expect_records(board, 0)
    board.nmt(NmtCommand.START)
    board.record(0, 0, 1, 200)
    board.wait(60)
    assert errors(board, 0) == ["5082110400000000"]
    board.send(0x210, b"\x00\x00\x00")  # another PDO
    assert board.value(od.ERROR_REGISTER) == 0x11
    board.record(0, 0, 1, 200)
    assert errors(board, 0)[1:] == ["0000000000000000"]
    board.wait(60)
    assert errors(board, 0)[2:] == ["5082110400000000"]


def test_in_fault_it_ends_with_the_fault_reset(board: BenchBoard) -> None:
    expect_records(board, 0)
    board.enable(Mode.NONE)
    board.record(0, 0, 1, 200)
    board.wait(60)
    assert board.state() is State.FAULT
    board.record(0, 0, 1, 200)
    assert board.value(od.ERROR_REGISTER) == 0x11
    assert board.write(od.CONTROLWORD, 0x80) == 0
    assert (board.state(), board.value(od.ERROR_REGISTER)) == (State.SWITCH_ON_DISABLED, 0)


@pytest.mark.parametrize(
    ("option", "state"),
    [
        (AbortConnection.NO_ACTION, State.OPERATION_ENABLED),
        (AbortConnection.DISABLE_VOLTAGE, State.SWITCH_ON_DISABLED),
        (AbortConnection.QUICK_STOP, State.SWITCH_ON_DISABLED),
    ],
)
def test_the_option_code_of_a_lost_connection_decides(
    fast_kernel: Kernel, option: AbortConnection, state: State
) -> None:
    board = BenchBoard(fast_kernel)
    assert board.write(od.ABORT_CONNECTION_OPTION, option) == 0
    expect_records(board, 0)
    board.enable(Mode.NONE)
    board.record(0, 0, 1, 200)
    board.wait(60)
    assert board.state() is state
    assert board.errors() == [ErrorCode.RPDO_TIMEOUT]


def test_the_drive_tells_its_supply_motor_and_profile(board: BenchBoard) -> None:
    board.measure(supply_10mv=2405)
    assert board.value(od.DC_LINK_VOLTAGE) == 24_050
    assert board.value(od.SUPPLY_VOLTAGE) == 2405
    assert (board.value(od.MOTOR_TYPE), board.value(od.VERSION_NUMBER)) == (9, 0x0003_0000)
