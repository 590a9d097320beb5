"""The canopen library's own CiA 402 node, unmodified, moves an axis of the embedded board."""

import io
import math

import pytest
from canopen.objectdictionary import eds
from canopen.profiles.p402 import BaseNode402

from steptwin.controller.backend import Kernel
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded_board import EmbeddedBoard
from steptwin.protocol.cia402 import ErrorCode, Status
from steptwin.protocol.eds import render_eds

NODE = 0x13
STEP = 1024
"""Units of a step at 16 microsteps."""


@pytest.fixture
def board(fast_kernel: Kernel) -> EmbeddedBoard:
    return EmbeddedBoard(load_robot("warehouse-scara"), [0.0, 0.0, 100.0, 0.0, 60.0, 30.0], fast_kernel)


@pytest.fixture
def node(board: EmbeddedBoard) -> BaseNode402:
    """A node in OPERATION ENABLED.

    The library waits in a thread for a TPDO that it takes for periodic. Simulated time stands still meanwhile, so it is
    given no TPDO with the statusword and reads that by SDO.
    """
    dictionary = eds.import_eds(io.StringIO(render_eds()), NODE)  # type: ignore[no-untyped-call]
    node = BaseNode402(NODE, dictionary)  # type: ignore[no-untyped-call]
    board.network.add_node(node)
    node.nmt.state = "PRE-OPERATIONAL"
    node.sdo[0x1800][1].raw = 1 << 31 | 0x180 + NODE
    node.setup_402_state_machine()  # type: ignore[no-untyped-call]
    node.nmt.state = "OPERATIONAL"
    for state in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED"):
        node.state = state
    return node


def test_profile_position(board: EmbeddedBoard, node: BaseNode402) -> None:
    before = board.driver_positions()
    assert node.is_op_mode_supported("PROFILED POSITION")  # type: ignore[no-untyped-call]
    node.op_mode = "PROFILED POSITION"
    assert node.op_mode == "PROFILED POSITION"
    node.sdo[0x607A].raw = 750 * STEP
    node.controlword = 0x1F
    assert node.statusword & Status.SETPOINT_ACKNOWLEDGED
    node.controlword = 0x0F
    assert not node.statusword & Status.TARGET_REACHED
    board.wait(2.0)
    assert node.statusword & Status.TARGET_REACHED
    assert node.sdo[0x6064].raw == 750 * STEP
    moved = [now - then for now, then in zip(board.driver_positions(), before, strict=True)]
    assert moved == [0, 0, 0, 750, 0, 0]


def test_profile_velocity(board: EmbeddedBoard, node: BaseNode402) -> None:
    node.op_mode = "PROFILED VELOCITY"
    node.sdo[0x60FF].raw = -1000 * STEP
    board.wait(1.0)
    assert node.statusword & Status.TARGET_REACHED
    assert node.sdo[0x606C].raw == -1000 * STEP
    node.sdo[0x60FF].raw = 0
    board.wait(1.0)
    assert node.statusword & Status.ZERO_SPEED


@pytest.mark.parametrize("period_ms", [1, 10])
def test_cyclic_synchronous_position(board: EmbeddedBoard, node: BaseNode402, period_ms: int) -> None:
    """Half a turn there and back by RPDO3 and SYNC, with what a host needs to know of its own."""
    before = board.driver_positions()
    assert node.is_op_mode_supported("CYCLIC SYNCHRONOUS POSITION")  # type: ignore[no-untyped-call]
    node.sdo[0x60C2][1].raw = period_ms
    node.op_mode = "CYCLIC SYNCHRONOUS POSITION"
    assert node.op_mode == "CYCLIC SYNCHRONOUS POSITION"
    start = node.sdo[0x6062].raw
    node.rpdo.read()  # type: ignore[no-untyped-call]
    target = node.rpdo[3]
    cycles = 1000 // period_ms
    begin_s, farthest = board.now_s(), 0
    for i in range(cycles + 5):
        board.wait(begin_s + i * period_ms / 1000 - board.now_s())
        turned = (1 - math.cos(2 * math.pi * min(i, cycles) / cycles)) / 2
        target[0x607A].raw = start + round(1600 * STEP * turned)
        target.transmit()
        board.network.sync.transmit()
        farthest = max(farthest, *(now - then for now, then in zip(board.driver_positions(), before, strict=True)))
        if i == cycles // 2:
            assert node.statusword & Status.FOLLOWS_COMMAND
    assert farthest == pytest.approx(1600, abs=1)
    assert board.driver_positions() == before
    assert node.sdo[0x6064].raw == start
    assert node.state == "OPERATION ENABLED"
    node.op_mode = "PROFILED POSITION"
    assert not node.statusword & Status.FOLLOWS_COMMAND


def homing_node(node: BaseNode402, method: int) -> BaseNode402:
    """Told to home th1, which has limit switches at -125 and 125 deg."""
    node.sdo[0x6098].raw = method
    node.sdo[0x6099][1].raw = 4000 * STEP
    node.sdo[0x6099][2].raw = 400 * STEP
    node.sdo[0x609A].raw = 40_000 * STEP
    node.sdo[0x607C].raw = -5000 * STEP
    return node


@pytest.mark.parametrize("method", [17, 37])
def test_homing(board: EmbeddedBoard, node: BaseNode402, method: int) -> None:
    """It takes "attained" for the end and sets the mode at once, which a moving axis would refuse."""
    node.op_mode = "PROFILED POSITION"
    zero = board.driver_positions()[3]
    assert not node.is_homed(restore_op_mode=True)  # type: ignore[no-untyped-call]
    assert homing_node(node, method).homing(restore_op_mode=True)  # type: ignore[no-untyped-call]
    assert node.op_mode == "PROFILED POSITION"
    edge = zero if method == 37 else round(-125 * 400 / 9) + 1
    assert board.driver_positions()[3] - node.sdo[0x6064].raw // STEP == edge + 5000
    assert node.is_homed(restore_op_mode=True)  # type: ignore[no-untyped-call]


def test_homing_that_fails(board: EmbeddedBoard, node: BaseNode402) -> None:
    """th1 has no home switch: the search ends at the positive limit switch."""
    assert not homing_node(node, 20).homing()  # type: ignore[no-untyped-call]
    board.wait(0.5)
    assert node.statusword & Status.HOMING_ERROR
    assert node.emcy.log[-1].code == ErrorCode.HOMING_FAILED
    assert node.state == "OPERATION ENABLED"
