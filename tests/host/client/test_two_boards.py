"""The canopen library's own CiA 402 nodes on all axes of two emulated boards on one bus."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.simulation import Simulation
from steptwin.host.twin.embedded.embedded_network import EmbeddedNetwork
from steptwin.protocol import od
from steptwin.protocol.cia402 import Status
from steptwin.protocol.homing_methods import HOME_HERE
from steptwin.protocol.timer import COUNTS_PER_SECOND
from tests.emulator.pins import WIRES
from tests.host.client.machines import STEP
from tests.host.client.other_masters import Node402, enable, node402, set_up

AXES = 8
FIRST_NODES = (0x10, 0x18)
NODES = range(0x10, 0x20)


@pytest.fixture
def simulation(fast_kernel: Kernel) -> Simulation:
    boards = [Board(BoardConfig((WIRES,) * AXES, first_node_id=node), fast_kernel) for node in FIRST_NODES]
    made = Simulation(boards, Bus(1_000_000))
    made.run_until(COUNTS_PER_SECOND // 100)
    return made


@pytest.fixture
def network(simulation: Simulation) -> EmbeddedNetwork:
    return EmbeddedNetwork(simulation)


@pytest.fixture
def nodes(network: EmbeddedNetwork) -> list[Node402]:
    """All axes in OPERATION ENABLED."""
    made = [node402(network, node_id) for node_id in NODES]
    for node in made:
        set_up(node)
    network.nmt.state = "OPERATIONAL"
    for node in made:
        enable(node)
    return made


def wait(simulation: Simulation, dt_ms: int) -> None:
    simulation.run_until(simulation.now_counts + dt_ms * COUNTS_PER_SECOND // 1000)


def driver_positions(simulation: Simulation) -> list[int]:
    """Return the drivers' own counters in steps, in the order of the node ids."""
    return [board.trace(axis).position_steps for board in simulation.boards for axis in range(AXES)]


def distance(node: Node402) -> int:
    """Return an axis' distance in steps, or its speed in steps/s: different for each axis, every second one backwards.

    Multiples of 125 steps/s are whole numbers of the velocity's unit on the wire.
    """
    return (-1 if node.id % 2 else 1) * 125 * (node.id - NODES[0] + 1)


@pytest.mark.slow
def test_all_axes_are_enabled_and_homed_where_they_stand(simulation: Simulation, nodes: list[Node402]) -> None:
    for node in nodes:
        node.write(od.HOMING_METHOD, HOME_HERE)
        node.write(od.HOME_OFFSET, distance(node) * STEP)
    for node in nodes:
        assert node.homing()  # type: ignore[no-untyped-call]
    for node in nodes:
        assert node.state == "OPERATION ENABLED"
        assert node.read(od.POSITION_ACTUAL) == distance(node) * STEP
    assert driver_positions(simulation) == [0] * len(NODES)


@pytest.mark.slow
def test_all_axes_change_modes(nodes: list[Node402]) -> None:
    for mode in ("PROFILED POSITION", "HOMING", "INTERPOLATED POSITION", "PROFILED VELOCITY", "PROFILED POSITION"):
        for node in nodes:
            node.op_mode = mode
        assert [node.op_mode for node in nodes] == [mode] * len(NODES)
    assert {node.state for node in nodes} == {"OPERATION ENABLED"}


@pytest.mark.slow
def test_all_axes_move_by_profile_position(simulation: Simulation, nodes: list[Node402]) -> None:
    for node in nodes:
        node.op_mode = "PROFILED POSITION"
        node.write(od.TARGET_POSITION, distance(node) * STEP)
        node.controlword = 0x1F
        assert not node.read(od.STATUSWORD) & Status.TARGET_REACHED
    wait(simulation, 2000)
    assert all(node.statusword & Status.TARGET_REACHED for node in nodes)
    assert [node.read(od.POSITION_ACTUAL) for node in nodes] == [distance(node) * STEP for node in nodes]
    assert driver_positions(simulation) == [distance(node) for node in nodes]


@pytest.mark.slow
def test_all_axes_move_by_profile_velocity(simulation: Simulation, nodes: list[Node402]) -> None:
    for node in nodes:
        node.op_mode = "PROFILED VELOCITY"
        node.write(od.TARGET_VELOCITY, distance(node) * STEP)
    wait(simulation, 1000)
    assert [node.read(od.VELOCITY_ACTUAL) for node in nodes] == [distance(node) * STEP for node in nodes]
    before = driver_positions(simulation)
    wait(simulation, 1000)
    moved = [now - then for now, then in zip(driver_positions(simulation), before, strict=True)]
    assert moved == pytest.approx([distance(node) for node in nodes], abs=1)
    for node in nodes:
        node.write(od.TARGET_VELOCITY, 0)
    wait(simulation, 500)
    assert all(node.statusword & Status.ZERO_SPEED for node in nodes)


@pytest.mark.slow
def test_one_sync_sets_all_axes_of_both_boards_going(
    simulation: Simulation, network: EmbeddedNetwork, nodes: list[Node402]
) -> None:
    """The library's PDOs send the same record to all axes, and all make the same edges."""
    for node in nodes:
        node.op_mode = "INTERPOLATED POSITION"
        record, controlword = node.rpdo[4], node.rpdo[2]
        for variable, value in zip(record.map, (50 * STEP, 0, 100, 0), strict=True):
            variable.raw = value
        record.transmit()
        controlword.map[0].raw = 0x1F
        controlword.transmit()
    assert driver_positions(simulation) == [0] * len(NODES)
    network.sync.transmit()
    wait(simulation, 150)
    assert driver_positions(simulation) == [50] * len(NODES)
    rises = {tuple(board.trace(axis).clk_rise_counts) for board in simulation.boards for axis in range(AXES)}
    assert len(rises) == 1


@pytest.mark.slow
def test_process_data_of_all_axes_arrive(simulation: Simulation, nodes: list[Node402]) -> None:
    """TPDO3 comes every 100 ms and reports the free places of each queue."""
    arrived: dict[int, list[int]] = {node.id: [] for node in nodes}
    for node in nodes:
        node.tpdo[3].add_callback(lambda pdo, node_id=node.id: arrived[node_id].append(pdo.map[1].raw))
    wait(simulation, 1050)
    for node in nodes:
        assert len(arrived[node.id]) in (10, 11)
        assert set(arrived[node.id]) == {node.read(od.PVT_FREE_RECORDS)}
