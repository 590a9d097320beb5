"""Virtual time: answers have arrived when `send` returns, and a bus that is always busy ends in an error."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.simulation import BusOverloadError, Simulation
from steptwin.protocol.frame import Frame
from tests.emulator.pins import WIRES
from tests.emulator.simulations import SECOND
from tests.messages import refusing


def heartbeat(axis: int, period_ms: int) -> Frame:
    """Return the SDO request that writes the producer heartbeat time (1017h)."""
    return Frame(0x610 + axis, bytes.fromhex("2b171000") + period_ms.to_bytes(4, "little"))


def simulation_of_eight(kernel: Kernel) -> Simulation:
    return Simulation([Board(BoardConfig((WIRES,) * 8), kernel)], Bus(125_000))


def send_all(simulation: Simulation, frames: list[Frame]) -> None:
    for frame in frames:
        simulation.send(frame)


def test_answers_have_arrived_when_send_returns(fast_kernel: Kernel) -> None:
    simulation = simulation_of_eight(fast_kernel)
    heard: list[Frame] = []
    simulation.host.receive = lambda frame, _: heard.append(frame)
    simulation.run_until(SECOND // 100)
    heard.clear()
    simulation.send(Frame(0x610, bytes.fromhex("4000100000000000")))
    assert heard == [Frame(0x590, bytes.fromhex("4300100092010400"))]


@pytest.mark.slow
@pytest.mark.parametrize("boards", [1, 2])
def test_the_frames_of_two_boards_may_be_too_many_where_those_of_one_are_not(fast_kernel: Kernel, boards: int) -> None:
    """Heartbeats of 6 ms: 1333 frames a second from each board."""
    config = [BoardConfig((WIRES,) * 8, first_node_id=0x10 + 8 * number) for number in range(boards)]
    simulation = Simulation([Board(c, fast_kernel) for c in config], Bus(125_000))
    simulation.run_until(SECOND // 100)
    requests = [heartbeat(axis, period_ms=6) for axis in range(8 * boards)]
    if boards == 1:
        send_all(simulation, requests)
    else:
        with refusing(BusOverloadError):
            send_all(simulation, requests)


@pytest.mark.slow
def test_nodes_that_fill_the_bus_by_themselves_are_no_endless_wait(fast_kernel: Kernel) -> None:
    """Eight heartbeats of 2 ms are 4000 frames a second; 125 kbit/s carry about 2300 so short ones."""
    simulation = simulation_of_eight(fast_kernel)
    simulation.run_until(SECOND // 100)
    with refusing(BusOverloadError):
        send_all(simulation, [heartbeat(axis, period_ms=2) for axis in range(8)])
    assert simulation.now_s < 2
    simulation.run_until(2 * SECOND)
    assert simulation.now_counts == 2 * SECOND
