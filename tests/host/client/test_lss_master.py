"""The canopen library's LSS master against the emulated board: an independent master finds and numbers the axes."""

from types import SimpleNamespace

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.simulation import Simulation
from steptwin.host.twin.embedded.embedded_network import EmbeddedNetwork
from steptwin.protocol.timer import COUNTS_PER_SECOND
from tests.emulator.pins import WIRES
from tests.host.client.other_masters import enable, node402, set_up

VENDOR, PRODUCT, REVISION = 0, 0x6560, 0x0001_0000
"""Of every axis."""
UNCONFIGURED = 0xFF


@pytest.fixture
def simulation(fast_kernel: Kernel) -> Simulation:
    made = Simulation([Board(BoardConfig((WIRES,) * 3), fast_kernel)], Bus(1_000_000))
    made.run_until(COUNTS_PER_SECOND // 100)
    return made


@pytest.fixture
def network(simulation: Simulation, monkeypatch: pytest.MonkeyPatch) -> EmbeddedNetwork:
    """A network in virtual time: answers are there when `send` returns, so the master need not wait for them."""
    monkeypatch.setattr("canopen.lss.time", SimpleNamespace(sleep=lambda _: None))
    made = EmbeddedNetwork(simulation)
    made.lss.RESPONSE_TIMEOUT = 0.001
    return made


def give(network: EmbeddedNetwork, serial: int, node_id: int) -> None:
    """Give the axis with a serial number a node id, stored, in force at once."""
    assert network.lss.send_switch_state_selective(VENDOR, PRODUCT, REVISION, serial)  # type: ignore[no-untyped-call]
    network.lss.configure_node_id(node_id)  # type: ignore[no-untyped-call]
    network.lss.store_configuration()  # type: ignore[no-untyped-call]
    network.lss.send_switch_state_global(network.lss.WAITING_STATE)  # type: ignore[no-untyped-call]
    network.nmt.send_command(0x82)


def test_fast_scan_finds_nobody_among_configured_axes(network: EmbeddedNetwork) -> None:
    assert network.lss.fast_scan() == (False, None)  # type: ignore[no-untyped-call]


def test_fast_scan_finds_all_axes_without_node_ids_one_after_another(network: EmbeddedNetwork) -> None:
    for serial in (0x10, 0x11, 0x12):
        give(network, serial, UNCONFIGURED)
    for node_id in (0x40, 0x41, 0x42):
        found, identity = network.lss.fast_scan()  # type: ignore[no-untyped-call]
        assert (found, identity) == (True, [VENDOR, PRODUCT, REVISION, node_id - 0x30])
        network.lss.configure_node_id(node_id)  # type: ignore[no-untyped-call]
        network.lss.store_configuration()  # type: ignore[no-untyped-call]
        network.lss.send_switch_state_global(network.lss.WAITING_STATE)  # type: ignore[no-untyped-call]
    assert network.lss.fast_scan() == (False, None)  # type: ignore[no-untyped-call]
    node = node402(network, 0x41)
    set_up(node)
    network.nmt.state = "OPERATIONAL"
    enable(node)
    assert node.sdo[0x1018][4].raw == 0x11


def test_a_stored_node_id_is_there_after_a_power_cycle(network: EmbeddedNetwork, simulation: Simulation) -> None:
    give(network, 0x12, 0x55)
    simulation.power_cycle(0)
    simulation.run_until(simulation.now_counts + COUNTS_PER_SECOND // 10)
    assert node402(network, 0x55).sdo[0x1018][4].raw == 0x12
