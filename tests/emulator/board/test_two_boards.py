"""Two boards on one bus: one clock, one SYNC, frames for each other, and neither board ahead of the other."""

import numpy as np
import pytest
from numpy.typing import NDArray

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.simulation import Simulation
from steptwin.protocol import od
from steptwin.protocol.frame import COB_SYNC, Frame
from steptwin.protocol.pvt import PvtRecord
from tests.emulator.pins import WIRES
from tests.emulator.simulations import MS, STEP, wait, write
from tests.messages import refusing

FIRST, SECOND = 0x10, 0x12
RPDO1_COB_ID = od.address_of(od.RPDO_COMMUNICATION[0], od.PDO_COB_ID)


def simulation_of(kernel: Kernel, *first_nodes: int) -> Simulation:
    """Boards of two axes each, after they have announced themselves."""
    boards = [Board(BoardConfig((WIRES,) * 2, first_node_id=node), kernel) for node in first_nodes]
    made = Simulation(boards, Bus(1_000_000))
    made.run_until(10 * MS)
    return made


@pytest.fixture
def simulation(fast_kernel: Kernel) -> Simulation:
    return simulation_of(fast_kernel, FIRST, SECOND)


def start(simulation: Simulation, motions: dict[int, list[PvtRecord]]) -> int:
    """Enable nodes, give them records, start them with one SYNC; return the tick with which they begin, in counts."""
    simulation.send(Frame(0x000, b"\x01\x00"))
    for node, records in motions.items():
        for word in (0x06, 0x07, 0x0F):
            simulation.send(Frame(0x200 + node, bytes((word, 0, 7))))
        for record in records:
            simulation.send(Frame(0x500 + node, record.encode()))
        simulation.send(Frame(0x300 + node, b"\x1f\x00"))
    simulation.send(Frame(COB_SYNC, b""))
    sync = simulation.bus.log_counts[simulation.bus.log_frames.index(Frame(COB_SYNC, b""))]
    return -(-sync // TICK_COUNTS) * TICK_COUNTS


def sent_by(simulation: Simulation, cob_id: int) -> list[tuple[int, bytes]]:
    log = zip(simulation.bus.log_counts, simulation.bus.log_frames, strict=True)
    return [(counts, frame.data) for counts, frame in log if frame.cob_id == cob_id]


def test_every_node_of_both_announces_itself_and_answers(simulation: Simulation) -> None:
    assert {frame.cob_id for frame in simulation.bus.log_frames} == {0x710, 0x711, 0x712, 0x713}
    for node in range(0x10, 0x14):
        simulation.send(Frame(0x600 + node, bytes.fromhex("4000100000000000")))
        assert sent_by(simulation, 0x580 + node)[0][1] == bytes.fromhex("4300100092010400")


def test_one_sync_starts_both_in_the_same_tick(simulation: Simulation) -> None:
    """The same motion on both boards: the same edges, to the count."""
    there_and_back = [PvtRecord(50 * STEP, 0, 100, 0), PvtRecord(-50 * STEP, 0, 100, 1)]
    begin = start(simulation, {FIRST + 1: there_and_back, SECOND: there_and_back})
    wait(simulation, 250)
    first, second = simulation.boards[0].trace(1), simulation.boards[1].trace(0)
    assert len(first.step_counts) == len(second.step_counts) == 100
    assert np.array_equal(first.clk_rise_counts, second.clk_rise_counts)
    assert np.array_equal(first.dir_counts, second.dir_counts)
    assert begin < first.clk_rise_counts[0]
    assert len(simulation.boards[0].trace(0).step_counts) == 0


def test_a_board_that_stops_does_not_hurry_or_hold_the_other(simulation: Simulation, fast_kernel: Kernel) -> None:
    """The first board has an underrun at speed after 40 ms and reports it; the second runs as it does alone."""
    long = [PvtRecord((-1) ** i * 40 * STEP, 0, 100, i) for i in range(4)]
    starving = [PvtRecord(20 * STEP, 64 * STEP, 40, 0)]
    begin = start(simulation, {FIRST: starving, SECOND: long})
    wait(simulation, 500)
    emergencies = sent_by(simulation, 0x080 + FIRST)
    assert [data[:2] for _, data in emergencies] == [b"\x01\xff"]
    assert 0 < emergencies[0][0] - (begin + 40 * MS) < MS
    assert sent_by(simulation, 0x080 + SECOND) == []

    expected = edges_alone(fast_kernel, long)
    assert np.array_equal(simulation.boards[1].trace(0).clk_rise_counts - begin, expected)
    assert len(expected) == 160


def edges_alone(kernel: Kernel, records: list[PvtRecord]) -> NDArray[np.int64]:
    """Return the rises of the second board's first axis without another board, counted from the motion's start."""
    alone = simulation_of(kernel, SECOND)
    begin = start(alone, {SECOND: records})
    wait(alone, 500)
    return alone.boards[0].trace(0).clk_rise_counts - begin


def test_a_power_cycle_concerns_one_board_only(simulation: Simulation, fast_kernel: Kernel) -> None:
    """The first board loses its power in the middle of its motion; the second goes on and makes its own edges."""
    long = [PvtRecord((-1) ** i * 40 * STEP, 0, 100, i) for i in range(4)]
    begin = start(simulation, {FIRST: long, SECOND: long})
    wait(simulation, 50)
    now, frames = simulation.now_counts, len(simulation.bus.log_frames)
    simulation.power_cycle(0)
    wait(simulation, 500)
    boot_ups = [frame.cob_id for frame in simulation.bus.log_frames[frames:] if frame.data == b"\0"]
    assert boot_ups == [0x700 + FIRST, 0x700 + FIRST + 1]
    assert simulation.boards[0].trace(0).clk_rise_counts.max() < now
    assert not simulation.boards[0].moving
    edges = simulation.boards[1].trace(0).clk_rise_counts - begin
    assert np.array_equal(edges, edges_alone(fast_kernel, long))
    write(simulation, FIRST, od.PROFILE_ACCELERATION, 1)
    assert sent_by(simulation, 0x580 + FIRST)[-1][1] == bytes.fromhex("6083600000000000")


def test_the_order_of_the_boards_changes_nothing(fast_kernel: Kernel) -> None:
    """Nor does a second run: the same frames at the same instants, the same edges, whichever board is asked first."""
    runs = []
    for first_nodes in ((FIRST, SECOND), (SECOND, FIRST), (FIRST, SECOND)):
        simulation = simulation_of(fast_kernel, *first_nodes)
        there = [PvtRecord(30 * STEP, 0, 70, 0), PvtRecord(30 * STEP, 20 * STEP, 30, 1)]
        start(simulation, {FIRST: there, FIRST + 1: there[:1], SECOND: there[:1], SECOND + 1: there})
        wait(simulation, 300)
        by_node = sorted(simulation.boards, key=lambda board: board.config.first_node_id)
        edges = [board.trace(axis).clk_rise_counts.tolist() for board in by_node for axis in (0, 1)]
        runs.append((list(simulation.bus.log_counts), simulation.bus.log_frames, edges))
    assert runs[0] == runs[1] == runs[2]
    assert all(len(axis) >= 30 for axis in runs[0][2])


def test_boards_in_motion_never_part_by_a_tick(simulation: Simulation) -> None:
    motion = [PvtRecord(20 * STEP, 0, 50, 0)]
    start(simulation, {FIRST: motion, SECOND: motion})
    for _ in range(100):
        wait(simulation, 0.7)
        ticks = {board.firmware.motion.tick for board in simulation.boards}
        assert ticks == {-(-simulation.now_counts // TICK_COUNTS)}


def test_a_board_hears_the_other_if_its_pdos_say_so(simulation: Simulation) -> None:
    """RPDO1 of the second listens to TPDO1 of the first, which is longer than its mapping: 0x8220."""
    assert not simulation.boards[1].firmware.hears(0x180 + FIRST)
    write(simulation, SECOND, RPDO1_COB_ID, 1 << 31 | 0x180 + FIRST)
    write(simulation, SECOND, RPDO1_COB_ID, 0x180 + FIRST)
    assert simulation.boards[1].firmware.hears(0x180 + FIRST)
    simulation.send(Frame(0x000, b"\x01\x00"))
    wait(simulation, 50)
    assert len(sent_by(simulation, 0x180 + FIRST)) > 0
    assert sent_by(simulation, 0x080 + SECOND)[0][1][:2] == b"\x20\x82"
    assert simulation.boards[1].firmware.dropped_frames == 0


@pytest.mark.parametrize(("first", "axes"), [(0, 1), (127, 2), (121, 8)])
def test_node_ids_beyond_canopens_are_refused(fast_kernel: Kernel, first: int, axes: int) -> None:
    with refusing(ValueError):
        Board(BoardConfig((WIRES,) * axes, first_node_id=first), fast_kernel)
