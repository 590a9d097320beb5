"""Bit 8 of the controlword on the board: the axes it halts, their status during the halt, and its end."""

import pytest

from steptwin.controller.motion.backend import KERNELS, Kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import AbortConnection, State, Status
from steptwin.protocol.pvt import PvtFlag
from tests.controller.bench_board import BenchBoard
from tests.controller.units import MS, STEP

RUN, HALT = 0x1F, 0x11F
RAMP_MS = 100
"""Duration of the ramp from 4 kHz at 40 000 steps/s^2."""


@pytest.fixture
def pair(fast_kernel: Kernel) -> BenchBoard:
    """Both axes run at 4 kHz, axis 1 backwards, with 20 ms records: 50 ms of 0.64 s from rest to rest have passed."""
    return running(BenchBoard(fast_kernel, axes=2))


def running(board: BenchBoard, records: int = 32) -> BenchBoard:
    board.write(od.QUICK_STOP_DECELERATION, 40_000 * STEP, 0)
    board.write(od.PROFILE_DECELERATION, 40_000 * STEP, 0)
    board.write(od.QUICK_STOP_DECELERATION, 80_000 * STEP, 1)
    board.write(od.PROFILE_DECELERATION, 80_000 * STEP, 1)
    board.enable()
    for axis in range(2):
        sign = 1 - 2 * axis
        board.record(sign * 40 * STEP, sign * 4 * STEP * 64, 20, 0, axis)
        for sequence in range(1, records - 1):
            board.record(sign * 80 * STEP, sign * 4 * STEP * 64, 20, sequence, axis)
        board.record(sign * 40 * STEP, 0, 20, records - 1, axis)
    board.start()
    board.wait(50)
    return board


END_UNITS = (40 + 30 * 80 + 40) * STEP


def position(board: BenchBoard, axis: int = 0) -> int:
    return board.value(od.POSITION_DEMAND, axis)


def status(board: BenchBoard, axis: int = 0) -> int:
    return board.value(od.STATUSWORD, axis)


def ended(board: BenchBoard) -> bool:
    """Return whether both axes have come to their ends as planned."""
    ends = [(position(board, axis), board.value(od.POSITION_ACTUAL, axis), board.flags(axis)) for axis in range(2)]
    return ends == [(END_UNITS, END_UNITS, PvtFlag.EMPTY), (-END_UNITS, -END_UNITS, PvtFlag.EMPTY)]


def test_one_axis_halts_all_and_all_go_on(pair: BenchBoard) -> None:
    """A ramp of 100 ms from 4 kHz covers 200 steps. The axes reach the planned end 0.1 s and the pause later."""
    before = position(pair)
    pair.write(od.CONTROLWORD, HALT, axis=1)
    pair.wait(RAMP_MS + 1)
    rest = position(pair)
    assert rest - before == pytest.approx(200 * STEP, abs=STEP)
    assert position(pair, 1) == -rest
    pair.wait(5000)
    assert (position(pair), position(pair, 1)) == (rest, -rest)
    pair.write(od.CONTROLWORD, RUN, axis=1)
    pair.wait(640 - 50 - 100 - 2 + 100)
    assert pair.flags() & PvtFlag.RUNNING
    pair.wait(5)
    assert ended(pair)
    assert pair.state() is pair.state(1) is State.OPERATION_ENABLED


def test_the_status_of_the_axes_during_a_halt(pair: BenchBoard) -> None:
    """Interpolation stays active. Target reached is set, and reported, as soon as the axes rest."""
    pair.write(od.CONTROLWORD, HALT)
    for axis in range(2):
        assert status(pair, axis) & (Status.IP_ACTIVE | Status.TARGET_REACHED) == Status.IP_ACTIVE
    pair.wait(RAMP_MS / 2)
    assert pair.value(od.VELOCITY_ACTUAL) == pytest.approx(2000 * STEP, rel=0.02)
    assert pair.value(od.VELOCITY_ACTUAL, 1) == pytest.approx(-2000 * STEP, rel=0.02)
    pair.wait(RAMP_MS / 2 + 1)
    for axis in range(2):
        assert status(pair, axis) & Status.IP_ACTIVE
        assert status(pair, axis) & Status.TARGET_REACHED
        assert pair.flags(axis) & PvtFlag.RUNNING
        assert pair.value(od.VELOCITY_ACTUAL, axis) == 0
    reports = [(t, frame) for t, frame in pair.sent if frame.cob_id == 0x191]
    rested = next(t for t, frame in reports if t > 60 * MS and frame.data[1] & Status.TARGET_REACHED >> 8)
    assert rested == pytest.approx((50 + RAMP_MS) * MS, abs=0.5 * MS)
    pair.write(od.CONTROLWORD, RUN)
    pair.wait(5)
    for axis in range(2):
        assert not status(pair, axis) & Status.TARGET_REACHED
        assert not pair.frames(0x190 + axis)[-1][1] & Status.TARGET_REACHED >> 8


def test_the_group_resumes_when_all_halt_bits_are_cleared(pair: BenchBoard) -> None:
    for axis in range(2):
        pair.write(od.CONTROLWORD, HALT, axis)
    pair.wait(200)
    rest = position(pair)
    pair.write(od.CONTROLWORD, RUN, axis=0)
    pair.wait(200)
    assert position(pair) == rest
    assert status(pair) & Status.TARGET_REACHED
    pair.write(od.CONTROLWORD, RUN, axis=1)
    pair.wait(1000)
    assert ended(pair)


def test_a_sync_halts_and_releases_too(pair: BenchBoard) -> None:
    for word in (HALT, RUN):
        for node in pair.firmware.nodes:
            pair.send(0x300 + node.node_id, word.to_bytes(2, "little"))
        assert pair.firmware.motion.group.halted == (word == RUN)
        pair.send(0x080, b"")
        assert pair.firmware.motion.group.halted == (word == HALT)
        pair.wait(300)
    pair.wait(500)
    assert ended(pair)


@pytest.mark.parametrize("waits_ms", [(30, 40, 20), (1, 1, 1), (150, 30, 300), (0, 0, 0)])
def test_a_halt_may_be_released_and_repeated_at_any_time(pair: BenchBoard, waits_ms: tuple[int, ...]) -> None:
    for ms in waits_ms:
        for word in (HALT, RUN):
            pair.write(od.CONTROLWORD, word)
            pair.wait(ms)
    pair.wait(1000)
    assert ended(pair)


def test_the_queue_fills_while_all_rest(fast_kernel: Kernel) -> None:
    board = running(BenchBoard(fast_kernel, axes=2), records=16)
    board.write(od.CONTROLWORD, HALT)
    board.wait(500)
    queued = board.value(od.BUFFER_POSITION)
    assert queued == 16 - 5 - 1
    for axis in range(2):
        for i in range(64 - queued):
            board.record(0, 0, 20, 16 + i, axis)
    assert board.value(od.BUFFER_POSITION) == 64
    assert not board.flags() & PvtFlag.OVERFLOW
    board.write(od.CONTROLWORD, RUN)
    board.wait(16 * 20 + 54 * 20 + 100)
    assert position(board) == (16 - 1) * 80 * STEP
    assert board.flags() == PvtFlag.EMPTY


def test_a_motion_started_during_a_halt_waits_and_starts_as_planned(fast_kernel: Kernel) -> None:
    """One SYNC starts both axes, one of them with its halt bit set: neither moves. Released, they start as planned."""
    plain, halted = BenchBoard(fast_kernel, axes=2), BenchBoard(fast_kernel, axes=2)
    for board in (plain, halted):
        board.enable()
        for axis in range(2):
            board.record(100 * STEP, 0, 100, 0, axis)
    halted.send(0x310, RUN.to_bytes(2, "little"))
    halted.send(0x311, HALT.to_bytes(2, "little"))
    halted.send(0x080, b"")
    halted.wait(50)
    for axis in range(2):
        assert position(halted, axis) == 0
        assert status(halted, axis) & (Status.IP_ACTIVE | Status.TARGET_REACHED) == 0x1400
    halted.write(od.CONTROLWORD, RUN, axis=1)
    plain.wait(50)
    plain.start()
    for board in (plain, halted):
        board.wait(150)
    assert position(halted) == 100 * STEP
    for a, b in zip(*(board.firmware.motion.take_edges() for board in (plain, halted)), strict=True):
        assert list(a.clk_counts) == list(b.clk_counts)


def test_an_axis_may_join_a_halted_group(pair: BenchBoard) -> None:
    pair.write(od.CONTROLWORD, 0x0F, axis=1)
    pair.wait(200)
    assert pair.write(od.BUFFER_CLEAR, 0, axis=1) == 0
    pair.record(10 * STEP, 0, 20, 0, axis=1)
    pair.write(od.CONTROLWORD, HALT, axis=0)
    pair.wait(200)
    start = position(pair, 1)
    pair.write(od.CONTROLWORD, RUN, axis=1)
    pair.wait(200)
    assert position(pair, 1) == start
    assert status(pair, 1) & Status.IP_ACTIVE
    pair.write(od.CONTROLWORD, RUN, axis=0)
    pair.wait(1000)
    assert position(pair, 1) == start + 10 * STEP
    assert position(pair) == END_UNITS


def test_axes_that_do_not_interpolate_are_untouched(pair: BenchBoard) -> None:
    """Axis 1 ramps down from 4 kHz in 50 ms, with or without a halt; a halt bit in another mode halts no other axis."""
    pair.write(od.CONTROLWORD, 0x0F, axis=1)
    start = position(pair, 1)
    pair.write(od.CONTROLWORD, HALT, axis=0)
    pair.wait(51)
    assert not pair.firmware.motion.axes[1].running
    assert position(pair, 1) - start == pytest.approx(-100 * STEP, abs=STEP)
    pair.write(od.CONTROLWORD, RUN, axis=0)
    pair.wait(200)
    assert pair.write(od.MODE_OF_OPERATION, 6, axis=1) == 0
    pair.write(od.CONTROLWORD, 0x10F, axis=1)
    pair.wait(1000)
    assert position(pair) == END_UNITS


def test_an_axis_that_ends_with_its_halt_bit_set_keeps_the_group_halted(fast_kernel: Kernel) -> None:
    """An axis' queue ends while the group slows down; the others stay halted until its bit is cleared."""
    board = BenchBoard(fast_kernel, axes=2)
    board.write(od.QUICK_STOP_DECELERATION, 10_000 * STEP, 1)
    board.write(od.PROFILE_DECELERATION, 10_000 * STEP, 1)
    board.enable()
    board.record(10 * STEP, 0, 60, 0, axis=0)
    for sequence in range(40):
        board.record(20 * STEP, 2 * STEP * 64, 10, sequence, axis=1)
    board.record(10 * STEP, 0, 10, 40, axis=1)
    board.start()
    board.wait(50)
    board.write(od.CONTROLWORD, HALT, axis=0)
    board.wait(1000)
    assert board.flags(0) == PvtFlag.EMPTY
    rest = position(board, 1)
    board.wait(1000)
    assert position(board, 1) == rest
    assert status(board, 1) & Status.TARGET_REACHED
    board.write(od.CONTROLWORD, 0x0F, axis=0)
    board.wait(1000)
    assert position(board, 1) == (40 * 20 + 10) * STEP


def test_a_group_that_has_ended_leaves_no_halt_behind(pair: BenchBoard) -> None:
    """An axis started later, without a halt bit, runs at full rate from its first tick."""
    pair.write(od.CONTROLWORD, HALT)
    pair.wait(60)
    for axis in range(2):
        pair.write(od.CONTROLWORD, 0x0F, axis)
    pair.wait(200)
    before = position(pair)
    assert pair.write(od.BUFFER_CLEAR, 0) == 0
    pair.record(10 * STEP, 0, 20, 0)
    pair.write(od.CONTROLWORD, RUN)
    pair.wait(21)
    assert position(pair) == before + 10 * STEP


class TestStopsDuringAHalt:
    @pytest.mark.parametrize(
        ("word", "target"),
        [(0x02, State.SWITCH_ON_DISABLED), (0x07, State.SWITCHED_ON), (0x06, State.READY_TO_SWITCH_ON)],
    )
    def test_ramps_start_from_the_velocity_that_is_left(self, pair: BenchBoard, word: int, target: State) -> None:
        """Half way down axis 0 runs at 2 kHz: 50 ms and 50 steps to rest. Axis 1 goes on halting."""
        pair.write(od.CONTROLWORD, HALT, axis=1)
        pair.wait(RAMP_MS / 2)
        start = position(pair)
        pair.write(od.CONTROLWORD, word)
        pair.wait(48)
        assert pair.state() is not target
        pair.wait(4)
        assert pair.state() is target
        assert position(pair) - start == pytest.approx(50 * STEP, abs=2 * STEP)
        pair.wait(1000)
        assert status(pair, 1) & Status.TARGET_REACHED
        assert pair.flags(1) & PvtFlag.RUNNING
        pair.write(od.CONTROLWORD, RUN, axis=1)
        pair.wait(1000)
        assert position(pair, 1) == -END_UNITS

    @pytest.mark.parametrize(
        ("word", "target"),
        [
            (0x102, State.SWITCH_ON_DISABLED),
            (0x107, State.SWITCHED_ON),
            (0x100, State.SWITCH_ON_DISABLED),
            (0x10F, State.OPERATION_ENABLED),
        ],
    )
    def test_at_rest_they_move_nothing(self, pair: BenchBoard, word: int, target: State) -> None:
        """Any stop closes the queue; the halt bit, which is still set, keeps the other axis halted."""
        pair.write(od.CONTROLWORD, HALT)
        pair.wait(200)
        rest = position(pair)
        pair.write(od.CONTROLWORD, word)
        pair.wait(200)
        assert pair.state() is target
        assert abs(position(pair) - rest) <= 1
        assert (position(pair, 1), pair.flags(1) & PvtFlag.RUNNING) == (-rest, PvtFlag.RUNNING)
        assert pair.value(od.PVT_FREE_RECORDS) == 0

    def test_a_queue_that_runs_out_on_the_ramp_stops_the_group(self, fast_kernel: Kernel) -> None:
        """A halt with only 10 ms of records left at 4 kHz is an underrun; the stop starts from the speed then left.

        Axis 0 runs out of records within a tick and rests for the remainder of it, less than a step.
        """
        board = BenchBoard(fast_kernel, axes=2)
        for axis in range(2):
            board.write(od.QUICK_STOP_DECELERATION, 40_000 * STEP, axis)
            board.write(od.PROFILE_DECELERATION, 40_000 * STEP, axis)
        board.enable()
        for axis in range(2):
            board.record(40 * STEP, 4 * STEP * 64, 20, 0, axis)
            for sequence in range(1, 4 + axis):
                board.record(80 * STEP, 4 * STEP * 64, 20, sequence, axis)
        board.start()
        board.wait(70)
        board.write(od.CONTROLWORD, HALT)
        board.wait(12)
        assert board.state() is board.state(1) is State.FAULT_REACTION_ACTIVE
        assert board.value(od.VELOCITY_ACTUAL) < 3700 * STEP
        board.wait(100)
        assert board.state() is board.state(1) is State.FAULT
        assert 0 <= position(board, 1) - position(board) < STEP
        assert position(board) == pytest.approx((280 + 158) * STEP, abs=6 * STEP)
        assert board.value(od.PVT_UNDERRUNS) == 1

    def test_a_reset_node_halts_no_other_axis(self, pair: BenchBoard) -> None:
        pair.write(od.ABORT_CONNECTION_OPTION, AbortConnection.DISABLE_VOLTAGE)
        pair.write(od.CONTROLWORD, HALT)
        pair.wait(200)
        pair.nmt(0x81, node=0x10)
        pair.wait(1000)
        assert position(pair, 1) == -END_UNITS


def test_the_same_frames_give_the_same_bytes_with_both_kernels() -> None:
    pytest.importorskip("numba", reason="the extra `fast` (numba) is not installed")
    results = []
    for make_kernel in KERNELS.values():
        board = running(BenchBoard(make_kernel(), axes=2))
        for word, axis, ms in ((HALT, 0, 33), (HALT, 1, 200), (RUN, 0, 5), (RUN, 1, 77), (HALT, 1, 60), (RUN, 1, 900)):
            board.write(od.CONTROLWORD, word, axis)
            board.wait(ms)
        edges = [
            ([int(t) for t in pins.clk_counts], [int(w) for w in pins.direction])
            for pins in board.firmware.motion.take_edges()
        ]
        assert ended(board)
        results.append((edges, board.sent))
    assert results[0] == results[1]
