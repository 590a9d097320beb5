"""Cyclic synchronous position through the whole firmware: set-points, SYNCs and limits."""

import math
import random
from bisect import bisect_right
from collections.abc import Iterator
from fractions import Fraction
from itertools import accumulate

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.controller.modes.cyclic_position import NO_SET_POINT, NO_SYNC
from steptwin.controller.motion.backend import Kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, ErrorCode, Mode, State, Status
from steptwin.protocol.sdo_frames import AbortCode
from tests.controller.bench_board import BenchBoard
from tests.controller.modes.cyclic_bench import FIRST_SYNC_COUNTS, CyclicBench, first_tick, ramped
from tests.controller.motion.exact_hermite import ExactHermite
from tests.controller.motion.kernel_rig import Timing, pin_timing_faults
from tests.controller.units import MS, STEP
from tests.one_example import one_example

PERIODS = pytest.mark.parametrize("period_ms", [1, 2, 5, 10])
ENABLE, HALT, QUICK_STOP, DISABLE = 0x0F, 0x10F, 0x02, 0x07
LIMIT = 15_000 * STEP
"""The highest speed of the default pulse timing, in units per second."""


class Planned:
    """The motion that docs/protocol.md promises, in exact arithmetic: units and ms from the tick in which it begins."""

    def __init__(self, points: list[int], period_ms: int) -> None:
        self.period_ms = period_ms
        self.cubics = []
        velocity = Fraction(0)
        history = [points[0], points[0], points[0], *points]
        for p2, p1, p0 in zip(history[1:], history[2:], history[3:], strict=False):
            end_velocity = (Fraction(p0 - p1) + Fraction(p0 - 2 * p1 + p2, 2)) / period_ms
            self.cubics.append(ExactHermite(Fraction(p1), velocity, Fraction(p0), end_velocity, period_ms))
            velocity = end_velocity

    def position(self, t_ms: Fraction) -> Fraction:
        index = int(t_ms // self.period_ms)
        return self.cubics[index].position(t_ms - index * self.period_ms)


def elapsed_ms(board: CyclicBench) -> Fraction:
    """Return the time for which the motion has been computed, since the cubic of the first cycle began."""
    return Fraction(board.firmware.motion.tick - first_tick(board.period_ms), 4)


def sine(peak_hz: float, sine_hz: float, cycles: int, period_ms: int) -> list[int]:
    """Return set-points of A (1 - cos wt) in units, from rest, with a peak speed of `peak_hz` steps/s."""
    omega = 2 * math.pi * sine_hz
    amplitude = peak_hz / omega * STEP
    return [round(amplitude * (1 - math.cos(omega * i * period_ms / 1000))) for i in range(cycles)]


Edges = tuple[list[int], list[int], list[tuple[int, int]]]
"""Rises, falls and DIR edges."""


def both(board: BenchBoard) -> list[Edges]:
    """Return every axis' edges since the last call."""
    axes = []
    for pins in board.firmware.motion.take_edges():
        clk = [int(counts) for counts in pins.clk_counts]
        axes.append((clk[0::2], clk[1::2], [(int(word) >> 1, int(word) & 1) for word in pins.direction]))
    return axes


def edges(board: BenchBoard, axis: int = 0) -> Edges:
    """Return one axis' edges since the last call."""
    return both(board)[axis]


def signs(rises: list[int], directions: list[tuple[int, int]]) -> Iterator[int]:
    """Yield the direction in which each rise moves the motor, by DIR at that time; DIR is low at first."""
    times = [counts for counts, _ in directions]
    levels = [0, *(level for _, level in directions)]
    for rise in rises:
        yield 2 * levels[bisect_right(times, rise)] - 1


def fault_of(board: BenchBoard, axis: int = 0) -> tuple[int, int]:
    """Return code and detail of the last EMCY that reported an error."""
    data = [frame for frame in board.frames(0x090 + axis) if frame[:2] != b"\0\0"][-1]
    return int.from_bytes(data[:2], "little"), int.from_bytes(data[3:], "little")


class TestFollowing:
    @pytest.mark.slow
    @PERIODS
    def test_a_sine_against_exact_arithmetic(self, fast_kernel: Kernel, period_ms: int) -> None:
        """At every tick the demand is within a unit of the exact motion, on the way out and back."""
        points = sine(2000, 2, 1000 // period_ms, period_ms)
        planned = Planned(points, period_ms)
        board = CyclicBench(fast_kernel, period_ms)
        board.follow(points[:2])
        for point in points[2:]:
            board.cycle(point)
            exact_units = planned.position(elapsed_ms(board))
            assert abs(board.firmware.motion.axes[0].demand_units - exact_units) <= 1

    @pytest.mark.slow
    @given(steps=st.lists(st.integers(-300, 300), min_size=4, max_size=25), period_ms=st.integers(1, 10))
    @settings(max_examples=60)
    def test_any_set_points_against_exact_arithmetic(
        self, fast_kernel: Kernel, steps: list[int], period_ms: int
    ) -> None:
        """Accelerations of up to 300 units a period squared, at every tick of every cubic."""
        velocity, points = 0, [0]
        for step in steps:
            velocity += step
            points.append(points[-1] + velocity)
        board = CyclicBench(fast_kernel, period_ms)
        planned = Planned(points, period_ms)
        for i, point in enumerate(points):
            board.cycle(point)
            if i < 2:
                continue
            for _ in range(4 * period_ms - 1):
                board.wait(0.25)
                exact_units = planned.position(elapsed_ms(board))
                assert abs(board.firmware.motion.axes[0].demand_units - exact_units) <= 1

    @PERIODS
    def test_the_deviation_from_the_host_s_own_curve_is_bounded(self, fast_kernel: Kernel, period_ms: int) -> None:
        """The bound is 0.032 T^3 P''' and T^4 P''''/384 between set-points, the chord within a tick, and half a unit.

        In the first two periods the parabola has not seen the sudden acceleration a: that adds up to 0.04 a T^2.
        The peak rate is 14 kHz, the sine has 1 Hz.
        """
        peak_hz, omega, period_s = 14_000.0, 2 * math.pi, period_ms / 1000
        cycles = 1000 // period_ms
        points = sine(peak_hz, 1, cycles, period_ms)
        board = CyclicBench(fast_kernel, period_ms)
        board.follow(points)
        board.settle()
        rises, falls, directions = edges(board)
        assert pin_timing_faults(rises, falls, directions, Timing()) == []
        counter, worst, worst_at_start = 0, 0.0, 0.0
        for rise, sign in zip(rises, signs(rises, directions), strict=True):
            t_s = (rise / 18_000 - first_tick(period_ms)) / 4000 - period_s
            ideal_steps = peak_hz / omega * (1 - math.cos(omega * t_s))
            error = abs(ideal_steps - (counter + sign * 9 / 16))
            counter += sign
            if t_s < 2 * period_s:
                worst_at_start = max(worst_at_start, error)
            elif t_s < (cycles - 2) * period_s:
                worst = max(worst, error)
        assert counter == round(points[-1] / STEP)
        jerk, snap, acceleration = peak_hz * omega**2, peak_hz * omega**3, peak_hz * omega
        arithmetic = 0.5 / STEP + acceleration / 4000**2 / 8 + 0.0003
        assert worst <= 0.032 * jerk * period_s**3 + snap * period_s**4 / 384 + arithmetic
        assert worst_at_start <= 0.04 * acceleration * period_s**2 + arithmetic

    def test_set_points_are_reached_to_the_unit_and_steps_made(self, fast_kernel: Kernel) -> None:
        end = -123 * STEP - 7
        points = [end + round(-end * (1 + math.cos(math.pi * i / 60)) / 2) for i in range(61)]
        board = CyclicBench(fast_kernel, 2)
        board.follow(points)
        board.settle()
        assert (board.value(od.POSITION_DEMAND), board.value(od.POSITION_ACTUAL)) == (end, -123 * STEP)
        assert not board.firmware.motion.axes[0].running
        assert len(edges(board)[0]) == 123

    def test_the_statusword(self, fast_kernel: Kernel) -> None:
        board = CyclicBench(fast_kernel, 5)
        assert board.value(od.SUPPORTED_DRIVE_MODES) & 1 << 7
        assert not board.has(Status.FOLLOWS_COMMAND)
        board.cycle(0)
        assert board.has(Status.FOLLOWS_COMMAND)
        assert board.has(Status.TARGET_REACHED)
        board.follow(ramped(500, 50, 20))
        assert board.has(Status.FOLLOWS_COMMAND)
        assert not board.has(Status.TARGET_REACHED)
        board.settle(1)
        board.write(od.CONTROLWORD, QUICK_STOP)
        assert not board.has(Status.FOLLOWS_COMMAND)

    def test_a_set_point_by_sdo_counts_with_the_next_sync(self, fast_kernel: Kernel) -> None:
        board = CyclicBench(fast_kernel, 10)
        board.settle(1)
        board.write(od.TARGET_POSITION, 3000)
        board.wait(7)
        assert board.value(od.POSITION_DEMAND) == 0
        for _ in range(6):
            board.settle(1)
            board.write(od.TARGET_POSITION, 3000)
        assert board.value(od.POSITION_DEMAND) == 3000

    @pytest.mark.parametrize("word", [0x06, 0x07])
    def test_only_an_enabled_drive_follows(self, fast_kernel: Kernel, word: int) -> None:
        board = CyclicBench(fast_kernel, 1)
        board.write(od.CONTROLWORD, word)
        board.follow(ramped(500, 50, 20))
        assert board.value(od.POSITION_DEMAND) == 0
        assert board.state() is not State.FAULT

    def test_a_target_written_before_enabling_is_no_set_point(self, fast_kernel: Kernel) -> None:
        board = CyclicBench(fast_kernel, 1)
        board.write(od.CONTROLWORD, 0x07)
        board.write(od.TARGET_POSITION, 10**8)
        board.write(od.CONTROLWORD, ENABLE)
        board.settle()
        assert board.state() is State.OPERATION_ENABLED
        assert board.value(od.POSITION_DEMAND) == 0


class TestTiming:
    @PERIODS
    def test_jitter_of_half_a_period_either_way_changes_no_edge(self, fast_kernel: Kernel, period_ms: int) -> None:
        points = sine(5000, 2, 500 // period_ms, period_ms)
        drawn = random.Random(period_ms)
        runs = []
        for jitter_counts in (0, period_ms * MS // 2 - 100):
            board = CyclicBench(fast_kernel, period_ms)
            for i, point in enumerate(points):
                board.cycle(point, late_counts=round(drawn.uniform(-1, 1) * jitter_counts) if i else 0)
            board.settle()
            runs.append(edges(board))
        assert len(runs[0][0]) > 1500
        assert runs[0] == runs[1]

    def test_a_sync_later_than_half_a_period_is_lost(self, fast_kernel: Kernel) -> None:
        """On a parabola the bridge is wrong by the acceleration, so that a lost set-point shows."""
        points = [50 * i * i for i in range(20)]
        runs = []
        for late_ms in (0, 4.9, 5.1):
            board = CyclicBench(fast_kernel, 10)
            for i, point in enumerate(points):
                board.cycle(point, late_counts=round(late_ms * MS) if i == 10 else 0)
            board.settle()
            runs.append(edges(board))
        assert runs[0] == runs[1]
        assert runs[2] != runs[0]

    @pytest.mark.parametrize("anchor", [-1, 1])
    @pytest.mark.parametrize("period_ms", [1, 10])
    def test_jitter_of_the_first_sync_too(self, fast_kernel: Kernel, period_ms: int, anchor: int) -> None:
        """SYNCs come up to a quarter of a period early or late. If the first is the worst, the slots are moved."""
        board = CyclicBench(fast_kernel, period_ms)
        drawn = random.Random(7)
        quarter = period_ms * MS / 4
        for i, point in enumerate(ramped(2000 * period_ms, 10 * period_ms, 800)):
            board.cycle(point, late_counts=round(quarter * (drawn.uniform(-1, 1) if i else anchor)))
            if i > 210:
                assert board.value(od.VELOCITY_ACTUAL) == pytest.approx(2_000_000, rel=1 / 200)
        assert board.state() is State.OPERATION_ENABLED

    @pytest.mark.slow
    @pytest.mark.parametrize("ppm", [-300, 300])
    @pytest.mark.parametrize(("period_ms", "seconds"), [(1, 4), (10, 40)])
    def test_drift(self, fast_kernel: Kernel, period_ms: int, seconds: int, ppm: int) -> None:
        """The clocks drift by more than a period: the axis stays within an eighth of a period and a little."""
        board = CyclicBench(fast_kernel, period_ms, ppm=ppm)
        points = ramped(500 * period_ms, 10 * period_ms, 1000 * seconds // period_ms)
        delay_ms = first_tick(period_ms) / 4 + period_ms - FIRST_SYNC_COUNTS / MS
        worst_ms = 0.0
        for i, point in enumerate(points):
            board.cycle(point)
            if i > 60 and i % 7 == 0:
                assert board.value(od.VELOCITY_ACTUAL) == pytest.approx(500_000, rel=1 / 200)
                to_go_ms = (point - board.firmware.motion.axes[0].demand_units) / 500
                since_sync_ms = board.firmware.motion.tick / 4 - board.now / MS
                worst_ms = max(worst_ms, abs(since_sync_ms + to_go_ms - delay_ms))
        assert seconds * abs(ppm) / 1000 > period_ms
        assert worst_ms <= period_ms * (1 / 8 + 0.06) + 0.01
        board.settle()
        assert board.value(od.POSITION_DEMAND) == points[-1]
        assert board.errors() == []


class TestLosses:
    def moving(self, kernel: Kernel) -> CyclicBench:
        board = CyclicBench(kernel, 5)
        board.write(od.QUICK_STOP_DECELERATION, 40_000_000)
        board.follow(ramped(3000, 100, 60))
        return board

    def go_on(self, board: CyclicBench, cycles: int = 1) -> None:
        """The set-points that the host would send next, had it sent all before."""
        for _ in range(cycles):
            board.cycle(self.due_point(board))

    def due_point(self, board: CyclicBench) -> int:
        return ramped(3000, 100, board.cycles)[-1]

    @pytest.mark.parametrize("lost", [1, 2, 3])
    @pytest.mark.parametrize("sync", [False, True])
    def test_up_to_three_are_bridged_at_the_same_velocity(self, fast_kernel: Kernel, lost: int, sync: bool) -> None:
        board = self.moving(fast_kernel)
        for _ in range(lost):
            board.cycle(None, sync=sync)
        for _ in range(8):
            self.go_on(board)
            assert board.value(od.VELOCITY_ACTUAL) == 600_000
        board.settle()
        assert board.state() is State.OPERATION_ENABLED

    @pytest.mark.parametrize(("sync", "detail"), [(False, NO_SYNC), (True, NO_SET_POINT)])
    def test_the_fourth_in_a_row_is_a_fault(self, fast_kernel: Kernel, sync: bool, detail: int) -> None:
        board = self.moving(fast_kernel)
        for _ in range(5):
            board.cycle(None, sync=sync)
        assert board.value(od.VELOCITY_ACTUAL) < 600_000
        assert board.state() is State.FAULT_REACTION_ACTIVE
        board.wait(100)
        assert board.state() is State.FAULT
        assert fault_of(board) == (ErrorCode.SYNC_CONTROLLER, detail)
        for word in (0x80, 0x06, 0x07, 0x0F):
            board.write(od.CONTROLWORD, word)
        board.skip()
        board.follow(ramped(-3000, 100, 60, board.value(od.POSITION_DEMAND)))
        assert board.value(od.VELOCITY_ACTUAL) == -600_000

    @pytest.mark.parametrize(("every", "fails"), [(4, False), (3, True)])
    def test_one_in_four_may_be_lost_for_ever(self, fast_kernel: Kernel, every: int, fails: bool) -> None:
        board = self.moving(fast_kernel)
        for i in range(120):
            board.cycle(None if i % every == 0 else self.due_point(board))
        assert (board.state() is State.FAULT) is fails

    def test_at_rest_set_points_need_not_come(self, fast_kernel: Kernel) -> None:
        board = CyclicBench(fast_kernel, 5)
        board.settle(100)
        assert board.has(Status.FOLLOWS_COMMAND)
        board.follow(ramped(300, 30, 20))
        board.follow([ramped(300, 30, 20)[-1]])
        board.settle(100)
        assert board.has(Status.FOLLOWS_COMMAND)
        assert board.state() is State.OPERATION_ENABLED

    def test_at_rest_an_axis_without_sync_ceases_to_follow(self, fast_kernel: Kernel) -> None:
        board = CyclicBench(fast_kernel, 5)
        board.settle(10)
        board.wait(12)
        assert board.has(Status.FOLLOWS_COMMAND)
        board.wait(15)
        assert not board.has(Status.FOLLOWS_COMMAND)
        assert board.state() is State.OPERATION_ENABLED
        assert board.errors() == []
        board.skip()
        board.follow(ramped(300, 30, 20))
        board.settle()
        assert board.value(od.POSITION_DEMAND) == ramped(300, 30, 20)[-1]

    def test_the_wrong_period_is_noticed(self, fast_kernel: Kernel) -> None:
        board = CyclicBench(fast_kernel, 10)
        board.write(od.INTERPOLATION_PERIOD, 5)
        board.follow(ramped(3000, 100, 60))
        assert board.state() is State.FAULT
        assert fault_of(board) == (ErrorCode.SYNC_CONTROLLER, NO_SYNC)


class TestSpeed:
    @PERIODS
    @pytest.mark.parametrize("sign", [1, -1])
    @pytest.mark.parametrize(("excess", "fails"), [(0, False), (1, True)])
    def test_both_sides_of_the_limit(
        self, fast_kernel: Kernel, period_ms: int, sign: int, excess: int, fails: bool
    ) -> None:
        """15 kHz are 15 360 units per ms. The set-points approach that slowly; the last one is a unit too far."""
        limit = LIMIT // 1000 * period_ms
        board = CyclicBench(fast_kernel, period_ms)
        points = ramped(sign * limit, limit // 30, 80)
        board.follow([*points, points[-1] + sign * (limit + excess)])
        board.wait(period_ms)
        assert (board.errors() == [ErrorCode.OVERSPEED]) is fails

    def test_the_limit_of_607f(self, fast_kernel: Kernel) -> None:
        board = CyclicBench(fast_kernel, 1)
        board.write(od.CONTROLWORD, 0)
        board.write(od.MAX_PROFILE_VELOCITY, 2_000_000)
        board.enable(Mode.CYCLIC_SYNCHRONOUS_POSITION)
        points = ramped(2000, 20, 150)
        board.follow(points)
        board.wait(2)
        assert board.value(od.VELOCITY_ACTUAL) == 2_000_000
        assert board.state() is State.OPERATION_ENABLED
        board.follow(ramped(2001, 2001, 3, points[-1])[1:])
        board.wait(3)
        assert fault_of(board) == (ErrorCode.OVERSPEED, 0)

    @pytest.mark.parametrize("first", [10**6, -(10**6), 2**31 - 1, -(2**31)])
    def test_a_first_set_point_far_away_is_a_fault_not_a_jump(self, fast_kernel: Kernel, first: int) -> None:
        board = CyclicBench(fast_kernel, 10)
        board.follow([first, first])
        assert board.state() is State.FAULT
        assert fault_of(board)[0] == ErrorCode.OVERSPEED
        assert board.value(od.POSITION_DEMAND) == 0

    @pytest.mark.parametrize(("units", "behind"), [(102_400, 0), (153_600, 51_200)])
    def test_where_a_cubic_would_be_too_fast_the_axis_falls_behind(
        self, fast_kernel: Kernel, units: int, behind: int
    ) -> None:
        """From rest, 2/3 of the way at the limit L: v0 = 0, v1 = L and 3 D/T - v0 - v1 <= L. Then it catches up."""
        board = CyclicBench(fast_kernel, 10)
        board.follow([0, units])
        board.settle(1)
        board.until(18_000 * (first_tick(10) + 80))
        assert units - board.value(od.POSITION_DEMAND) == pytest.approx(behind, abs=2)
        assert board.value(od.VELOCITY_ACTUAL) == pytest.approx(LIMIT, rel=0.001)
        board.settle()
        assert board.value(od.POSITION_DEMAND) == units
        assert board.state() is State.OPERATION_ENABLED

    def test_an_axis_that_never_catches_up_trips_for_overspeed(self, fast_kernel: Kernel) -> None:
        """The host's clock is 2000 ppm fast, so its set-points at the limit are too fast by that."""
        board = CyclicBench(fast_kernel, 10, ppm=-2000)
        points = ramped(LIMIT // 100, LIMIT // 1000, 700)
        board.follow(points[:300])
        assert board.state() is State.OPERATION_ENABLED
        board.follow(points[300:])
        assert fault_of(board)[0] == ErrorCode.OVERSPEED


class TestSoftLimits:
    @pytest.mark.parametrize("sign", [1, -1])
    @pytest.mark.parametrize(("period_ms", "peak_hz"), [(1, 3000), (5, 9000), (10, 14_000)])
    def test_a_sine_beyond_the_limits_stops_at_them(
        self, fast_kernel: Kernel, sign: int, period_ms: int, peak_hz: float
    ) -> None:
        """Above 2/3 of the axis' speed no cubic ends at the limit in time: the axis falls behind."""
        points = [sign * point for point in sine(peak_hz, 2, 500 // period_ms, period_ms)]
        limit = sign * max(abs(point) for point in points) // 2
        board = CyclicBench(fast_kernel, period_ms)
        board.write(od.POSITION_LIMIT_MAX if sign > 0 else od.POSITION_LIMIT_MIN, limit)
        reached = set()
        for point in points:
            board.cycle(point)
            for _ in range(4 * period_ms - 1):
                board.wait(0.25)
                demand = board.firmware.motion.axes[0].demand_units
                assert demand * sign <= limit * sign
                reached.add(demand)
            if board.has(Status.INTERNAL_LIMIT):
                assert abs(point) > abs(limit) or abs(points[board.cycles - 2]) > abs(limit)
        assert limit in reached
        board.settle()
        assert not board.has(Status.INTERNAL_LIMIT)
        assert board.value(od.POSITION_DEMAND) == points[-1]
        assert board.state() is State.OPERATION_ENABLED

    def test_bit_11_is_set_while_set_points_are_beyond_a_limit(self, fast_kernel: Kernel) -> None:
        board = CyclicBench(fast_kernel, 1)
        board.write(od.POSITION_LIMIT_MAX, 10_000)
        points = ramped(100, 10, 200)
        board.follow(points)
        board.wait(2)
        assert board.has(Status.INTERNAL_LIMIT)
        assert board.value(od.POSITION_DEMAND) == 10_000
        board.follow([points[-1] - 100 * i for i in range(150)])
        board.settle()
        assert not board.has(Status.INTERNAL_LIMIT)

    def test_an_axis_that_stands_beyond_may_come_back_and_not_go_further(self, fast_kernel: Kernel) -> None:
        board = CyclicBench(fast_kernel, 1)
        board.write(od.POSITION_LIMIT_MAX, -5000)
        board.follow([0, 100, 200, 300])
        board.wait(2)
        assert board.value(od.POSITION_DEMAND) == 0
        assert board.has(Status.INTERNAL_LIMIT)
        board.follow([0, *ramped(-200, 20, 60)])
        board.settle()
        assert board.value(od.POSITION_DEMAND) == ramped(-200, 20, 60)[-1]


class TestStops:
    """At 600 000 units/s the ramps take 30 ms (profile deceleration) and 15 ms (quick stop deceleration)."""

    @pytest.fixture
    def moving(self, fast_kernel: Kernel) -> CyclicBench:
        board = CyclicBench(fast_kernel, 5)
        board.write(od.PROFILE_DECELERATION, 20_000_000)
        board.write(od.QUICK_STOP_DECELERATION, 40_000_000)
        board.follow(ramped(3000, 100, 60))
        return board

    def goes_on(self, board: CyclicBench, cycles: int) -> None:
        """The host goes on sending set-points."""
        for _ in range(cycles):
            board.cycle(ramped(3000, 100, board.cycles)[-1])

    @pytest.mark.parametrize(("option", "ramp_ms"), [(1, 30), (2, 15)])
    def test_halt_ramps_and_holds(self, moving: CyclicBench, option: int, ramp_ms: int) -> None:
        moving.write(od.HALT_OPTION, option)
        moving.write(od.CONTROLWORD, HALT)
        assert not moving.has(Status.FOLLOWS_COMMAND)
        moving.wait(ramp_ms - 1)
        assert moving.value(od.VELOCITY_ACTUAL) > 0
        assert not moving.has(Status.TARGET_REACHED)
        moving.wait(2)
        assert moving.value(od.VELOCITY_ACTUAL) == 0
        assert moving.has(Status.TARGET_REACHED)
        moving.skip()
        here = moving.value(od.POSITION_DEMAND)
        self.goes_on(moving, 20)
        assert moving.value(od.POSITION_DEMAND) == here
        assert moving.state() is State.OPERATION_ENABLED

    def test_after_a_halt_the_host_must_start_from_the_position(self, moving: CyclicBench) -> None:
        moving.write(od.CONTROLWORD, HALT)
        self.goes_on(moving, 20)
        moving.write(od.CONTROLWORD, ENABLE)
        moving.follow(ramped(3000, 100, 60, moving.value(od.POSITION_DEMAND)))
        assert moving.has(Status.FOLLOWS_COMMAND)
        assert moving.value(od.VELOCITY_ACTUAL) == 600_000

    def test_a_host_that_starts_elsewhere_is_stopped(self, moving: CyclicBench) -> None:
        moving.write(od.CONTROLWORD, HALT)
        self.goes_on(moving, 60)
        moving.write(od.CONTROLWORD, ENABLE)
        here = moving.value(od.POSITION_DEMAND)
        self.goes_on(moving, 3)
        assert fault_of(moving)[0] == ErrorCode.OVERSPEED
        assert moving.value(od.POSITION_DEMAND) == here

    def test_a_halt_released_during_its_ramp_lets_that_end_first(self, moving: CyclicBench) -> None:
        moving.write(od.CONTROLWORD, HALT)
        moving.cycle(None)
        moving.write(od.CONTROLWORD, ENABLE)
        self.goes_on(moving, 2)
        assert not moving.has(Status.FOLLOWS_COMMAND)
        assert 0 < moving.value(od.VELOCITY_ACTUAL) < 600_000

    def test_halt_at_rest(self, fast_kernel: Kernel) -> None:
        board = CyclicBench(fast_kernel, 5)
        board.settle()
        board.write(od.CONTROLWORD, HALT)
        board.follow(ramped(3000, 100, 10))
        assert board.value(od.POSITION_DEMAND) == 0
        assert board.has(Status.TARGET_REACHED)

    @pytest.mark.parametrize(
        ("word", "ramp_ms", "end"),
        [(QUICK_STOP, 15, State.SWITCH_ON_DISABLED), (DISABLE, 30, State.SWITCHED_ON)],
    )
    def test_quick_stop_and_disable(self, moving: CyclicBench, word: int, ramp_ms: int, end: State) -> None:
        before = moving.value(od.POSITION_DEMAND)
        moving.write(od.CONTROLWORD, word)
        self.goes_on(moving, 10)
        assert moving.state() is end
        assert moving.value(od.POSITION_DEMAND) - before == pytest.approx(600 * ramp_ms / 2, rel=0.05)

    def test_the_limit_switch(self, moving: CyclicBench) -> None:
        moving.set_inputs(DigitalInput.POSITIVE_LIMIT)
        self.goes_on(moving, 5)
        assert moving.state() is State.FAULT
        assert fault_of(moving) == (ErrorCode.LIMIT_SWITCH, 1)


class TestModes:
    def test_only_at_rest(self, fast_kernel: Kernel) -> None:
        board = CyclicBench(fast_kernel, 5)
        board.follow(ramped(3000, 100, 60))
        assert board.write(od.MODE_OF_OPERATION, Mode.PROFILE_POSITION) == AbortCode.DEVICE_STATE
        assert board.has(Status.FOLLOWS_COMMAND)
        board.follow([board.value(od.TARGET_POSITION)] * 5)
        assert board.write(od.MODE_OF_OPERATION, Mode.PROFILE_POSITION) == 0
        board.write(od.TARGET_POSITION, 0)
        board.write(od.CONTROLWORD, 0x1F)
        board.settle(400)
        assert board.value(od.POSITION_DEMAND) == 0
        assert board.write(od.MODE_OF_OPERATION, Mode.CYCLIC_SYNCHRONOUS_POSITION) == 0
        board.follow(ramped(3000, 100, 60))
        assert board.value(od.VELOCITY_ACTUAL) == 600_000

    def test_waiting_records_are_dropped(self, fast_kernel: Kernel) -> None:
        board = CyclicBench(fast_kernel, 5)
        board.record(50 * STEP, 0, 50, 0)
        board.follow(ramped(3000, 100, 10))
        board.settle()
        assert board.value(od.POSITION_DEMAND) == ramped(3000, 100, 10)[-1]
        assert board.value(od.PVT_FREE_RECORDS) == 0

    @pytest.mark.parametrize("value", [0, 11])
    def test_periods_that_are_not_offered(self, fast_kernel: Kernel, value: int) -> None:
        board = BenchBoard(fast_kernel)
        assert board.write(od.INTERPOLATION_PERIOD, value) in (AbortCode.VALUE_TOO_LOW, AbortCode.VALUE_TOO_HIGH)

    def test_the_period_is_fixed_while_the_axis_follows(self, fast_kernel: Kernel) -> None:
        board = CyclicBench(fast_kernel, 5)
        board.settle()
        assert board.write(od.INTERPOLATION_PERIOD, 4) == AbortCode.DEVICE_STATE
        board.write(od.MODE_OF_OPERATION, Mode.NONE)
        assert board.write(od.INTERPOLATION_PERIOD, 4) == 0


class TestGroup:
    def test_axes_are_in_step_whenever_they_join(self, fast_kernel: Kernel) -> None:
        """The second axis joins while the first one moves, with a SYNC that comes early."""
        board = CyclicBench(fast_kernel, 2, axes=2)
        board.write(od.CONTROLWORD, DISABLE, 1)
        way = [round(200 * STEP * (1 - math.cos(math.pi * i / 40)) / 2) for i in range(41)]
        for i, point in enumerate(way):
            if i == 20:
                board.write(od.CONTROLWORD, ENABLE, 1)
            board.cycle(point, None, late_counts=-MS // 2 if i == 20 else 0)
        board.settle()
        assert len(edges(board, 0)[0]) == 200
        for point in way:
            board.cycle(200 * STEP + point, point)
        board.settle()
        (first, *_), (second, *_) = both(board)
        assert len(first) == 200
        assert first[1:] == second[1:]  # the second axis had to set DIR before its very first step

    def test_an_axis_at_rest_starts_in_the_same_tick_whether_others_move_or_not(self, fast_kernel: Kernel) -> None:
        way = [0] * 20 + [round(200 * STEP * (1 - math.cos(math.pi * i / 40)) / 2) for i in range(41)]
        runs = []
        for other in (0, 1):
            board = CyclicBench(fast_kernel, 2, axes=2)
            for i, point in enumerate(way):
                board.cycle(other * 500 * i, point)
            board.settle(3)
            runs.append(edges(board, 1))
        assert len(runs[0][0]) == 200
        assert runs[0] == runs[1]

    def test_a_fault_of_one_stops_all_in_the_same_time(self, fast_kernel: Kernel) -> None:
        board = CyclicBench(fast_kernel, 5, axes=3)
        for axis in range(3):
            board.write(od.QUICK_STOP_DECELERATION, 40_000_000, axis)
        points = ramped(3000, 100, 60)
        for point in points:
            board.cycle(point, -point // 2, None)
        board.cycle(10**8, -points[-1] // 2 - 1500, None)
        board.wait(5)
        assert [board.state(axis) for axis in range(2)] == [State.FAULT_REACTION_ACTIVE] * 2
        assert board.state(2) is State.FAULT
        while board.state(0) is not State.FAULT:
            assert board.state(1) is State.FAULT_REACTION_ACTIVE
            assert board.value(od.VELOCITY_ACTUAL, 1) == pytest.approx(-board.value(od.VELOCITY_ACTUAL) / 2, abs=20)
            board.wait(0.25)
        assert board.state(1) is State.FAULT
        assert [fault_of(board, axis)[0] for axis in range(3)] == [
            ErrorCode.OVERSPEED,
            ErrorCode.GROUP_STOPPED,
            ErrorCode.GROUP_STOPPED,
        ]

    def test_one_sync_has_one_period(self, fast_kernel: Kernel) -> None:
        board = CyclicBench(fast_kernel, 5, axes=2)
        board.write(od.INTERPOLATION_PERIOD, 4, 1)
        board.settle(2)
        assert fault_of(board, 1) == (ErrorCode.PARAMETER, 4)


AXES = 2
Point = int | Fraction | None
Cycle = tuple[list[Point], bool, float]
"""The set-points of a cycle, whether its SYNC is sent, and how late it is in periods.

A set-point is in units, or a fraction: its distance from the previous one, as a part of the greatest in a period.
"""


def cycles(points: st.SearchStrategy[Point], syncs: list[bool]) -> st.SearchStrategy[Cycle]:
    each = st.lists(points, min_size=AXES, max_size=AXES)
    return st.tuples(each, st.sampled_from(syncs), st.floats(-0.49, 0.49))


wild = cycles(st.one_of(st.none(), st.integers(-(2**31), 2**31 - 1)), [True, False])
shares = st.fractions(-1, 1, max_denominator=100)
tame = cycles(st.one_of(*[shares] * 6, st.sampled_from([None, None, Fraction(101, 100)])), [True] * 9 + [False])
CAUSES = {ErrorCode.OVERSPEED, ErrorCode.SYNC_CONTROLLER, ErrorCode.GROUP_STOPPED}


@pytest.mark.slow
@given(
    script=st.one_of(st.lists(wild, max_size=20), st.lists(tame, min_size=12, max_size=60)),
    period_ms=st.integers(1, 10),
    microsteps=st.sampled_from([1, 2, 8, 16]),
    speed=st.sampled_from([50_001, 3_333_333, 2**32 - 1]),
    limits=st.tuples(st.integers(-300_000, 0), st.integers(0, 300_000)),
)
@settings(max_examples=100)
def test_any_cycles_are_followed_or_end_in_a_reported_fault(
    fast_kernel: Kernel,
    script: list[Cycle],
    period_ms: int,
    microsteps: int,
    speed: int,
    limits: tuple[int, int],
) -> None:
    """The axes are never too fast, pass a soft limit only in a fault's ramp, and keep the driver's pulse timing."""
    board = CyclicBench(fast_kernel, period_ms, AXES)
    for axis in range(AXES):
        board.write(od.CONTROLWORD, 0, axis)
        for address, value in (
            (od.MICROSTEPS, microsteps),
            (od.MAX_PROFILE_VELOCITY, speed),
            (od.POSITION_LIMIT_MIN, limits[0]),
        ):
            assert board.write(address, value, axis) == 0
        assert board.write(od.POSITION_LIMIT_MAX, limits[1], axis) == 0
    board.enable(Mode.CYCLIC_SYNCHRONOUS_POSITION)
    motion = board.firmware.motion
    fastest = motion.axes[0].config.rate_limit_q16_per_ms / (4 * microsteps)
    reach = math.floor(fastest * period_ms)
    points: list[int | None] = [0] * AXES
    for values, sync, late in script:
        for axis, point in enumerate(values):
            last = board.held[axis] or 0
            points[axis] = last + int(point * reach) if isinstance(point, Fraction) else point
        board.cycle(*points, sync=sync, late_counts=round(late * period_ms * MS))
        for axis in range(AXES):
            assert abs(motion.axes[axis].velocity) <= 64 * fastest + 1
            if board.state(axis) is State.OPERATION_ENABLED:
                assert limits[0] <= motion.axes[axis].demand_units <= limits[1]
    board.wait(20 * period_ms)
    for axis in range(AXES):
        board.write(od.CONTROLWORD, DISABLE, axis)
    board.wait(2000)
    for axis, (rises, falls, directions) in enumerate(both(board)):
        assert not motion.axes[axis].running
        assert pin_timing_faults(rises, falls, directions, Timing()) == []
        assert sum(signs(rises, directions)) == motion.axes[axis].counter_steps
        assert set(board.errors(axis)) <= CAUSES
        assert board.state(axis) in (State.SWITCHED_ON, State.FAULT)
        assert (board.state(axis) is State.FAULT) is bool(board.errors(axis))


@pytest.mark.slow
@given(
    ways=st.lists(st.one_of(shares, st.sampled_from([Fraction(-1), Fraction(0), Fraction(1)])), max_size=60),
    period_ms=st.integers(1, 10),
)
def test_set_points_within_the_axis_speed_are_never_a_fault(
    fast_kernel: Kernel, ways: list[Fraction], period_ms: int
) -> None:
    """Full reversals from one period to the next: the axis may fall behind by less than a period, and catches up."""
    reach = LIMIT // 1000 * period_ms
    points = list(accumulate((int(way * reach) for way in ways), initial=0))
    board = CyclicBench(fast_kernel, period_ms)
    board.follow(points)
    board.settle(6)
    assert board.errors() == []
    assert board.value(od.POSITION_DEMAND) == points[-1]


@pytest.mark.parametrize("period_ms", [1, 10])
def test_full_reversals_at_the_axis_speed_are_no_fault(fast_kernel: Kernel, period_ms: int) -> None:
    ways = [Fraction(way) for way in (1, -1, 1, 1, -1, -1, 0, 1)]
    one_example(test_set_points_within_the_axis_speed_are_never_a_fault, fast_kernel, ways=ways, period_ms=period_ms)


def test_some_cycles_are_followed_and_some_end_in_a_reported_fault(fast_kernel: Kernel) -> None:
    """Up to a soft limit with one SYNC lost and one late; then far away."""
    followed: list[Cycle] = [
        ([Fraction(1, 2), Fraction(-1, 3)], number != 9, 0.3 * (number % 3 - 1)) for number in range(30)
    ]
    for script in (followed, [*followed, ([2**31 - 1, None], True, 0.0)]):
        one_example(
            test_any_cycles_are_followed_or_end_in_a_reported_fault,
            fast_kernel, script=script, period_ms=2, microsteps=8, speed=3_333_333, limits=(-100_000, 50_000),
        )  # fmt: skip
