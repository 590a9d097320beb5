"""Node guarding and life guarding (CiA 301, 7.2.8.3.2), TIME (7.2.6), and the configuration date (1020h)."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, State
from steptwin.protocol.frame import COB_TIME, REMOTE
from steptwin.protocol.nmt import NmtCommand
from tests.controller.bench_board import BenchBoard

REQUEST = REMOTE | 0x710


@pytest.fixture
def board(fast_kernel: Kernel) -> BenchBoard:
    return BenchBoard(fast_kernel)


def answers(board: BenchBoard, requests: int) -> list[int]:
    """The answers to so many requests of the master."""
    before = len(board.frames(0x710))
    for _ in range(requests):
        board.send(REQUEST, b"")
    return [data[0] for data in board.frames(0x710)[before:]]


def test_the_toggle_bit_begins_with_0_after_each_reset_of_communication(board: BenchBoard) -> None:
    assert answers(board, 3) == [0x7F, 0xFF, 0x7F]
    board.nmt(NmtCommand.START)
    assert answers(board, 2) == [0x85, 0x05]
    board.nmt(NmtCommand.STOP)
    assert answers(board, 2) == [0x84, 0x04]
    board.nmt(NmtCommand.RESET_COMMUNICATION)
    assert answers(board, 1) == [0x7F]


def test_a_node_with_a_heartbeat_does_not_answer(board: BenchBoard) -> None:
    board.write(od.PRODUCER_HEARTBEAT_TIME, 1000)
    board.wait(1)
    assert answers(board, 2) == []
    board.write(od.PRODUCER_HEARTBEAT_TIME, 0)
    assert answers(board, 1) == [0x7F]


def test_another_nodes_request_is_ignored(board: BenchBoard) -> None:
    board.send(REMOTE | 0x711, b"")
    assert board.frames(0x710) == [b"\0"]


def test_life_guarding_begins_with_the_first_request(board: BenchBoard) -> None:
    board.write(od.GUARD_TIME, 50)
    board.write(od.LIFE_TIME_FACTOR, 3)
    board.nmt(NmtCommand.START)
    board.wait(1000)
    assert board.errors() == []
    board.send(REQUEST, b"")
    board.wait(149)
    assert board.errors() == []
    board.wait(2)
    assert board.errors() == [ErrorCode.HEARTBEAT_LOST]
    assert board.last(0x090)[3] == 0
    assert answers(board, 1) == [0xFF], "1029h:01 has led to PRE-OPERATIONAL"
    board.wait(1)
    assert board.emergencies() == [ErrorCode.HEARTBEAT_LOST, ErrorCode.NONE]


@pytest.mark.parametrize("off", [od.GUARD_TIME, od.LIFE_TIME_FACTOR])
def test_without_one_of_both_there_is_no_life_guarding(board: BenchBoard, off: int) -> None:
    board.write(od.GUARD_TIME, 50)
    board.write(od.LIFE_TIME_FACTOR, 3)
    board.send(REQUEST, b"")
    board.write(off, 0)
    board.wait(500)
    board.send(REQUEST, b"")
    board.wait(500)
    assert board.errors() == []


def test_a_lost_master_is_a_fault_of_an_enabled_drive(board: BenchBoard) -> None:
    board.write(od.GUARD_TIME, 50)
    board.write(od.LIFE_TIME_FACTOR, 2)
    board.nmt(NmtCommand.START)
    for word in (0x06, 0x0F):
        board.write(od.CONTROLWORD, word)
    assert board.state() is State.OPERATION_ENABLED
    for _ in range(5):
        board.send(REQUEST, b"")
        board.wait(90)
    assert board.state() is State.OPERATION_ENABLED
    board.wait(20)
    assert board.state() is State.FAULT


def test_time_sets_the_time_of_day(board: BenchBoard) -> None:
    assert (board.value(od.TIME_DAYS), board.value(od.TIME_MS)) == (0, 0)
    board.send(COB_TIME, (86_399_000 | 0xF << 28).to_bytes(4, "little") + (15_673).to_bytes(2, "little"))
    assert (board.value(od.TIME_DAYS), board.value(od.TIME_MS)) == (15_673, 86_399_000)
    board.wait(1500)
    board.write(od.GUARD_TIME, 0)  # each request of the master tells the node the time
    assert (board.value(od.TIME_DAYS), board.value(od.TIME_MS)) == (15_674, 500)


def test_time_is_ignored_if_the_node_does_not_use_it_or_its_length_is_wrong(board: BenchBoard) -> None:
    board.send(COB_TIME, bytes((1, 0, 0, 0, 1)))
    board.write(od.TIME_COB_ID, COB_TIME)
    board.send(COB_TIME, bytes((1, 0, 0, 0, 1, 0)))
    assert board.value(od.TIME_DAYS) == 0
    assert board.write(od.TIME_COB_ID, 0x101) == 0x0609_0030


def test_a_changed_parameter_makes_the_configuration_date_0(board: BenchBoard) -> None:
    for entry, value in ((od.CONFIGURATION_DATE, 15_673), (od.CONFIGURATION_TIME, 1000)):
        assert board.write(entry, value) == 0
    assert board.write(od.STORE_ALL, int.from_bytes(b"save", "little")) == 0
    board.nmt(NmtCommand.RESET_NODE)
    board.wait(1)
    board.write(od.CONTROLWORD, 0x06)
    assert board.value(od.CONFIGURATION_DATE) == 15_673, "a command changes no parameter"
    board.write(od.HOME_OFFSET, 5)
    assert (board.value(od.CONFIGURATION_DATE), board.value(od.CONFIGURATION_TIME)) == (0, 0)
