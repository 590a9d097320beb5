"""The loop of a live board on a computer that is held up at any place: what came late is not late for the board."""

import inspect
import selectors
import time
from itertools import pairwise
from typing import Final
from unittest.mock import patch

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from steptwin.controller.motion.backend import fastest_kernel
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.live.live_loop import LiveLoop
from steptwin.emulator.live.live_simulation import STALL_NS, LiveSimulation, Pacer
from steptwin.emulator.simulation import Simulation
from steptwin.protocol.frame import Frame
from steptwin.protocol.pvt import PvtRecord
from steptwin.protocol.timer import COUNTS_PER_MS
from tests.compiled import on_sources_only
from tests.emulator.pins import WIRES
from tests.one_example import one_example

pytestmark = on_sources_only
MS_NS: Final = 1_000_000
NODE: Final = 0x10
HOST: Final = 0x7F
BEAT = Frame(0x700 + HOST, b"\x05")
BEAT_MS: Final = 30
TIMEOUT_MS: Final = 45
"""Shorter by far than any stall below: only a board whose clock stands can bear it."""
EMCY: Final = 0x080 + NODE
WATCH = Frame(0x600 + NODE, bytes((0x23, 0x16, 0x10, 1, TIMEOUT_MS, 0, HOST, 0)))
SETTING_UP = [
    Frame(0x000, b"\x01\x00"),
    WATCH,
    *(Frame(0x200 + NODE, bytes((word, 0, 7))) for word in (0x06, 0x07, 0x0F)),
    *(Frame(0x500 + NODE, PvtRecord(20 * 1024, 0, 100, i).encode()) for i in range(3)),
    Frame(0x300 + NODE, b"\x1f\x00"),
    Frame(0x080, b""),
]
"""One axis watches the host and makes 20 steps in each of three records of 100 ms."""
Stall = tuple[int, int]
"""An instant and a duration, in ns of the wall clock."""


def one_axis() -> Simulation:
    return Simulation([Board(BoardConfig((WIRES,)), fastest_kernel())], Bus(1_000_000))


class Computer(selectors.SelectSelector):
    """A wall clock, and sockets that receive frames at instants; every look at the clock takes 20 us.

    At the first look after the instant of a stall, the process is held up for its duration, wherever it is.
    """

    def __init__(self, arrivals: list[tuple[int, Frame]], stalls: list[Stall], end_ns: int) -> None:
        super().__init__()
        self._arrivals = arrivals
        self._stalls = sorted(stalls)
        self._end_ns = end_ns
        self._now_ns = 0
        self.entered: list[tuple[int, Frame]] = []
        """The frames, and the counts of the board's timer at which its bus got them."""
        self.simulation = one_axis()
        self.live = LiveSimulation(self.simulation, Pacer(0))

    def clock_ns(self) -> int:
        """Let 20 us pass, and any stall that is due."""
        self._now_ns += 20_000
        while self._stalls and self._stalls[0][0] <= self._now_ns:
            self._now_ns += self._stalls.pop(0)[1]
        if self._now_ns >= self._end_ns:
            self._loop.stop()
        return self._now_ns

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Sleep until a frame has come or the time is over."""
        assert timeout is not None
        next_ns = self._arrivals[0][0] if self._arrivals else self._end_ns
        self._now_ns = max(self._now_ns, min(self._now_ns + round(timeout * 1e9), next_ns))
        looked_ns = self._now_ns
        self.clock_ns()  # a process may be held up after the operating system has looked at its sockets
        if not self._arrivals or self._arrivals[0][0] > looked_ns:
            return []
        return [(selectors.SelectorKey(0, 0, selectors.EVENT_READ, lambda: self._read(looked_ns)), 1)]

    def _read(self, until_ns: int) -> None:
        while self._arrivals and self._arrivals[0][0] <= until_ns:
            self.live.send(self._arrivals.pop(0)[1], "a client", self._loop.looked_ns)

    def run(self) -> None:
        """Run the board to the end."""
        host = self.simulation.host
        with (
            LiveLoop(self.live, self.clock_ns, self) as self._loop,
            patch.object(host, "send", wraps=host.send) as send,
        ):
            self._loop.run()
        self.entered = [(call.args[1], call.args[0]) for call in send.call_args_list]

    @property
    def seen(self) -> list[tuple[int, Frame]]:
        """All frames on the bus, with the counts at which they were valid."""
        return list(zip(self.simulation.bus.log_counts, self.simulation.bus.log_frames, strict=True))

    @property
    def errors(self) -> list[int]:
        """The counts of all EMCY frames with an error."""
        return [counts for counts, frame in self.seen if frame.cob_id == EMCY and any(frame.data[:2])]


def arrivals(beats: int) -> list[tuple[int, Frame]]:
    """The host sets the axis going while its heart beats, and goes on for some beats."""
    setting_up = [((1 + i) * MS_NS, frame) for i, frame in enumerate(SETTING_UP)]
    beating = [(3 * MS_NS + i * BEAT_MS * MS_NS, BEAT) for i in range(beats)]
    return sorted(setting_up + beating, key=lambda arrival: arrival[0])


def gaps_ms(computer: Computer) -> list[float]:
    """Return the times between the host's heartbeats on the board's clock."""
    return [(b - a) / COUNTS_PER_MS for a, b in pairwise(c for c, frame in computer.entered if frame == BEAT)]


END_NS: Final = 400 * MS_NS
STALLS = st.lists(st.tuples(st.integers(0, END_NS), st.integers(0, 3000 * MS_NS)), max_size=8)


def run(beats: int, stalls: list[Stall]) -> Computer:
    end_ns = END_NS + sum(dt_ns for _, dt_ns in stalls)
    computer = Computer(arrivals(beats), stalls, end_ns)
    computer.run()
    return computer


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(STALLS)
@example([(200 * MS_NS, 300 * MS_NS)])
@example([(i * 40 * MS_NS, STALL_NS) for i in range(8)])
@example([(i * 40 * MS_NS, STALL_NS + 1) for i in range(8)])
def test_a_host_that_lives_is_not_missed(stalls: list[Stall]) -> None:
    """Its frames come in time on the board's clock, wherever the process is held up and however long."""
    computer = run((END_NS + sum(dt_ns for _, dt_ns in stalls)) // (BEAT_MS * MS_NS) + 1, stalls)
    assert not computer.errors
    assert max(gaps_ms(computer)) <= BEAT_MS + STALL_NS / MS_NS + 1
    assert computer.simulation.boards[0].trace(0).clk_rise_counts.size == 60


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(STALLS, st.integers(2, 10))
def test_a_host_that_dies_is_missed_in_time(stalls: list[Stall], beats: int) -> None:
    """Its time-out counts on the board's clock from its last heartbeat, and not a tick is given away."""
    computer = run(beats, [*stalls, (END_NS, 0)])
    last = max(counts for counts, frame in computer.seen if frame == BEAT)
    assert computer.errors
    assert 0 <= computer.errors[0] - last - TIMEOUT_MS * COUNTS_PER_MS <= 2 * TICK_COUNTS


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(STALLS, st.integers(1, 15))
def test_a_stall_only_changes_which_instant_belongs_to_a_count(stalls: list[Stall], beats: int) -> None:
    """The same frames at the same counts in virtual time: the same frames and edges."""
    live = run(beats, stalls)
    virtual = one_axis()
    for counts, frame in live.entered:
        virtual.run_until(counts)
        virtual.host.send(frame, virtual.now_counts)
    virtual.run_until(live.simulation.now_counts)
    assert live.seen == list(zip(virtual.bus.log_counts, virtual.bus.log_frames, strict=True))
    ours, theirs = (simulation.boards[0].trace(0) for simulation in (live.simulation, virtual))
    assert ours.clk_rise_counts.tolist() == theirs.clk_rise_counts.tolist()


@pytest.mark.parametrize(("dt_ns", "paused_ns"), [(STALL_NS - 1 * MS_NS, 0), (300 * MS_NS, 300 * MS_NS - STALL_NS)])
def test_the_clock_stands_beyond_the_bound(dt_ns: int, paused_ns: int) -> None:
    """Below the bound the board catches up; beyond it the board's clock stands, and that is counted."""
    computer = run(20, [(200 * MS_NS, dt_ns)])
    stalls = computer.live.stalls
    assert stalls.count == (paused_ns > 0)
    assert stalls.total_ns == stalls.longest_ns == computer.live.pacer.paused_ns
    assert stalls.total_ns == pytest.approx(paused_ns, abs=0.5 * MS_NS)  # it is held up up to a tick before it is due
    behind_ns = END_NS + dt_ns - computer.live.pacer.ns_at(computer.simulation.now_counts)
    assert abs(behind_ns) < 5 * MS_NS


def test_a_sleep_is_no_stall() -> None:
    """At rest the loop sleeps for up to a second, and nothing was missed."""
    computer = Computer([(900 * MS_NS, BEAT)], [], 5000 * MS_NS)
    computer.run()
    assert computer.live.stalls.count == 0
    ((counts, frame),) = computer.entered
    assert frame == BEAT
    assert counts == pytest.approx(900 * COUNTS_PER_MS, abs=COUNTS_PER_MS)


def test_a_computer_that_sleeps_for_an_hour() -> None:
    """The board's clock stands meanwhile, less the 10 ms that it catches up."""
    computer = run(20, [(200 * MS_NS, 3600 * 1000 * MS_NS)])
    assert computer.simulation.now_counts == pytest.approx(400 * COUNTS_PER_MS, abs=12 * COUNTS_PER_MS)
    assert computer.live.stalls.longest_ns == pytest.approx(3600 * 1000 * MS_NS, rel=1e-5)


def test_its_clock_is_fine_on_every_system() -> None:
    """Windows' monotonic clock advances by 15.6 ms before Python 3.13 (cpython issue 88494), its counter by 0.1 us."""
    assert inspect.signature(LiveLoop).parameters["clock_ns"].default is time.perf_counter_ns
    assert time.get_clock_info("perf_counter").monotonic
    assert time.get_clock_info("perf_counter").resolution <= 1e-6


def test_stalls_of_a_host_that_lives_and_of_one_that_dies() -> None:
    stalls = [(200 * MS_NS, 300 * MS_NS), (700 * MS_NS, STALL_NS + 1)]
    one_example(test_a_host_that_lives_is_not_missed, stalls)
    one_example(test_a_host_that_dies_is_missed_in_time, stalls, 4)
    one_example(test_a_stall_only_changes_which_instant_belongs_to_a_count, stalls, 9)
