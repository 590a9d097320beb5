"""The rate of the group's time on the board (2010h): its bounds, what it keeps to, and how it meets stops and halts."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import KERNELS, Kernel, python_kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, ErrorCode, State, Status
from steptwin.protocol.pvt import PvtFlag
from steptwin.protocol.sdo_frames import AbortCode
from tests.controller.bench_board import BenchBoard
from tests.controller.units import MS, STEP
from tests.one_example import one_example

RUN, HALT = 0x1F, 0x11F
FULL, HALF, SLOWEST, FASTEST = 65_536, 32_768, 6_554, 98_304
SPEED_HZ = 4_000
END_UNITS = (40 + 30 * 80 + 40) * STEP
LIMIT_UNITS_PER_S = 15_000 * STEP


@pytest.fixture
def pair(fast_kernel: Kernel) -> BenchBoard:
    """Both axes run at 4 kHz, axis 1 backwards, with 20 ms records: 50 ms of 0.64 s from rest to rest have passed."""
    return running(BenchBoard(fast_kernel, axes=2))


def running(board: BenchBoard, highest_q16: int = FASTEST) -> BenchBoard:
    for axis in range(2):
        board.write(od.QUICK_STOP_DECELERATION, 40_000 * STEP, axis)
        board.write(od.PROFILE_DECELERATION, 40_000 * STEP, axis)
    board.enable()
    queue(board, highest_q16)
    board.start()
    board.wait(50)
    return board


def queue(board: BenchBoard, highest_q16: int) -> None:
    """Queue 640 ms for both axes, whose highest rate is allowed first."""
    for axis in range(2):
        assert board.write(od.BUFFER_CLEAR, 0, axis) == 0
        assert board.write(od.GROUP_RATE_HIGHEST_Q16, highest_q16, axis) == 0
        sign = 1 - 2 * axis
        board.record(sign * 40 * STEP, sign * 4 * STEP * 64, 20, 0, axis)
        for sequence in range(1, 31):
            board.record(sign * 80 * STEP, sign * 4 * STEP * 64, 20, sequence, axis)
        board.record(sign * 40 * STEP, 0, 20, 31, axis)


def position(board: BenchBoard, axis: int = 0) -> int:
    return board.value(od.POSITION_DEMAND, axis)


def speed_hz(board: BenchBoard, axis: int = 0) -> float:
    return abs(board.value(od.VELOCITY_ACTUAL, axis)) / STEP


def ended(board: BenchBoard) -> bool:
    ends = [(position(board, axis), board.value(od.POSITION_ACTUAL, axis), board.flags(axis)) for axis in range(2)]
    return ends == [(END_UNITS, END_UNITS, PvtFlag.EMPTY), (-END_UNITS, -END_UNITS, PvtFlag.EMPTY)]


def test_the_figures_of_the_kernel_and_the_dictionary_are_the_same() -> None:
    assert (FULL, FASTEST) == (k.FULL_RATE_Q16, k.HIGHEST_RATE_Q16) == (od.FULL_RATE_Q16, od.RATE_MAX_Q16)
    assert [od.rate_q16(percent) for percent in (10, 50, 100, 150)] == [SLOWEST, HALF, FULL, FASTEST]


@pytest.mark.parametrize("rate_q16", [SLOWEST, HALF, 60_000, 70_000, FASTEST])
def test_any_axis_changes_the_rate_of_all_and_they_end_as_planned(pair: BenchBoard, rate_q16: int) -> None:
    assert pair.write(od.GROUP_RATE_Q16, rate_q16, axis=1) == 0
    pair.wait(100)  # longer than the ramp: 0.1 s would be that between full rate and 0
    for axis in range(2):
        assert pair.value(od.GROUP_RATE_Q16, axis) == pair.value(od.GROUP_RATE_NOW_Q16, axis) == rate_q16
        assert speed_hz(pair, axis) == pytest.approx(SPEED_HZ * rate_q16 / FULL, rel=1e-3)
    pair.wait(7000)
    assert ended(pair)


def test_the_ramp_is_as_slow_as_the_deceleration_demands(pair: BenchBoard) -> None:
    """At 40 000 steps/s^2 from 4 kHz to 2 kHz 50 ms, and back; on the way the present rate is between."""
    pair.write(od.GROUP_RATE_Q16, HALF)
    pair.wait(25)
    assert pair.value(od.GROUP_RATE_NOW_Q16) == FULL * 3 // 4
    pair.wait(24)
    assert pair.value(od.GROUP_RATE_NOW_Q16) > HALF
    pair.wait(1)
    assert pair.value(od.GROUP_RATE_NOW_Q16) == HALF
    pair.write(od.GROUP_RATE_Q16, FULL)
    pair.wait(50)
    assert pair.value(od.GROUP_RATE_NOW_Q16) == FULL


def test_the_bounds_are_10_and_150_percent(pair: BenchBoard) -> None:
    assert pair.write(od.GROUP_RATE_Q16, SLOWEST - 1) == AbortCode.VALUE_TOO_LOW
    assert pair.write(od.GROUP_RATE_Q16, FASTEST + 1) == AbortCode.VALUE_TOO_HIGH
    assert pair.value(od.GROUP_RATE_Q16) == FULL
    assert pair.write(od.GROUP_RATE_Q16, SLOWEST) == 0
    assert pair.write(od.GROUP_RATE_Q16, FASTEST) == 0


def test_no_rate_beyond_what_every_axis_records_allow(fast_kernel: Kernel) -> None:
    board = running(BenchBoard(fast_kernel, axes=2), highest_q16=77_334)
    assert board.write(od.GROUP_RATE_Q16, 77_335) == AbortCode.VALUE_TOO_HIGH
    assert board.write(od.GROUP_RATE_Q16, 77_334) == 0
    plain = running(BenchBoard(fast_kernel, axes=2), highest_q16=FULL)
    assert plain.write(od.GROUP_RATE_Q16, FULL + 1) == AbortCode.VALUE_TOO_HIGH


def test_without_a_motion_there_is_no_rate_to_want(fast_kernel: Kernel) -> None:
    board = BenchBoard(fast_kernel, axes=2)
    board.enable()
    assert board.write(od.GROUP_RATE_Q16, HALF) == AbortCode.DEVICE_STATE
    running(board)
    assert board.write(od.GROUP_RATE_Q16, HALF) == 0
    board.wait(2000)
    assert ended(board)
    assert board.write(od.GROUP_RATE_Q16, HALF) == AbortCode.DEVICE_STATE
    assert board.value(od.GROUP_RATE_Q16) == board.value(od.GROUP_RATE_NOW_Q16) == FULL


@pytest.mark.parametrize("rate_q16", [FULL, 77_334, FASTEST])
def test_records_are_judged_at_the_highest_rate(fast_kernel: Kernel, rate_q16: int) -> None:
    """The limit of 15 kHz, divided by the rate, on both sides: the fastest record, and one that is just too fast."""
    board = BenchBoard(fast_kernel)
    board.write(od.MAX_PROFILE_VELOCITY, LIMIT_UNITS_PER_S)
    board.enable()
    assert board.write(od.GROUP_RATE_HIGHEST_Q16, rate_q16) == 0
    limit_q16_per_ms = board.firmware.motion.axes[0].rate_limit_q16_per_ms * FULL // rate_q16
    per_ms = limit_q16_per_ms  # at 16 microsteps a record's 1/64 unit per ms is one step/65 536 per ms, too
    board.record(0, per_ms + 1, 1, 0)
    assert board.errors() == [ErrorCode.SEGMENT_REFUSED]
    assert board.value(od.BUFFER_POSITION) == 0
    board.record(per_ms // 192, per_ms, 1, 0)
    assert board.value(od.BUFFER_POSITION) == 1
    assert board.write(od.GROUP_RATE_HIGHEST_Q16, FULL) == AbortCode.DEVICE_STATE, "its records are judged already"
    assert board.write(od.BUFFER_CLEAR, 0) == 0
    assert board.value(od.GROUP_RATE_HIGHEST_Q16) == FULL


def test_the_next_motion_begins_at_full_rate(pair: BenchBoard) -> None:
    pair.write(od.GROUP_RATE_Q16, HALF)
    pair.wait(2000)
    assert ended(pair)
    queue(pair, FULL)
    pair.write(od.CONTROLWORD, 0x0F, 0)
    pair.write(od.CONTROLWORD, 0x0F, 1)
    start = position(pair)
    pair.start()
    pair.wait(20)
    assert position(pair) - start == 40 * STEP
    assert pair.value(od.GROUP_RATE_Q16) == FULL


def test_an_axis_whose_records_are_too_fast_for_the_present_rate_does_not_join(pair: BenchBoard) -> None:
    pair.write(od.CONTROLWORD, 0x0F, axis=1)
    pair.wait(200)
    assert pair.write(od.BUFFER_CLEAR, 0, axis=1) == 0
    start = position(pair, 1)
    pair.record(10 * STEP, 0, 20, 0, axis=1)
    assert pair.write(od.GROUP_RATE_Q16, FULL + 1) == 0
    pair.write(od.CONTROLWORD, RUN, axis=1)
    pair.wait(50)
    assert (position(pair, 1), pair.flags(1) & PvtFlag.RUNNING) == (start, 0)
    pair.write(od.CONTROLWORD, 0x0F, axis=1)
    assert pair.write(od.GROUP_RATE_Q16, FULL) == 0
    pair.wait(10)
    pair.write(od.CONTROLWORD, RUN, axis=1)
    pair.wait(30)
    assert position(pair, 1) == start + 10 * STEP


def test_a_halt_at_a_rate_returns_to_it(pair: BenchBoard) -> None:
    """From 2 kHz the ramp takes 50 ms; what is wanted during the halt holds when it ends."""
    pair.write(od.GROUP_RATE_Q16, HALF)
    pair.wait(60)
    pair.write(od.CONTROLWORD, HALT)
    pair.wait(51)
    rest = position(pair)
    assert pair.value(od.STATUSWORD) & Status.TARGET_REACHED
    assert (pair.value(od.GROUP_RATE_Q16), pair.value(od.GROUP_RATE_NOW_Q16)) == (HALF, 0)
    pair.wait(500)
    assert position(pair) == rest
    pair.write(od.CONTROLWORD, RUN)
    pair.wait(60)
    assert speed_hz(pair) == pytest.approx(SPEED_HZ / 2, rel=1e-3)
    pair.write(od.CONTROLWORD, HALT)
    pair.wait(100)
    pair.write(od.GROUP_RATE_Q16, FASTEST)
    assert pair.value(od.GROUP_RATE_NOW_Q16) == 0
    pair.wait(100)
    assert pair.value(od.GROUP_RATE_NOW_Q16) == 0
    pair.write(od.CONTROLWORD, RUN)
    pair.wait(160)
    assert speed_hz(pair) == pytest.approx(SPEED_HZ * 1.5, rel=1e-3)
    pair.wait(1000)
    assert ended(pair)


class TestStopsAtARate:
    """A stop begins with the speed that the axis has: at 150 % 6 kHz, and at 40 000 steps/s^2 450 steps to rest."""

    @pytest.fixture
    def fast(self, pair: BenchBoard) -> BenchBoard:
        pair.write(od.GROUP_RATE_Q16, FASTEST)
        pair.wait(60)
        assert speed_hz(pair) == pytest.approx(6000, rel=1e-3)
        return pair

    def stopped_after_ms(self, board: BenchBoard, state: State) -> int:
        start = position(board)
        for ms in range(200):
            if board.state() is state:
                assert position(board) - start == pytest.approx(450 * STEP, abs=6 * STEP)
                return ms
            board.wait(1)
        raise AssertionError(board.state())

    def test_quick_stop(self, fast: BenchBoard) -> None:
        fast.write(od.CONTROLWORD, 0x02)
        assert self.stopped_after_ms(fast, State.SWITCH_ON_DISABLED) == pytest.approx(150, abs=2)

    def test_emergency_stop(self, fast: BenchBoard) -> None:
        assert fast.write(od.EMERGENCY_STOP, 1) == 0
        assert self.stopped_after_ms(fast, State.FAULT) == pytest.approx(150, abs=2)
        assert fast.state(1) is State.FAULT
        assert position(fast, 1) == pytest.approx(-position(fast), abs=2)

    def test_limit_switch(self, fast: BenchBoard) -> None:
        fast.set_inputs(DigitalInput.POSITIVE_LIMIT, 0)
        assert self.stopped_after_ms(fast, State.FAULT) == pytest.approx(150, abs=2)
        assert ErrorCode.LIMIT_SWITCH in fast.errors()
        assert ErrorCode.GROUP_STOPPED in fast.errors(1)

    def test_the_rate_ends_with_the_motion(self, fast: BenchBoard) -> None:
        fast.write(od.CONTROLWORD, 0x0F, 0)
        fast.write(od.CONTROLWORD, 0x0F, 1)
        fast.wait(200)
        assert fast.value(od.GROUP_RATE_Q16) == fast.value(od.GROUP_RATE_NOW_Q16) == FULL


CHANGES = st.lists(
    st.tuples(st.integers(0, 120), st.sampled_from([0, None, SLOWEST, HALF, FULL, 70_000, FASTEST])), max_size=8
)


@pytest.mark.slow
@given(changes=CHANGES)
@settings(max_examples=40, deadline=None)
def test_whatever_rates_and_halts_the_end_is_the_planned_one_within_the_limit(
    changes: list[tuple[int, int | None]],
) -> None:
    """At most 4 kHz * 1.5, which no two rises exceed; the pulses are as many as planned."""
    board = running(BenchBoard(python_kernel(), axes=2))
    for ms, rate_q16 in changes:
        if rate_q16:
            board.write(od.GROUP_RATE_Q16, rate_q16)
        else:
            board.write(od.CONTROLWORD, RUN if rate_q16 is None else HALT)
        board.wait(ms)
    board.write(od.GROUP_RATE_Q16, FULL)
    board.write(od.CONTROLWORD, RUN)
    board.wait(1500)
    assert ended(board)
    for pins in board.firmware.motion.take_edges():
        rises = [int(counts) for counts in pins.clk_counts[0::2]]
        assert len(rises) == END_UNITS // STEP
        assert min(b - a for a, b in pairwise(rises)) >= 1000 * MS / 6000 - 20


def test_the_same_frames_give_the_same_bytes_with_both_kernels() -> None:
    pytest.importorskip("numba", reason="the extra `fast` (numba) is not installed")
    results = []
    for make_kernel in KERNELS.values():
        board = running(BenchBoard(make_kernel(), axes=2))
        for address, value, ms in (
            (od.GROUP_RATE_Q16, SLOWEST, 133),
            (od.GROUP_RATE_Q16, FASTEST, 70),
            (od.CONTROLWORD, HALT, 200),
            (od.CONTROLWORD, RUN, 7),
            (od.GROUP_RATE_Q16, 70_001, 900),
        ):
            assert board.write(address, value) == 0
            board.wait(ms)
        edges = [
            ([int(t) for t in pins.clk_counts], [int(w) for w in pins.direction])
            for pins in board.firmware.motion.take_edges()
        ]
        assert ended(board)
        results.append((edges, board.sent))
    assert results[0] == results[1]


def test_the_board_says_how_many_axes_share_its_time(fast_kernel: Kernel) -> None:
    for axes in (1, 2):
        assert BenchBoard(fast_kernel, axes).value(od.BOARD_AXES) == axes


def test_some_rates_and_halts_lead_to_the_planned_end() -> None:
    changes = [(60, FASTEST), (30, 0), (100, None), (20, HALF)]
    one_example(
        test_whatever_rates_and_halts_the_end_is_the_planned_one_within_the_limit,
        [(ms, rate_q16) for ms, rate_q16 in changes],
    )
