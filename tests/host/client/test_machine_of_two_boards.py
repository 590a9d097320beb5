"""One machine of sixteen axes on two boards: it starts, halts and ends as one."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.simulation import Simulation
from steptwin.host.client import Machine, StreamedMotion
from steptwin.host.client.pausing import pause_trajectory, resume_trajectory
from steptwin.host.twin.embedded.embedded_network import EmbeddedNetwork
from tests.emulator.pins import WIRES
from tests.host.client.machines import SETTINGS, STEP, TH1, still, travelling

AXES = 8
MOVING = (TH1, 13)


class TwoBoards:
    """A Link to two boards on one bus."""

    held_up_s = 0.0

    def __init__(self, kernel: Kernel) -> None:
        boards = [Board(BoardConfig((WIRES,) * AXES, first_node_id=node), kernel) for node in (0x10, 0x18)]
        self.simulation = Simulation(boards, Bus(1_000_000))
        self.network = EmbeddedNetwork(self.simulation)
        self.wait(0.01)

    def now_s(self) -> float:
        return self.simulation.now_s

    def wait(self, dt_s: float) -> None:
        self.network.wait(dt_s)


@pytest.fixture
def link(fast_kernel: Kernel) -> TwoBoards:
    return TwoBoards(fast_kernel)


@pytest.mark.slow
def test_it_starts_halts_and_ends_together(link: TwoBoards) -> None:
    """Each board ramps down by itself, here in the same time, because the same axis moves on both."""
    machine = Machine(link, tuple(f"axis {i}" for i in range(2 * AXES)))
    machine.connect()
    machine.configure((SETTINGS,) * (2 * AXES))
    machine.enable()
    machine.preset([0] * (2 * AXES))
    records = list(still(101, 20)[:1] * (2 * AXES))
    for axis in MOVING:
        records[axis] = travelling(101)[TH1]
    run = machine.start(StreamedMotion(tuple(records), [0] * (2 * AXES)))
    machine.wait(0.5)
    assert pause_trajectory(machine)
    rest_units = machine.positions_units()
    assert rest_units[TH1] == pytest.approx(rest_units[13], abs=3 * 4 * STEP)
    machine.wait(10.0)
    assert machine.positions_units() == rest_units
    resume_trajectory(machine)
    machine.wait(3.0)
    assert run.ended
    end_units = [100 * 80 * STEP if axis in MOVING else 0 for axis in range(2 * AXES)]
    assert machine.positions_units() == end_units
    machine.disable()
    machine.disconnect()
