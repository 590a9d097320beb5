"""The canopen library's own CiA 402 nodes, unmodified, on all axes of two emulated boards of one bus."""

import io

import pytest
from canopen.objectdictionary import eds
from canopen.profiles.p402 import BaseNode402

from steptwin.controller.backend import Kernel
from steptwin.emulator.board import Board, BoardConfig
from steptwin.emulator.bus import Bus
from steptwin.emulator.simulation import Simulation
from steptwin.host.twin.embedded_network import EmbeddedNetwork
from steptwin.protocol.cia402 import Status
from steptwin.protocol.eds import render_eds
from steptwin.protocol.homing_methods import HOME_HERE

AXES = 8
FIRST_NODES = (0x10, 0x18)
NODES = range(0x10, 0x20)
MS = 72_000
STEP = 1024
"""Units of a step at 16 microsteps."""


class Node(BaseNode402):
    """As it comes, with an id that is known to be a number."""

    id: int


@pytest.fixture
def simulation(fast_kernel: Kernel) -> Simulation:
    boards = [Board(BoardConfig(AXES, (330.0,) * AXES, first_node_id=node), fast_kernel) for node in FIRST_NODES]
    made = Simulation(boards, Bus(1_000_000))
    made.run_until(10 * MS)
    return made


@pytest.fixture
def network(simulation: Simulation) -> EmbeddedNetwork:
    return EmbeddedNetwork(simulation)


@pytest.fixture
def nodes(network: EmbeddedNetwork) -> list[Node]:
    """All axes in OPERATION ENABLED.

    The library waits in a thread for a TPDO that it takes for periodic, while simulated time stands still. So TPDO1 is
    off and the statusword is read by SDO.
    """
    text = render_eds()
    made = []
    for node_id in NODES:
        node = Node(node_id, eds.import_eds(io.StringIO(text), node_id))  # type: ignore[no-untyped-call]
        network.add_node(node)
        node.nmt.state = "PRE-OPERATIONAL"
        node.sdo[0x1800][1].raw = 1 << 31 | 0x180 + node_id
        node.setup_402_state_machine()  # type: ignore[no-untyped-call]
        made.append(node)
    network.nmt.state = "OPERATIONAL"
    for node in made:
        for state in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED"):
            node.state = state
    return made


def wait(simulation: Simulation, dt_ms: int) -> None:
    simulation.run_until(simulation.now_counts + dt_ms * MS)


def driver_positions(simulation: Simulation) -> list[int]:
    """The drivers' own counters in steps, in the order of the node ids."""
    return [board.trace(axis).position_steps for board in simulation.boards for axis in range(AXES)]


def distance(node: Node) -> int:
    """Steps to go, or to go in a second: another number for each axis, and every other one backwards.

    Multiples of 125 steps/s are whole numbers of the velocity's unit on the wire.
    """
    return (-1 if node.id % 2 else 1) * 125 * (node.id - NODES[0] + 1)


def test_all_axes_are_enabled_and_homed_where_they_stand(simulation: Simulation, nodes: list[Node]) -> None:
    for node in nodes:
        node.sdo[0x6098].raw = HOME_HERE
        node.sdo[0x607C].raw = distance(node) * STEP
    for node in nodes:
        assert node.homing()  # type: ignore[no-untyped-call]
    for node in nodes:
        assert node.state == "OPERATION ENABLED"
        assert node.sdo[0x6064].raw == distance(node) * STEP
    assert driver_positions(simulation) == [0] * len(NODES)


def test_all_axes_change_modes(nodes: list[Node]) -> None:
    for mode in ("PROFILED POSITION", "HOMING", "INTERPOLATED POSITION", "PROFILED VELOCITY", "PROFILED POSITION"):
        for node in nodes:
            node.op_mode = mode
        assert [node.op_mode for node in nodes] == [mode] * len(NODES)
    assert {node.state for node in nodes} == {"OPERATION ENABLED"}


def test_all_axes_move_by_profile_position(simulation: Simulation, nodes: list[Node]) -> None:
    for node in nodes:
        node.op_mode = "PROFILED POSITION"
        node.sdo[0x607A].raw = distance(node) * STEP
        node.controlword = 0x1F
    assert not any(node.statusword & Status.TARGET_REACHED for node in nodes)
    wait(simulation, 2000)
    assert all(node.statusword & Status.TARGET_REACHED for node in nodes)
    assert [node.sdo[0x6064].raw for node in nodes] == [distance(node) * STEP for node in nodes]
    assert driver_positions(simulation) == [distance(node) for node in nodes]


def test_all_axes_move_by_profile_velocity(simulation: Simulation, nodes: list[Node]) -> None:
    for node in nodes:
        node.op_mode = "PROFILED VELOCITY"
        node.sdo[0x60FF].raw = distance(node) * STEP
    wait(simulation, 1000)
    assert [node.sdo[0x606C].raw for node in nodes] == [distance(node) * STEP for node in nodes]
    before = driver_positions(simulation)
    wait(simulation, 1000)
    moved = [now - then for now, then in zip(driver_positions(simulation), before, strict=True)]
    assert moved == pytest.approx([distance(node) for node in nodes], abs=1)
    for node in nodes:
        node.sdo[0x60FF].raw = 0
    wait(simulation, 500)
    assert all(node.statusword & Status.ZERO_SPEED for node in nodes)


def test_one_sync_sets_all_axes_of_both_boards_going(
    simulation: Simulation, network: EmbeddedNetwork, nodes: list[Node]
) -> None:
    """Interpolated position by the library's PDOs: the same record everywhere makes the same edges everywhere."""
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


def test_process_data_of_all_axes_arrive(simulation: Simulation, nodes: list[Node]) -> None:
    """TPDO3 comes every 100 ms and says how many records each queue still takes."""
    arrived: dict[int, list[int]] = {node.id: [] for node in nodes}
    for node in nodes:
        node.tpdo[3].add_callback(lambda pdo, node_id=node.id: arrived[node_id].append(pdo.map[1].raw))
    wait(simulation, 1050)
    for node in nodes:
        assert len(arrived[node.id]) in (10, 11)
        assert set(arrived[node.id]) == {node.sdo[0x2012][2].raw}
