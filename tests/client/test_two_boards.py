"""The canopen library's own CiA 402 nodes, unmodified, on two emulated boards of one bus."""

import io

import pytest
from canopen.objectdictionary import eds
from canopen.profiles.p402 import BaseNode402

from controller.backend import Kernel
from emulator.board import Board, BoardConfig
from emulator.bus import Bus
from emulator.simulation import Simulation
from host.embedded import EmbeddedNetwork
from protocol.cia402 import HOME_HERE
from protocol.eds import render_eds

NODES = (0x10, 0x20)
"""The first node of each board."""
HOME_UNITS = {0x10: 1024, 0x20: -2048}
MS = 72_000


@pytest.fixture
def simulation(fast_kernel: Kernel) -> Simulation:
    boards = [Board(BoardConfig(2, (330.0, 330.0), first_node_id=node), fast_kernel) for node in NODES]
    made = Simulation(boards, Bus(1_000_000))
    made.run_until(10 * MS)
    return made


@pytest.fixture
def nodes(simulation: Simulation) -> list[BaseNode402]:
    """The library waits in a thread for a TPDO that it takes for periodic, while simulated time stands still.

    So TPDO1 is off and the statusword is read by SDO.
    """
    network = EmbeddedNetwork(simulation)
    made = []
    for node_id in NODES:
        dictionary = eds.import_eds(io.StringIO(render_eds()), node_id)  # type: ignore[no-untyped-call]
        node = BaseNode402(node_id, dictionary)  # type: ignore[no-untyped-call]
        network.add_node(node)
        node.nmt.state = "PRE-OPERATIONAL"
        node.sdo[0x1800][1].raw = 1 << 31 | 0x180 + node_id
        node.setup_402_state_machine()  # type: ignore[no-untyped-call]
        made.append(node)
    network.nmt.state = "OPERATIONAL"
    return made


def test_nodes_of_both_boards_are_enabled_and_homed(nodes: list[BaseNode402]) -> None:
    for node in nodes:
        node.sdo[0x6098].raw = HOME_HERE
        node.sdo[0x607C].raw = HOME_UNITS[node.id]
        for state in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED"):
            node.state = state
    for node in nodes:
        assert node.homing()  # type: ignore[no-untyped-call]
    for node in nodes:
        assert node.state == "OPERATION ENABLED"
        assert node.sdo[0x6064].raw == HOME_UNITS[node.id]


def test_process_data_of_both_boards_arrive(simulation: Simulation, nodes: list[BaseNode402]) -> None:
    """TPDO3 comes every 100 ms and says how many records each queue still takes."""
    arrived: dict[int, list[int]] = {node.id: [] for node in nodes}
    for node in nodes:
        pdo = node.tpdo[3]
        pdo.add_callback(lambda pdo, node_id=node.id: arrived[node_id].append(pdo[2].raw))
    simulation.run_until(simulation.now_counts + 1000 * MS)
    for values in arrived.values():
        assert len(values) == 10
        assert len(set(values)) == 1
