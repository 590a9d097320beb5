"""Boards whose crystals are off: their edges come early or late by so many ppm, two of them part, nothing else changes.

The expected instants come from rational numbers, not from the clock's own conversions.
"""

from collections.abc import Sequence
from fractions import Fraction
from math import ceil, floor
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.board.drifting_board import DriftingBoard, make_board
from steptwin.emulator.board.local_clock import CRYSTAL_PPM_MAX, LocalClock
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.simulation import Simulation
from steptwin.protocol import od
from steptwin.protocol.cia402 import AbortConnection, State
from steptwin.protocol.frame import COB_SYNC, Frame
from steptwin.protocol.pvt import PvtRecord
from tests.emulator.pins import WIRES
from tests.emulator.simulations import MS, SECOND, STEP, wait
from tests.messages import refusing
from tests.one_example import one_example
from tests.operations import BoardOff, EmergencyStop, WatchdogReset

NODES = 0x10, 0x12
LONG = [PvtRecord((-1) ** i * 40 * STEP, 0, 100, i) for i in range(8)]
PPMS = st.integers(-CRYSTAL_PPM_MAX, CRYSTAL_PPM_MAX)


class Run(NamedTuple):
    """What 0.8 s of the same motion on all boards leave behind."""

    simulation: Simulation
    sync_counts: int
    rises: list[NDArray[np.int64]]
    """Instants of the first axis' pulses on each board, in the simulation's time."""

    @property
    def bus(self) -> list[tuple[int, Frame]]:
        bus = self.simulation.bus
        return list(zip(bus.log_counts, bus.log_frames, strict=True))


def boards_of(kernel: Kernel, ppms: Sequence[int]) -> list[Board]:
    return [
        make_board(BoardConfig((WIRES,) * 2, node, crystal_ppm=ppm), kernel)
        for node, ppm in zip(NODES, ppms, strict=False)
    ]


def started(boards: Sequence[Board]) -> tuple[Simulation, int]:
    """Let boards that are on for 0.2 s begin the motion with one SYNC; return its instant as well."""
    simulation = Simulation(boards, Bus(1_000_000))
    simulation.run_until(SECOND // 5)
    simulation.send(Frame(0x000, b"\x01\x00"))
    for node in sorted(board.config.first_node_id for board in boards):
        for word in (0x06, 0x07, 0x0F):
            simulation.send(Frame(0x200 + node, bytes((word, 0, 7))))
        for record in LONG:
            simulation.send(Frame(0x500 + node, record.encode()))
        simulation.send(Frame(0x300 + node, b"\x1f\x00"))
    simulation.send(Frame(COB_SYNC, b""))
    return simulation, simulation.bus.log_counts[simulation.bus.log_frames.index(Frame(COB_SYNC, b""))]


def rises_of(board: Board) -> NDArray[np.int64]:
    rises = board.trace(0).clk_rise_counts
    return rises if board.own_clock is None else board.own_clock.instants(rises)


def run(kernel: Kernel, *ppms: int) -> Run:
    simulation, sync_counts = started(boards_of(kernel, ppms))
    wait(simulation, 850)
    return Run(simulation, sync_counts, [rises_of(board) for board in simulation.boards])


def expected(exact: Run, ppm: int) -> list[int]:
    """Return the instants at which a drifting board makes the edges of one that is exact.

    Its motion begins with the first of its own ticks after the SYNC.
    """
    begin = -(-exact.sync_counts // TICK_COUNTS) * TICK_COUNTS
    rate = 1 + Fraction(ppm, 1_000_000)
    own_begin = ceil(Fraction(floor(exact.sync_counts * rate), TICK_COUNTS)) * TICK_COUNTS
    return [ceil((own_begin + rise - begin) / rate) for rise in exact.rises[0].tolist()]


@pytest.fixture(scope="module")
def exact(fast_kernel: Kernel) -> Run:
    return run(fast_kernel, 0)


@pytest.fixture(scope="module")
def parting(fast_kernel: Kernel) -> Run:
    return run(fast_kernel, 100, -100)


@pytest.mark.parametrize("ppm", [100, -100, CRYSTAL_PPM_MAX, -CRYSTAL_PPM_MAX, 1])
def test_edges_come_at_scaled_instants(ppm: int, exact: Run, fast_kernel: Kernel) -> None:
    one = run(fast_kernel, ppm)
    assert one.sync_counts == exact.sync_counts
    assert one.rises[0].tolist() == expected(exact, ppm)
    assert len(one.rises[0]) == 320


def test_two_boards_part_as_computed(parting: Run, exact: Run) -> None:
    """By 200 ppm: 0.16 ms in the 0.8 s of the motion, beside the tick with which each begins."""
    assert [rises.tolist() for rises in parting.rises] == [
        _later(expected(exact, ppm), exact, parting, ppm) for ppm in (100, -100)
    ]
    gaps = parting.rises[1] - parting.rises[0]
    elapsed = int(exact.rises[0][-1] - exact.rises[0][0])
    assert gaps[-1] - gaps[0] == pytest.approx(elapsed * 200e-6, abs=2)


def _later(instants: list[int], exact: Run, other: Run, ppm: int) -> list[int]:
    """Return the expected instants for a run whose SYNC came later."""
    shifted = exact._replace(sync_counts=other.sync_counts)
    begin = [-(-each.sync_counts // TICK_COUNTS) * TICK_COUNTS for each in (exact, other)]
    assert len(instants) == 320
    return expected(shifted._replace(rises=[exact.rises[0] + begin[1] - begin[0]]), ppm)


@pytest.mark.slow
def test_boards_that_drift_need_not_be_asked_in_order(parting: Run, fast_kernel: Kernel) -> None:
    """The same run again gives the same bytes, and so does the other order of the boards."""
    again = run(fast_kernel, 100, -100)
    assert again.bus == parting.bus
    assert all(map(np.array_equal, again.rises, parting.rises))
    simulation, _ = started(boards_of(fast_kernel, (100, -100))[::-1])
    wait(simulation, 850)
    assert list(simulation.bus.log_counts) == list(parting.simulation.bus.log_counts)
    assert all(map(np.array_equal, map(rises_of, simulation.boards), parting.rises[::-1]))


def test_a_clock_of_its_own_that_is_exact_changes_nothing(exact: Run, fast_kernel: Kernel) -> None:
    boards = [DriftingBoard(board.config, fast_kernel) for board in boards_of(fast_kernel, (0, 0))]
    simulation, _ = started(boards)
    wait(simulation, 850)
    plain = run(fast_kernel, 0, 0)
    assert all(type(board) is Board for board in plain.simulation.boards)
    assert list(zip(simulation.bus.log_counts, simulation.bus.log_frames, strict=True)) == plain.bus
    assert all(map(np.array_equal, map(rises_of, boards), plain.rises))
    assert len(exact.rises[0]) == len(plain.rises[1]) == 320


def test_nothing_is_lost_on_the_bus(parting: Run) -> None:
    assert parting.simulation.bus.error_frames == 0
    emergencies = [frame for frame in parting.simulation.bus.log_frames if 0x081 <= frame.cob_id <= 0x0FF]
    assert emergencies == []
    assert all(counts <= after for (counts, _), (after, _) in zip(parting.bus, parting.bus[1:], strict=False))


@pytest.mark.parametrize("ppm", [137, -993])
def test_bus_off_stops_a_board_that_drifts(fast_kernel: Kernel, ppm: int) -> None:
    simulation, _ = started(boards_of(fast_kernel, (ppm, 0)))
    wait(simulation, 300)
    simulation.operate(BoardOff(), 0)
    assert simulation.boards[0].firmware.nodes[0].drive.state is State.FAULT_REACTION_ACTIVE
    wait(simulation, 300)
    assert not simulation.boards[0].moving
    assert simulation.boards[1].moving


@pytest.mark.parametrize("ppm", [CRYSTAL_PPM_MAX, -CRYSTAL_PPM_MAX])
def test_heartbeats_come_by_the_boards_clock(ppm: int, fast_kernel: Kernel) -> None:
    simulation = Simulation(boards_of(fast_kernel, (ppm,)), Bus(1_000_000))
    simulation.run_until(10 * MS)
    index = len(simulation.bus.log_frames)
    simulation.send(Frame(0x600 + NODES[0], bytes.fromhex("2b17100064000000")))  # producer heartbeat time: 100 ms
    wait(simulation, 3000)
    log = zip(simulation.bus.log_counts[index:], simulation.bus.log_frames[index:], strict=True)
    _, *beats = (counts for counts, frame in log if frame.cob_id == 0x710)  # the first waits for the answer
    assert len(beats) >= 28
    assert beats[-1] - beats[0] == pytest.approx((len(beats) - 1) * 100 * MS / (1 + ppm / 1e6), abs=2)


def test_faults_strike_a_board_that_drifts(fast_kernel: Kernel) -> None:
    """Emergency stop, bus-off and reset in motion: the board answers as any, and starts again by its own clock."""
    simulation, _ = started(boards_of(fast_kernel, (137, -993)))
    wait(simulation, 300)
    for node in simulation.boards[1].firmware.nodes:
        node.dictionary.set(od.ABORT_CONNECTION_OPTION, AbortConnection.NO_ACTION)
    simulation.operate(EmergencyStop(pressed=True), 0)
    simulation.operate(BoardOff(), 1)
    wait(simulation, 100.001)
    assert not simulation.boards[0].moving
    assert simulation.boards[1].moving
    assert simulation.boards[1].can.on_bus
    simulation.operate(WatchdogReset(), 1)
    now = simulation.now_counts
    wait(simulation, 50)
    assert not simulation.boards[1].moving
    assert rises_of(simulation.boards[1]).max() <= now
    simulation.power_cycle(0)
    wait(simulation, 50)
    emergencies = [frame.cob_id for frame in simulation.bus.log_frames if frame.data[:2] == b"\x00\x90"]
    assert 0x090 in emergencies
    boots = [frame.cob_id for frame in simulation.bus.log_frames if frame.data == b"\0" and frame.cob_id > 0x700]
    assert boots[4:] == [0x712, 0x713, 0x710, 0x711]


@pytest.mark.parametrize("ppm", [CRYSTAL_PPM_MAX + 1, -CRYSTAL_PPM_MAX - 1])
def test_what_is_no_crystal_is_refused(ppm: int) -> None:
    with refusing(ValueError):
        BoardConfig((WIRES,), crystal_ppm=ppm)


class TestClock:
    @pytest.mark.slow
    @given(PPMS, st.integers(0, 1 << 55))
    def test_an_instant_is_the_first_at_which_the_board_has_counted_so_far(self, ppm: int, local_counts: int) -> None:
        clock = LocalClock(ppm)
        instant = clock.instant(local_counts)
        assert clock.local_counts(instant) >= local_counts
        assert instant == 0 or clock.local_counts(instant - 1) < local_counts
        assert clock.instants(np.array([local_counts])).tolist() == [instant]

    @pytest.mark.slow
    @given(PPMS, st.lists(st.integers(0, 1 << 50), min_size=1, max_size=10))
    def test_time_never_goes_back(self, ppm: int, instants: list[int]) -> None:
        clock = LocalClock(ppm)
        local = [clock.enter(counts) for counts in instants]
        assert local == sorted(local)
        assert local[-1] == floor(max(instants) * (1 + Fraction(ppm, 1_000_000)))


@pytest.mark.parametrize("ppm", [-CRYSTAL_PPM_MAX, -1, 0, 100, CRYSTAL_PPM_MAX])
def test_some_instants_of_a_clock(ppm: int) -> None:
    for local_counts in (0, 1, 10_001, 1 << 55):
        instant = TestClock.test_an_instant_is_the_first_at_which_the_board_has_counted_so_far
        one_example(instant, TestClock(), ppm, local_counts)
    one_example(TestClock.test_time_never_goes_back, TestClock(), ppm, [1 << 40, 7, 1 << 50, (1 << 50) - 1])
