"""Real time without a clock: whatever the wall clock does, the board does the same."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.live.live_simulation import (
    PIECE_NS,
    SLICE_COUNTS,
    WORK_NS,
    Lateness,
    LiveSimulation,
    Pacer,
    Sender,
    warm_up,
)
from steptwin.emulator.simulation import Simulation
from steptwin.protocol.frame import Frame
from steptwin.protocol.pvt import PvtRecord
from steptwin.protocol.timer import COUNTS_PER_US
from tests.compiled import on_sources_only
from tests.emulator.pins import WIRES
from tests.one_example import one_example

MS_NS = 1_000_000
TICK_NS = 250_000
NODE = 0x10


def live_board(kernel: Kernel) -> LiveSimulation:
    board = Board(BoardConfig((WIRES,) * 2), kernel)
    return LiveSimulation(Simulation([board], Bus(1_000_000)), Pacer(0))


def catch_up(live: LiveSimulation, now_ns: int) -> None:
    """As the loop does it: until nothing is due any more."""
    live.advance(now_ns)
    while live.pacer.counts_at(now_ns) - live.simulation.now_counts >= COUNTS_PER_US:
        live.advance(now_ns)
    live.settle(now_ns)


def motion(axis: int = 0) -> list[Frame]:
    """Frames that let an axis make 50 steps in 100 ms."""
    node = NODE + axis
    enabling = [Frame(0x200 + node, bytes((word, 0, 7))) for word in (0x06, 0x07, 0x0F)]
    start = [Frame(0x500 + node, PvtRecord(50 * 1024, 0, 100, 0).encode()), Frame(0x300 + node, b"\x1f\x00")]
    return [Frame(0x000, b"\x01\x00"), *enabling, *start, Frame(0x080, b"")]


Outcome = tuple[list[tuple[int, Frame]], list[list[int]]]


def outcome(live: LiveSimulation) -> Outcome:
    """All frames and all edges, with their instants."""
    bus, board = live.simulation.bus, live.simulation.boards[0]
    traces = [board.trace(axis) for axis in (0, 1)]
    frames = list(zip(bus.log_counts, bus.log_frames, strict=True))
    return frames, [trace.clk_rise_counts.tolist() for trace in traces]


def run(arrivals: list[tuple[int, Frame]], wakes_ns: list[int], end_ns: int) -> Outcome:
    """Frames arrive at instants; the process wakes up at others."""
    live = live_board(fastest_kernel())
    waiting = list(arrivals)
    for now_ns in [*wakes_ns, end_ns]:
        while waiting and waiting[0][0] <= now_ns:
            arrived_ns, frame = waiting.pop(0)
            live.send(frame, "a client", arrived_ns)
        catch_up(live, now_ns)
    return outcome(live)


END_NS = 150 * MS_NS
DELAYS = st.lists(st.integers(0, 3 * MS_NS), min_size=14, max_size=14)
WAKES = st.lists(st.integers(0, END_NS), max_size=60).map(sorted)


@pytest.mark.slow
@settings(max_examples=30)
@given(DELAYS, WAKES)
@example([MS_NS] * 14, [])
def test_lateness_changes_nothing(delays_ns: list[int], wakes_ns: list[int]) -> None:
    """However seldom the process wakes up, frames and edges are those of one that is always in time."""
    times_ns = np.cumsum(delays_ns).tolist()
    arrivals = list(zip(times_ns, motion(0) + motion(1), strict=True))
    in_time = run(arrivals, list(range(0, END_NS, TICK_NS)), END_NS)
    assert run(arrivals, wakes_ns, END_NS) == in_time
    if min(delays_ns) == MS_NS:  # one by one, in their order
        assert [len(edges) for edges in in_time[1]] == [50, 50]


def test_a_frame_enters_at_its_instant() -> None:
    """20 us after boot; the two boot-up messages are on the bus, and have the higher identifiers."""
    live = live_board(fastest_kernel())
    live.send(Frame(0x000, b"\x02\x00"), "a client", 20_000)
    catch_up(live, 10 * MS_NS)
    assert [frame.cob_id for frame in live.simulation.bus.log_frames] == [0x710, 0x000, 0x711]


def test_a_late_frame_does_not_enter_in_the_past() -> None:
    live = live_board(fastest_kernel())
    catch_up(live, 10 * MS_NS)
    live.send(Frame(0x000, b"\x02\x00"), "a client", 5 * MS_NS)
    catch_up(live, 11 * MS_NS)
    assert live.simulation.bus.log_counts[-1] > live.pacer.counts_at(10 * MS_NS)


def test_the_viewer_sees_every_frame_and_its_sender(fast_kernel: Kernel) -> None:
    live = live_board(fast_kernel)
    seen: list[tuple[Frame, Sender | None]] = []
    live.view = lambda frame, _, sender: seen.append((frame, sender))
    request = Frame(0x610, bytes.fromhex("4000100000000000"))
    live.send(request, "one", 2 * MS_NS)
    live.send(request, "two", 2 * MS_NS)
    live.send(Frame(0x123, b"x"), "one", 2 * MS_NS)
    catch_up(live, 4 * MS_NS)
    boots = [(Frame(0x710, b"\0"), None), (Frame(0x711, b"\0"), None)]
    answer = (Frame(0x590, bytes.fromhex("4300100092010400")), None)
    assert seen[:2] == boots
    assert sorted(seen[2:], key=str) == sorted(
        [(request, "one"), (request, "two"), (Frame(0x123, b"x"), "one"), *[answer] * 2], key=str
    )
    assert [sender for frame, sender in seen if frame == request] == ["one", "two"]


class TestWhenItIsDue:
    def test_at_rest_with_the_bus(self, fast_kernel: Kernel) -> None:
        """Nothing comes before the first boot-up message has passed, and nothing after the second."""
        live = live_board(fast_kernel)
        assert live.due_ns == 0
        catch_up(live, 1_000)
        assert live.due_ns == pytest.approx(54_000, abs=1_000)
        catch_up(live, 10 * MS_NS)
        assert live.due_ns > 10**15

    def test_in_motion_with_each_tick(self, fast_kernel: Kernel) -> None:
        live = live_board(fast_kernel)
        for frame in motion():
            live.send(frame, "a client", 2 * MS_NS)
        catch_up(live, 20 * MS_NS + 100_000)
        assert live.moving
        assert live.pacer.counts_at(live.due_ns) == live.pacer.counts_at(20 * MS_NS + TICK_NS) + COUNTS_PER_US
        catch_up(live, 200 * MS_NS)
        assert not live.moving

    def test_for_what_has_come_in_at_once(self, fast_kernel: Kernel) -> None:
        live = live_board(fast_kernel)
        catch_up(live, 10 * MS_NS)
        live.send(Frame(0x123, b""), "a client", 12 * MS_NS)
        assert live.pacer.counts_at(live.due_ns) == live.pacer.counts_at(12 * MS_NS)

    def test_a_long_sleep_at_rest_is_over_at_once(self, fast_kernel: Kernel) -> None:
        live = live_board(fast_kernel)
        catch_up(live, 10 * MS_NS)
        live.advance(3600 * 1000 * MS_NS)
        assert live.simulation.now_counts == 3600 * 72_000_000

    def test_in_motion_others_have_their_turn(self, fast_kernel: Kernel) -> None:
        live = live_board(fast_kernel)
        for frame in motion():
            live.send(frame, "a client", 2 * MS_NS)
        catch_up(live, 10 * MS_NS)
        before = live.simulation.now_counts
        live.advance(90 * MS_NS)
        assert live.simulation.now_counts == before + SLICE_COUNTS


class TestLateness:
    def test_of_ticks(self, fast_kernel: Kernel) -> None:
        """Ticks begin at whole multiples of 250 us: seen 90 us after each they are late by that."""
        live = live_board(fast_kernel)
        for frame in motion():
            live.send(frame, "a client", 2 * MS_NS)
        catch_up(live, 10 * MS_NS)
        for now_ns in range(10 * MS_NS, 60 * MS_NS, TICK_NS):
            live.ticks.count = 0
            catch_up(live, now_ns + 90_000)
            assert live.ticks.count == 1
        assert 90_000 <= live.ticks.percentile_ns(50) <= 96_000

    def test_of_ticks_caught_up_with(self, fast_kernel: Kernel) -> None:
        live = live_board(fast_kernel)
        for frame in motion():
            live.send(frame, "a client", 2 * MS_NS)
        catch_up(live, 10 * MS_NS + 1_000)
        live.ticks.max_ns = live.ticks.count = 0
        catch_up(live, 15 * MS_NS)
        assert live.ticks.count == 19
        assert live.ticks.max_ns == 5 * MS_NS - TICK_NS

    def test_at_rest_there_are_none(self, fast_kernel: Kernel) -> None:
        live = live_board(fast_kernel)
        catch_up(live, 100 * MS_NS)
        assert live.ticks.count == 0

    def test_of_frames(self, fast_kernel: Kernel) -> None:
        """The boot-up messages were valid after some 54 and 111 us."""
        live = live_board(fast_kernel)
        catch_up(live, 1 * MS_NS)
        assert live.frames.count == 2
        assert live.frames.max_ns == pytest.approx(1 * MS_NS - 54_000, abs=1_000)


def test_warming_up_calls_every_function_of_the_kernel(kernel: Kernel) -> None:
    called: set[str] = set()

    def noting(name: str) -> object:
        function = getattr(kernel, name)

        def call(*arguments: object) -> object:
            called.add(name)
            return function(*arguments)

        return call

    names = ("push", "next_segment", "advance", "demand_rate")
    warm_up(replace(kernel, **{name: noting(name) for name in names}))  # type: ignore[arg-type]
    assert called == set(names)


PIECE_US = 60


class Computer:
    """A wall clock on which a piece of work takes its time, and rotors that have some pieces to do."""

    def __init__(self, live: LiveSimulation, pieces: int, *, pressing: bool) -> None:
        self._live, self._waiting = live, pieces
        self.now_ns, self.done = 0, 0
        self.pressing, self.next_counts = pressing, 1 << 62

    def clock_ns(self) -> int:
        return self.now_ns

    @property
    def work_counts(self) -> int:
        """Now, or never."""
        return self._live.simulation.now_counts if self.done < self._waiting else 1 << 62

    def work(self) -> None:
        self.done += 1
        self.now_ns += PIECE_US * 1000

    def look(self) -> None:
        """Nothing is asked of the rotors."""


def pieces_done(kernel: Kernel, *, into_tick_us: int, moving: bool, pieces: int = 9, pressing: bool = False) -> int:
    """Return how many pieces are done from an instant in a servo tick on until the sockets are looked at."""
    live = live_board(kernel)
    now_ns = 0
    for frame in motion() if moving else []:
        now_ns += MS_NS
        live.send(frame, "a client", now_ns)
    now_ns += MS_NS + into_tick_us * 1000
    catch_up(live, now_ns)
    assert live.moving == moving
    computer = Computer(live, pieces, pressing=pressing)
    computer.now_ns = now_ns
    with patch.object(live.simulation, "rotor_watch", computer):
        waits = live.wake_ns(now_ns) <= now_ns
        live.work(computer.clock_ns)
    assert waits == (computer.done > 0) or pressing
    return computer.done


@on_sources_only
@pytest.mark.parametrize(
    ("into_tick_us", "done"),
    [(20, 2), (250 - PIECE_NS // 1000 - PIECE_US + 1, 2), (250 - PIECE_NS // 1000, 1), (160, 0), (249, 0)],
)
def test_work_begins_while_a_piece_ends_before_the_next_tick(into_tick_us: int, done: int, fast_kernel: Kernel) -> None:
    assert pieces_done(fast_kernel, into_tick_us=into_tick_us, moving=True) == done


@on_sources_only
def test_work_that_presses_makes_a_tick_late_by_a_piece(fast_kernel: Kernel) -> None:
    assert pieces_done(fast_kernel, into_tick_us=249, moving=True, pressing=True) == 1


@on_sources_only
def test_work_at_rest_leaves_the_sockets_their_turn(fast_kernel: Kernel) -> None:
    assert pieces_done(fast_kernel, into_tick_us=0, moving=False) == WORK_NS // (PIECE_US * 1000) + 1


@on_sources_only
def test_work_ends_when_there_is_no_more(fast_kernel: Kernel) -> None:
    assert pieces_done(fast_kernel, into_tick_us=0, moving=False, pieces=1) == 1
    assert pieces_done(fast_kernel, into_tick_us=0, moving=False, pieces=0) == 0


def lateness_of(values_ns: list[int]) -> Lateness:
    lateness = Lateness()
    for value in values_ns:
        lateness.add(value)
    return lateness


def test_nothing_was_never_late() -> None:
    lateness = Lateness()
    assert (lateness.count, lateness.max_ns, lateness.percentile_ns(99)) == (0, 0, 0)


def test_small_ones_are_exact() -> None:
    lateness = lateness_of(list(range(32)))
    assert [lateness.percentile_ns(percent) for percent in (0, 50, 75, 100)] == [0, 15, 23, 31]


def test_early_events_count_as_not_late() -> None:
    assert lateness_of([-5, -1]).percentile_ns(100) == 0


def test_one_outlier_is_the_maximum_and_no_more() -> None:
    lateness = lateness_of([1000] * 999 + [10**9])
    assert lateness.max_ns == 10**9
    assert 1000 <= lateness.percentile_ns(99) <= 1000 * 17 / 16


@pytest.mark.slow
@given(st.lists(st.integers(0, 10**12), min_size=1), st.integers(1, 100))
def test_a_percentile_is_at_most_a_sixteenth_too_large(values_ns: list[int], percent: int) -> None:
    exact = sorted(values_ns)[-(-percent * len(values_ns) // 100) - 1]
    assert exact <= lateness_of(values_ns).percentile_ns(percent) <= exact * 17 / 16


@pytest.mark.parametrize("count", [10, 10_000])
def test_it_does_not_grow_with_their_number(count: int) -> None:
    lateness = lateness_of([10**6 + i % 7 for i in range(count)])
    assert lateness.count == count
    assert len(lateness._counts) == 1  # noqa: SLF001


@pytest.mark.slow
def test_some_lateness_changes_nothing() -> None:
    one_example(test_lateness_changes_nothing, [MS_NS] * 14, [10 * MS_NS, 11 * MS_NS, 90 * MS_NS])
