"""The canopen library's own CiA 402 node, unmodified, moves an axis of the embedded board."""

import io
import math

import pytest
from canopen.objectdictionary import eds
from canopen.profiles.p402 import BaseNode402

from controller.backend import Kernel
from host.embedded import EmbeddedBoard
from host.robots import load_robot
from protocol.cia402 import Status
from protocol.eds import render_eds

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
