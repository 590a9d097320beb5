"""The canopen library's own CiA 402 node moves an axis of the embedded board."""

import math

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, Status
from tests.host.client.machines import START, STEP, TH1, WAREHOUSE
from tests.host.client.other_masters import Node402, enable, node402, set_up

NODE = 0x13


@pytest.fixture
def board(fast_kernel: Kernel) -> EmbeddedBoard:
    return EmbeddedBoard(WAREHOUSE, fast_kernel, MachineOptions(stand_at=START))


@pytest.fixture
def node(board: EmbeddedBoard) -> Node402:
    """A node in OPERATION ENABLED."""
    made = node402(board.network, NODE)
    set_up(made)
    made.nmt.state = "OPERATIONAL"
    enable(made)
    return made


def test_profile_position(board: EmbeddedBoard, node: Node402) -> None:
    before = board.driver_positions()
    assert node.is_op_mode_supported("PROFILED POSITION")  # type: ignore[no-untyped-call]
    node.op_mode = "PROFILED POSITION"
    assert node.op_mode == "PROFILED POSITION"
    node.write(od.TARGET_POSITION, 750 * STEP)
    node.controlword = 0x1F
    assert node.status() & Status.SET_POINT_ACKNOWLEDGED
    node.controlword = 0x0F
    assert not node.status() & Status.TARGET_REACHED
    board.wait(2.0)
    assert node.status() & Status.TARGET_REACHED
    assert node.read(od.POSITION_ACTUAL) == 750 * STEP
    moved = [now - then for now, then in zip(board.driver_positions(), before, strict=True)]
    assert moved == [0, 0, 0, 750, 0, 0]


def test_profile_velocity(board: EmbeddedBoard, node: Node402) -> None:
    node.op_mode = "PROFILED VELOCITY"
    node.write(od.TARGET_VELOCITY, -1000 * STEP)
    board.wait(1.0)
    assert node.status() & Status.TARGET_REACHED
    assert node.read(od.VELOCITY_ACTUAL) == -1000 * STEP
    node.write(od.TARGET_VELOCITY, 0)
    board.wait(1.0)
    assert node.status() & Status.ZERO_SPEED


@pytest.mark.slow
@pytest.mark.parametrize("period_ms", [1, 10])
def test_cyclic_synchronous_position(board: EmbeddedBoard, node: Node402, period_ms: int) -> None:
    """The axis moves half a turn and back by RPDO3 and SYNC; the host knows only the entries it reads."""
    before = board.driver_positions()
    assert node.is_op_mode_supported("CYCLIC SYNCHRONOUS POSITION")  # type: ignore[no-untyped-call]
    node.write(od.INTERPOLATION_PERIOD, period_ms)
    node.op_mode = "CYCLIC SYNCHRONOUS POSITION"
    assert node.op_mode == "CYCLIC SYNCHRONOUS POSITION"
    start = node.read(od.POSITION_DEMAND)
    node.rpdo.read()  # type: ignore[no-untyped-call]
    target = node.rpdo[3]
    cycles = 1000 // period_ms
    begin_s, farthest = board.now_s(), 0
    for i in range(cycles + 5):
        board.wait(begin_s + i * period_ms / 1000 - board.now_s())
        turned = (1 - math.cos(2 * math.pi * min(i, cycles) / cycles)) / 2
        target[od.index_and_subindex(od.TARGET_POSITION)[0]].raw = start + round(1600 * STEP * turned)
        target.transmit()
        board.network.sync.transmit()
        farthest = max(farthest, *(now - then for now, then in zip(board.driver_positions(), before, strict=True)))
        if i == cycles // 2:
            assert node.statusword & Status.FOLLOWS_COMMAND
    assert farthest == pytest.approx(1600, abs=1)
    assert board.driver_positions() == before
    assert node.read(od.POSITION_ACTUAL) == start
    assert node.state == "OPERATION ENABLED"
    node.op_mode = "PROFILED POSITION"
    assert not node.status() & Status.FOLLOWS_COMMAND


def homing_node(node: Node402, method: int) -> Node402:
    """Write homing settings for th1, which has limit switches at -125 and 125 deg."""
    node.write(od.HOMING_METHOD, method)
    node.write(od.HOMING_SEARCH_SPEED, 4000 * STEP)
    node.write(od.HOMING_ZERO_SPEED, 400 * STEP)
    node.write(od.HOMING_ACCELERATION, 40_000 * STEP)
    node.write(od.HOME_OFFSET, -5000 * STEP)
    return node


@pytest.mark.parametrize("method", [17, 37])
def test_homing(board: EmbeddedBoard, node: Node402, method: int) -> None:
    """The library sets the mode as soon as homing is attained; an axis that still moved would refuse it."""
    node.op_mode = "PROFILED POSITION"
    zero = board.driver_positions()[TH1]
    assert not node.is_homed(restore_op_mode=True)  # type: ignore[no-untyped-call]
    assert homing_node(node, method).homing(restore_op_mode=True)  # type: ignore[no-untyped-call]
    assert node.op_mode == "PROFILED POSITION"
    edge = zero if method == 37 else round(-125 * 400 / 9) + 1
    assert board.driver_positions()[TH1] - node.read(od.POSITION_ACTUAL) // STEP == edge + 5000
    assert node.is_homed(restore_op_mode=True)  # type: ignore[no-untyped-call]


def test_homing_that_fails(board: EmbeddedBoard, node: Node402) -> None:
    """th1 has no home switch: the search ends at the positive limit switch."""
    assert not homing_node(node, 20).homing()  # type: ignore[no-untyped-call]
    board.wait(0.5)
    assert node.status() & Status.HOMING_ERROR
    assert node.emcy.log[-1].code == ErrorCode.HOMING_FAILED
    assert node.state == "OPERATION ENABLED"
