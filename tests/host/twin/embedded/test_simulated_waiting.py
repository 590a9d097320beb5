"""The canopen library waits for frames in simulated time; its thread never blocks and its log has no warning."""

import logging
import threading
from collections.abc import Iterator

import canopen
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode
from tests.host.client.machines import START, WAREHOUSE
from tests.host.client.other_masters import Node402, node402, set_up
from tests.operations import EmergencyStop

NODE = 0x13
TPDO1_INHIBIT_S = 0.005
TPDO1_EVENT_S = 0.100
SLICE_S = 0.001


@pytest.fixture(autouse=True)
def quiet(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> Iterator[None]:
    """Let a thread that blocks fail the test, and so a warning of the library."""

    def wait(_condition: threading.Condition, _timeout: float | None = None) -> bool:
        raise AssertionError("the library blocks its thread")

    monkeypatch.setattr(threading.Condition, "wait", wait)
    yield
    assert [record for record in caplog.records if record.levelno >= logging.WARNING] == []


@pytest.fixture
def board(fast_kernel: Kernel) -> EmbeddedBoard:
    return EmbeddedBoard(WAREHOUSE, fast_kernel, MachineOptions(stand_at=START))


@pytest.fixture
def node(board: EmbeddedBoard) -> Node402:
    """A node in OPERATIONAL whose drive is off."""
    made = node402(board.network, NODE)
    set_up(made)
    made.nmt.state = "OPERATIONAL"
    return made


@pytest.mark.slow
def test_states_and_modes_take_one_tpdo_each(board: EmbeddedBoard, node: Node402) -> None:
    """TPDO1 comes with each change, at least its inhibit time after the one before."""
    begin_s = board.now_s()
    node.op_mode = "PROFILED POSITION"
    node.state = "OPERATION ENABLED"
    node.op_mode = "PROFILED VELOCITY"
    assert (node.state, node.op_mode) == ("OPERATION ENABLED", "PROFILED VELOCITY")
    assert board.now_s() - begin_s < 5 * (TPDO1_INHIBIT_S + SLICE_S) + TPDO1_EVENT_S


def test_the_mode_is_awaited_from_the_first_tpdo_on(node: Node402) -> None:
    """Before the second TPDO1 the library does not know that it is periodic."""
    assert node.tpdo[1].period == TPDO1_EVENT_S
    node.op_mode = "PROFILED POSITION"
    assert node.op_mode == "PROFILED POSITION"


def test_a_wait_ends_with_its_frame_or_its_time_out(board: EmbeddedBoard, node: Node402) -> None:
    status = node.tpdo[1]
    board.wait(TPDO1_EVENT_S)
    before_s = board.now_s()
    received_s = status.wait_for_reception(timeout=1.0)
    assert received_s is not None
    assert before_s < received_s <= board.now_s() < received_s + 2 * SLICE_S
    assert received_s <= before_s + TPDO1_EVENT_S

    before_s = board.now_s()
    assert node.tpdo[4].wait_for_reception(timeout=0.25) is None  # inputs, which do not change
    assert board.now_s() - before_s == pytest.approx(0.25, abs=2 * SLICE_S)


def test_heartbeats_and_emergencies_are_awaited_too(board: EmbeddedBoard, node: Node402) -> None:
    before_s = board.now_s()
    with pytest.raises(canopen.nmt.NmtError):
        node.nmt.wait_for_heartbeat(timeout=2.0)
    assert board.now_s() - before_s == pytest.approx(2.0, abs=2 * SLICE_S)
    node.write(od.PRODUCER_HEARTBEAT_TIME, 300)
    before_s = board.now_s()
    assert node.nmt.wait_for_heartbeat(timeout=2.0) == "OPERATIONAL"
    assert board.now_s() - before_s <= 0.300 + SLICE_S

    assert node.emcy.wait(timeout=2.0) is None
    node.state = "OPERATION ENABLED"
    board.operate(EmergencyStop(pressed=True))
    error = node.emcy.wait(timeout=2.0)
    assert error is not None
    assert error.code == ErrorCode.ESTOP


def test_equal_programs_take_equal_times(fast_kernel: Kernel) -> None:
    logs = []
    for _ in range(2):
        board = EmbeddedBoard(WAREHOUSE, fast_kernel, MachineOptions(stand_at=START))
        node = node402(board.network, NODE)
        set_up(node)
        node.nmt.state = "OPERATIONAL"
        node.op_mode = "PROFILED POSITION"
        node.state = "OPERATION ENABLED"
        logs.append(board.bus_log)
    assert logs[0] == logs[1]
