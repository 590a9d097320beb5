"""The canopen library's LSS master against the emulated board: an independent master finds and numbers the axes."""

from types import SimpleNamespace

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.simulation import Simulation
from steptwin.host.common.errors import BusError
from steptwin.host.twin.embedded.embedded_network import EmbeddedNetwork
from steptwin.protocol.timer import COUNTS_PER_SECOND
from tests.emulator.pins import WIRES
from tests.host.client.other_masters import enable, node402, set_up
from tests.messages import refusing
from tests.operations import HostBitRate

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


def test_a_master_changes_the_bit_rate_and_follows(network: EmbeddedNetwork, simulation: Simulation) -> None:
    """Each axis answers at the new rate, and again after a power cycle."""
    assert network.lss.send_switch_state_selective(VENDOR, PRODUCT, REVISION, 0x11)  # type: ignore[no-untyped-call]
    network.lss.configure_bit_timing(2)  # type: ignore[no-untyped-call]
    network.lss.store_configuration()  # type: ignore[no-untyped-call]
    network.lss.activate_bit_timing(20)  # type: ignore[no-untyped-call]
    simulation.run_until(simulation.now_counts + COUNTS_PER_SECOND // 40)
    simulation.operate(HostBitRate(500_000))
    simulation.run_until(simulation.now_counts + COUNTS_PER_SECOND // 40)
    begin, frames = simulation.now_counts, simulation.bus.frames
    for node_id in (0x10, 0x11, 0x12):
        assert node402(network, node_id).sdo[0x1018][4].raw == node_id
    assert simulation.bus.error_frames == 0
    bits = (simulation.now_counts - begin) / 144
    assert 108 <= bits / (simulation.bus.frames - frames) <= 135  # eight bytes at 500 kbit/s, stuffing included
    simulation.power_cycle(0)
    simulation.run_until(simulation.now_counts + COUNTS_PER_SECOND // 10)
    assert node402(network, 0x12).sdo[0x1018][4].raw == 0x12


@pytest.mark.slow
def test_a_master_with_the_old_bit_rate_reaches_nobody(network: EmbeddedNetwork, simulation: Simulation) -> None:
    network.lss.send_switch_state_global(network.lss.CONFIGURATION_STATE)  # type: ignore[no-untyped-call]
    network.lss.configure_bit_timing(4)  # type: ignore[no-untyped-call]
    network.lss.activate_bit_timing(10)  # type: ignore[no-untyped-call]
    simulation.run_until(simulation.now_counts + COUNTS_PER_SECOND // 10)
    with refusing(BusError):
        node402(network, 0x11).sdo[0x1018][4].raw  # noqa: B018
    simulation.operate(HostBitRate(125_000))
    assert node402(network, 0x11).sdo[0x1018][4].raw == 0x11
