"""Homing through the whole firmware, on a machine with switches, compared with the figures of CiA 402-2."""

from collections.abc import Callable
from dataclasses import dataclass

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel, python_kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import AbortConnection, DigitalInput, ErrorCode, HomingError, Mode, State, Status
from steptwin.protocol.homing_methods import HOMING_METHODS
from steptwin.protocol.sdo_frames import AbortCode
from tests.controller.bench_board import BenchBoard
from tests.controller.modes.homing_bench import (
    ACCELERATION_STEPS_PER_S2,
    FAST_STEPS_PER_S,
    HALT,
    SLOW_STEPS_PER_S,
    START,
    HomingBench,
    Slider,
)
from tests.controller.units import STEP

NEGATIVE, POSITIVE, HOME = DigitalInput.NEGATIVE_LIMIT, DigitalInput.POSITIVE_LIMIT, DigitalInput.HOME
LEFT, RIGHT = -400, 400
"""The limit switches are closed at these positions and beyond."""
FIRST, LAST = -20, 30
"""The home switch of methods 23 to 30 is closed between these; that is less than the distance of a stop from fast."""
EDGE = 10
"""The home switch of methods 19 and 20 is closed from this position on, that of 21 and 22 up to it."""

FIGURES: dict[int, tuple[int, int]] = {
    17: (LEFT + 1, 1),
    18: (RIGHT - 1, -1),
    19: (EDGE - 1, -1),
    20: (EDGE, 1),
    21: (EDGE + 1, 1),
    22: (EDGE, -1),
    23: (FIRST - 1, -1),
    24: (FIRST, 1),
    25: (LAST, -1),
    26: (LAST + 1, 1),
    27: (LAST + 1, 1),
    28: (LAST, -1),
    29: (FIRST, 1),
    30: (FIRST - 1, -1),
}
"""The step on which a method's edge is seen, and in which direction the axis crosses it."""

FIRST_MOVES = {
    17: {-420: 1, 0: -1, 420: -1},
    18: {-420: 1, 0: 1, 420: -1},
    19: {-300: 1, 300: -1},
    20: {-300: 1, 300: -1},
    21: {-300: 1, 300: -1},
    22: {-300: 1, 300: -1},
    23: {-300: 1, 5: -1, 300: 1},
    24: {-300: 1, 5: -1, 300: 1},
    25: {-300: 1, 5: 1, 300: 1},
    26: {-300: 1, 5: 1, 300: 1},
    27: {-300: -1, 5: 1, 300: -1},
    28: {-300: -1, 5: 1, 300: -1},
    29: {-300: -1, 5: -1, 300: -1},
    30: {-300: -1, 5: -1, 300: -1},
}
"""The direction in which a method moves first, by its start."""

STARTS = (-440, -400, -399, -200, 200, 399, 400, 440)
AT_THE_EDGE, AT_THE_SWITCH = (9, 10, 11), (-21, -20, 10, 30, 31)
"""Starts on both sides of what a method uses: the limits' edges, the home switch's edge, or its two edges."""

MOMENTS_MS = [pytest.param(ms, marks=[pytest.mark.slow] if ms % 60 else []) for ms in range(0, 400, 20)]
"""Moments of a homing that takes 0.4 s."""

SPEED_SLACK = 26
"""Most that the profile's rounding to whole units may add to a speed, in 1/64 unit per ms."""


def machine(method: int, position: int) -> Slider:
    """Return a slider with limit switches at both ends and the home switch of a method."""
    home: Callable[[int], bool] = {
        19: lambda p: p >= EDGE,
        20: lambda p: p >= EDGE,
        21: lambda p: p <= EDGE,
        22: lambda p: p <= EDGE,
    }.get(method, lambda p: FIRST <= p <= LAST)
    return Slider(position, {NEGATIVE: lambda p: p <= LEFT, POSITIVE: lambda p: p >= RIGHT, HOME: home})


def bench_for(kernel: Kernel, method: int, position: int, **switches: Callable[[int], bool]) -> HomingBench:
    """Return a bench with that slider; `switches` replace some of its switches."""
    slider = machine(method, position)
    slider.switches |= {DigitalInput[name]: closed for name, closed in switches.items()}
    return HomingBench(kernel, slider)


def speed(steps_per_s: int) -> int:
    return steps_per_s * STEP * 64 // 1000


class TestMethods:
    @pytest.mark.slow
    @pytest.mark.parametrize("method", FIGURES)
    def test_home_is_the_same_step_wherever_the_axis_starts(self, fast_kernel: Kernel, method: int) -> None:
        edge, _ = FIGURES[method]
        home = () if method < 19 else AT_THE_EDGE if method < 23 else AT_THE_SWITCH
        for start in (*STARTS, *home):
            bench = bench_for(fast_kernel, method, start)
            bench.home(method)
            assert bench.zero_steps == edge, start

    @pytest.mark.parametrize(
        ("method", "start"), [(method, start) for method, starts in FIRST_MOVES.items() for start in starts]
    )
    def test_two_speeds_and_one_acceleration(self, fast_kernel: Kernel, method: int, start: int) -> None:
        """It goes first where the figure says, and the last stroke crosses the edge slowly.

        No stroke exceeds its speed or acceleration. The edge is seen in the tick after its step.
        """
        bench = bench_for(fast_kernel, method, start)
        bench.home(method)
        edge, direction = FIGURES[method]
        assert bench.zero_steps == edge
        assert bench.rises[0][1] == FIRST_MOVES[method][start]
        self.edge_is_seen_within_the_slow_stroke(bench, start, edge, direction)
        *searching, crossing = bench.strokes()
        assert crossing[0] * FIGURES[method][1] > 0
        assert speed(SLOW_STEPS_PER_S) - 1 <= max(map(abs, crossing)) <= speed(SLOW_STEPS_PER_S) + SPEED_SLACK
        fastest = max(abs(velocity) for stroke in searching for velocity in stroke)
        assert fastest <= speed(FAST_STEPS_PER_S) + SPEED_SLACK
        assert fastest >= speed(FAST_STEPS_PER_S) - 1 or start == 5  # from there the distance is too short
        steepest = ACCELERATION_STEPS_PER_S2 * STEP * 64 // 1_000_000 // 4
        pairs = zip([0, *bench.velocities], [*bench.velocities, 0], strict=True)
        assert max(abs(later - earlier) for earlier, later in pairs) <= steepest + 4

    def edge_is_seen_within_the_slow_stroke(self, bench: HomingBench, start: int, edge: int, direction: int) -> None:
        """Its last pass is the edge, whatever the ramp behind it may pass."""
        path = [start]
        for _, sign in bench.rises:
            path.append(path[-1] + sign)
        last_pass = max(i for i, place in enumerate(path[1:]) if (place, bench.rises[i][1]) == (edge, direction))
        seen = -(-(bench.rises[last_pass][0] + 1) // 18_000) * 18_000
        assert seen in [counts for counts, _ in bench.edges]
        assert all(sign == direction for _, sign in bench.rises[last_pass:])

    @pytest.mark.parametrize("method", [35, 37])
    def test_methods_35_and_37_home_where_the_axis_stands(self, fast_kernel: Kernel, method: int) -> None:
        bench = bench_for(fast_kernel, method, 123)
        bench.home(method, offset_units=-1500)
        assert (bench.value(od.POSITION_DEMAND), bench.rises) == (-1500, [])

    def test_only_these_methods_are_supported(self, fast_kernel: Kernel) -> None:
        bench = bench_for(fast_kernel, 17, 0)
        taken = [method for method in range(-128, 128) if bench.write(od.HOMING_METHOD, method) == 0]
        listed = [bench.value(address) for address in od.SUPPORTED_HOMING_METHODS]
        assert listed == list(HOMING_METHODS) == [*range(17, 31), 35, 37]
        assert taken == [0, *listed]  # 0 is "no homing method"
        assert bench.write(od.HOMING_METHOD, 33) == AbortCode.VALUE_RANGE

    def test_both_kernels_home_in_the_same_way_and_each_time(self, fast_kernel: Kernel) -> None:
        runs = []
        for each in (python_kernel(), fast_kernel, fast_kernel):
            bench = bench_for(each, 25, -200)
            bench.home(25)
            runs.append((bench.rises, bench.edges, bench.sent))
        assert runs[0] == runs[1] == runs[2]


@dataclass
class Sticky:
    """A switch with hysteresis, as real ones have: it opens some steps farther out than it closes."""

    first: int
    last: int
    hysteresis: int
    closed: bool = False

    def __call__(self, position: int) -> bool:
        spare = self.hysteresis if self.closed else 0
        self.closed = self.first - spare <= position <= self.last + spare
        return self.closed


@pytest.mark.slow
@settings(max_examples=40)
@given(
    method=st.sampled_from(sorted(FIGURES)),
    starts=st.lists(st.integers(-1_300, 1_300), min_size=2, max_size=2, unique=True),
    first=st.integers(-300, 300),
    width=st.integers(30, 400),
    hysteresis=st.integers(0, 20),
    fast=st.integers(1_000, 10_000),
    slow=st.integers(300, 3_900),
    acceleration=st.integers(100_000, 400_000),
)
def test_home_repeats_within_one_step(
    fast_kernel: Kernel,
    method: int,
    starts: list[int],
    first: int,
    width: int,
    hysteresis: int,
    fast: int,
    slow: int,
    acceleration: int,
) -> None:
    """From two starts anywhere, past a switch with hysteresis, at any speeds up to one step a tick for the slow one."""
    zeros = []
    for start in starts:
        closed = {19: (first, 10**6), 20: (first, 10**6), 21: (-(10**6), first), 22: (-(10**6), first)}
        bounds = closed.get(method, (first, first + width))
        switches: dict[DigitalInput, Callable[[int], bool]] = {
            NEGATIVE: Sticky(-(10**6), -1_000, hysteresis),
            POSITIVE: Sticky(1_000, 10**6, hysteresis),
            HOME: Sticky(*bounds, hysteresis),
        }
        bench = HomingBench(fast_kernel, Slider(start, switches))
        bench.write(od.HOMING_SEARCH_SPEED, fast * STEP)
        bench.write(od.HOMING_ZERO_SPEED, slow * STEP)
        bench.write(od.HOMING_ACCELERATION, acceleration * STEP)
        bench.home(method, timeout_ms=60_000)
        zeros.append(bench.zero_steps)
    assert abs(zeros[0] - zeros[1]) <= 1
    edge = {17: -1_000, 18: 1_000, **dict.fromkeys((25, 26, 27, 28), first + width)}.get(method, first)
    assert abs(zeros[0] - edge) <= hysteresis + 1


class TestResult:
    @pytest.mark.parametrize(
        ("offset", "counted"), [(0, 0), (511, 0), (512, STEP), (-100_000, -98 * STEP), (7 * STEP, 7 * STEP)]
    )
    def test_the_edge_gets_the_offset_and_a_move_goes_to_it(
        self, fast_kernel: Kernel, offset: int, counted: int
    ) -> None:
        bench = bench_for(fast_kernel, 20, -100)
        bench.home(20, offset)
        assert bench.machine.position * STEP - bench.value(od.POSITION_ACTUAL) == EDGE * STEP - counted
        assert bench.machine.position > EDGE
        assert bench.write(od.MODE_OF_OPERATION, Mode.PROFILE_POSITION) == 0
        bench.write(od.TARGET_POSITION, counted)
        bench.word()
        bench.word(START)
        bench.wait(2_000)
        assert bench.machine.position == EDGE

    def test_no_step_is_due_after_homing(self, fast_kernel: Kernel) -> None:
        """The coordinates shift by whole steps: the difference of demand and counter stays."""
        for start in range(-60, -40, 5):
            bench = bench_for(fast_kernel, 20, start)
            bench.home(20, offset_units=500)
            made = len(bench.rises)
            assert abs(bench.value(od.POSITION_DEMAND) - bench.value(od.POSITION_ACTUAL)) <= STEP * 9 // 16
            bench.wait(50)
            assert len(bench.rises) == made

    def test_the_statusword_says_in_progress_and_then_done(self, fast_kernel: Kernel) -> None:
        bench = bench_for(fast_kernel, 24, 100)
        assert bench.bits == (1, 0, 0)
        assert not bench.value(od.STATUSWORD) & Status.POSITION_KNOWN
        bench.begin(24)
        seen = [bench.bits]
        while bench.bits != (1, 1, 0):
            bench.wait(0.25)
            seen.append(bench.bits)
        assert set(seen[:-1]) == {(0, 0, 0)}
        assert bench.value(od.STATUSWORD) & Status.POSITION_KNOWN
        assert bench.firmware.motion.axes[0].running is False

    def test_it_stays_attained_until_another_begins_or_the_reference_is_lost(self, fast_kernel: Kernel) -> None:
        bench = bench_for(fast_kernel, 20, -100)
        bench.home(20)
        bench.word()
        for mode in (Mode.PROFILE_VELOCITY, Mode.HOMING):
            assert bench.write(od.MODE_OF_OPERATION, mode) == 0
        assert bench.bits == (1, 1, 0)
        bench.word(START)
        assert bench.bits == (0, 0, 0)
        bench.end()
        bench.write(od.MODE_OF_OPERATION, Mode.PROFILE_VELOCITY)
        bench.write(od.TARGET_VELOCITY, 100 * STEP)
        bench.wait(100)
        bench.write(od.CONTROLWORD, 0)
        bench.write(od.TARGET_VELOCITY, 0)
        assert not bench.value(od.STATUSWORD) & Status.POSITION_KNOWN
        for word in (0x06, 0x07, 0x0F):
            bench.write(od.CONTROLWORD, word)
        bench.write(od.MODE_OF_OPERATION, Mode.HOMING)
        assert bench.bits == (1, 0, 0)

    def test_limit_switches_are_faults_again_afterwards(self, fast_kernel: Kernel) -> None:
        bench = bench_for(fast_kernel, 18, 300)
        bench.home(18)
        assert bench.state() is State.OPERATION_ENABLED
        bench.write(od.MODE_OF_OPERATION, Mode.PROFILE_VELOCITY)
        bench.write(od.TARGET_VELOCITY, 1000 * STEP)
        bench.wait(1_000)
        assert (bench.state(), bench.value(od.ERROR_CODE)) == (State.FAULT, ErrorCode.LIMIT_SWITCH)

    def test_soft_limits_do_not_hinder_it(self, fast_kernel: Kernel) -> None:
        bench = bench_for(fast_kernel, 20, -300)
        bench.write(od.POSITION_LIMIT_MIN, -STEP)
        bench.write(od.POSITION_LIMIT_MAX, STEP)
        bench.home(20)
        assert bench.zero_steps == EDGE

    def test_the_queue_is_closed(self, fast_kernel: Kernel) -> None:
        bench = bench_for(fast_kernel, 20, -100)
        bench.home(20)
        bench.record(1000, 0, 10, 0)
        assert (bench.value(od.PVT_NEXT_SEQUENCE), bench.value(od.PVT_FREE_RECORDS)) == (0, 0)


class TestErrors:
    def failed(self, bench: HomingBench, method: int, error: HomingError) -> None:
        """A failed homing stops, reports its error and changes nothing else."""
        known = bench.value(od.STATUSWORD) & Status.POSITION_KNOWN
        zero = bench.zero_steps
        bench.begin(method, offset_units=77 * STEP)
        seen = {bench.bits}
        while not bench.bits[0]:
            bench.wait(1)
            seen.add(bench.bits)
        assert seen >= {(0, 0, 0), (0, 0, 1), (1, 0, 1)}
        assert (1, 0, 0) not in seen
        assert bench.error is error
        assert bench.codes_and_details[-1] == (ErrorCode.HOMING_FAILED, error)
        assert bench.value(od.ERROR_REGISTER) == 0x81
        assert bench.state() is State.OPERATION_ENABLED
        assert bench.zero_steps == zero
        assert bench.value(od.STATUSWORD) & Status.POSITION_KNOWN == known

    @pytest.mark.parametrize("method", [19, 20, 21, 22])
    def test_the_home_switch_is_not_there(self, fast_kernel: Kernel, method: int) -> None:
        bench = bench_for(fast_kernel, method, 0, HOME=lambda _: False)
        self.failed(bench, method, HomingError.NOT_FOUND)
        assert len(bench.strokes()) == 1

    @pytest.mark.parametrize("method", range(23, 31))
    def test_it_is_not_there_between_both_limits(self, fast_kernel: Kernel, method: int) -> None:
        bench = bench_for(fast_kernel, method, 0, HOME=lambda _: False)
        self.failed(bench, method, HomingError.NOT_FOUND)
        assert [stroke[0] > 0 for stroke in bench.strokes()] == [method < 27, method >= 27]

    @pytest.mark.parametrize("method", [17, 18, 23, 27])
    def test_exchanged_limit_switches(self, fast_kernel: Kernel, method: int) -> None:
        exchanged: dict[str, Callable[[int], bool]] = {
            "NEGATIVE_LIMIT": lambda p: p >= RIGHT,
            "POSITIVE_LIMIT": lambda p: p <= LEFT,
        }
        bench = bench_for(fast_kernel, method, 200 if method in (18, 23) else -200, **exchanged)
        self.failed(bench, method, HomingError.WRONG_SWITCH)
        assert abs(bench.machine.position) in range(RIGHT, RIGHT + 140)

    @pytest.mark.parametrize("method", [17, 18])
    def test_a_limit_switch_that_does_not_open(self, fast_kernel: Kernel, method: int) -> None:
        stuck = Sticky(LEFT - 1000, LEFT, 10**6), Sticky(RIGHT, RIGHT + 1000, 10**6)
        name = "NEGATIVE_LIMIT" if method == 17 else "POSITIVE_LIMIT"
        bench = bench_for(fast_kernel, method, 0, **{name: stuck[method - 17]})
        self.failed(bench, method, HomingError.STUCK)

    @pytest.mark.parametrize("method", sorted(set(FIGURES) - {17, 18}))
    def test_a_home_switch_that_does_not_open(self, fast_kernel: Kernel, method: int) -> None:
        home = Sticky(0, 10, 10**6)
        bench = bench_for(fast_kernel, method, -100 if method in (19, 20, 23, 24, 25, 26) else 100, HOME=home)
        self.failed(bench, method, HomingError.STUCK)

    def test_a_home_switch_that_closes_only_once(self, fast_kernel: Kernel) -> None:
        bench = bench_for(fast_kernel, 20, 0)
        bench.machine.switches[HOME] = lambda p: p == 300 and not bench.strokes()[1:]
        self.failed(bench, 20, HomingError.STUCK)

    @pytest.mark.parametrize(("method", "end"), [(17, -(2**31) + 1), (18, 2**31 - 1)])
    def test_the_range_of_positions_ends_the_search(self, fast_kernel: Kernel, method: int, end: int) -> None:
        bench = bench_for(fast_kernel, method, 0, NEGATIVE_LIMIT=lambda _: False, POSITIVE_LIMIT=lambda _: False)
        bench.home(37, offset_units=end // STEP * STEP + (STEP * 400 if end < 0 else -STEP * 400))
        bench.begin(method)
        bench.end()
        assert (bench.bits, bench.error) == ((1, 0, 1), HomingError.NOT_FOUND)
        assert abs(bench.machine.position) in range(395, 402)

    def test_an_axis_that_must_not_move(self, fast_kernel: Kernel) -> None:
        bench = HomingBench(fast_kernel, machine(20, 0))
        bench.write(od.CONTROLWORD, 0)
        assert bench.write(od.MAX_PROFILE_VELOCITY, 1) == 0
        for word in (0x06, 0x07, 0x0F):
            bench.write(od.CONTROLWORD, word)
        bench.begin(20)
        assert (bench.bits, bench.error, bench.rises) == ((1, 0, 1), HomingError.NO_SPEED, [])

    @pytest.mark.slow
    def test_a_new_start_ends_the_error(self, fast_kernel: Kernel) -> None:
        bench = bench_for(fast_kernel, 20, 0, HOME=lambda _: False)
        self.failed(bench, 20, HomingError.NOT_FOUND)
        bench.machine.switches[HOME] = lambda p: p >= EDGE
        bench.wait(1)
        bench.word()
        assert bench.bits == (1, 0, 1)
        bench.home(20)
        assert (bench.zero_steps, bench.error, bench.value(od.ERROR_REGISTER)) == (EDGE, HomingError.NONE, 0)
        assert bench.codes_and_details[-1][0] == 0

    def test_leaving_the_mode_ends_the_error_but_its_reason_can_still_be_read(self, fast_kernel: Kernel) -> None:
        bench = bench_for(fast_kernel, 20, 0, HOME=lambda _: False)
        self.failed(bench, 20, HomingError.NOT_FOUND)
        bench.write(od.MODE_OF_OPERATION, Mode.PROFILE_POSITION)
        bench.write(od.MODE_OF_OPERATION, Mode.HOMING)
        assert (bench.bits, bench.error, bench.value(od.ERROR_REGISTER)) == ((1, 0, 0), HomingError.NOT_FOUND, 0)


class TestTimeout:
    def seen_after_us(self, kernel: Kernel, timeout_ms: int) -> tuple[HomingBench, int]:
        """Home, with success or not; return the time from the start until the edge was seen, in us."""
        bench = bench_for(kernel, 21, 200)
        bench.write(od.HOMING_TIMEOUT_MS, timeout_ms)
        begun = bench.now
        bench.begin(21)
        bench.end()
        return bench, (bench.edges[-1][0] - begun) // 72

    def test_both_sides(self, fast_kernel: Kernel) -> None:
        """The timeout applies to the edge, not to the end of the ramp behind it."""
        bench, edge_us = self.seen_after_us(fast_kernel, 0)
        assert (bench.bits, bench.zero_steps) == ((1, 1, 0), EDGE + 1)
        enough_ms = edge_us // 1000 + 1
        bench, _ = self.seen_after_us(fast_kernel, enough_ms)
        assert (bench.bits, bench.zero_steps) == ((1, 1, 0), EDGE + 1)
        bench, _ = self.seen_after_us(fast_kernel, enough_ms - 1)
        assert (bench.bits, bench.error) == ((1, 0, 1), HomingError.TIMEOUT)
        assert bench.codes_and_details == [(ErrorCode.HOMING_FAILED, HomingError.TIMEOUT)]
        assert bench.state() is State.OPERATION_ENABLED

    def test_it_is_two_minutes_by_default(self, fast_kernel: Kernel) -> None:
        bench = bench_for(fast_kernel, 17, 0, NEGATIVE_LIMIT=lambda _: False)
        bench.write(od.HOMING_SEARCH_SPEED, STEP)
        bench.begin(17)
        assert bench.firmware.nodes[0].drive.mode.due_us == bench.now // 72 + 120_000_000


class TestInterruption:
    def searching(self, kernel: Kernel, method: int = 20, start: int = -300) -> HomingBench:
        """Return a bench whose axis searches at full speed."""
        bench = bench_for(kernel, method, start)
        bench.begin(method)
        bench.wait(120)
        assert abs(bench.value(od.VELOCITY_ACTUAL)) >= FAST_STEPS_PER_S * STEP - STEP
        return bench

    def test_halt_and_its_release(self, fast_kernel: Kernel) -> None:
        bench = self.searching(fast_kernel)
        bench.word(START | HALT)
        assert bench.bits == (0, 0, 0) or bench.value(od.VELOCITY_ACTUAL)
        bench.wait(100)
        assert bench.bits == (1, 0, 0)
        stood = bench.machine.position
        bench.wait(100)
        assert bench.machine.position == stood < EDGE
        bench.word(START)
        assert bench.bits == (0, 0, 0)
        bench.end()
        assert (bench.bits, bench.zero_steps) == ((1, 1, 0), EDGE)

    @pytest.mark.parametrize("wait_ms", MOMENTS_MS)
    def test_halt_at_any_time_and_home_is_where_it_is(self, fast_kernel: Kernel, wait_ms: int) -> None:
        bench = bench_for(fast_kernel, 25, -100)
        bench.begin(25)
        bench.wait(wait_ms)
        bench.word(START | HALT)
        bench.wait(120)
        bench.word(START)
        bench.end()
        assert (bench.bits, bench.zero_steps) == ((1, 1, 0), LAST)

    @pytest.mark.parametrize("wait_ms", MOMENTS_MS)
    def test_a_falling_start_bit_aborts_at_any_time(self, fast_kernel: Kernel, wait_ms: int) -> None:
        bench = bench_for(fast_kernel, 25, -100)
        bench.begin(25)
        bench.wait(wait_ms)
        bench.word()
        bench.wait(120)
        assert bench.bits in ((1, 0, 0), (1, 1, 0))
        made = len(bench.rises)
        bench.wait(100)
        assert len(bench.rises) == made
        bench.word(START)
        bench.end()
        assert (bench.bits, bench.zero_steps) == ((1, 1, 0), LAST)

    def test_halt_ramps_as_its_option_says(self, fast_kernel: Kernel) -> None:
        took_ms = {}
        for option in (1, 2):
            bench = self.searching(fast_kernel)
            bench.write(od.HALT_OPTION, option)
            bench.write(od.QUICK_STOP_DECELERATION, 20_000 * STEP)
            bench.word(START | HALT)
            took_ms[option] = bench.end()
        assert took_ms[1] == pytest.approx(50 + 16, abs=16)
        assert took_ms[2] == pytest.approx(100 + 16, abs=16)

    def test_a_start_during_halt_waits_for_its_release(self, fast_kernel: Kernel) -> None:
        bench = bench_for(fast_kernel, 20, -100)
        bench.word(HALT)
        assert bench.write(od.HOMING_METHOD, 20) == 0
        bench.word(START | HALT)
        bench.wait(100)
        assert (bench.bits, bench.rises) == ((1, 0, 0), [])
        bench.word(START)
        bench.end()
        assert bench.zero_steps == EDGE

    def test_a_start_while_the_axis_still_brakes_waits_for_standstill(self, fast_kernel: Kernel) -> None:
        bench = self.searching(fast_kernel)
        bench.word()
        bench.word(START)
        assert (bench.bits, bench.value(od.VELOCITY_ACTUAL) != 0) == ((0, 0, 0), True)
        bench.end()
        assert (bench.bits, bench.zero_steps) == ((1, 1, 0), EDGE)

    def test_the_mode_cannot_be_left_in_motion(self, fast_kernel: Kernel) -> None:
        bench = self.searching(fast_kernel)
        assert bench.write(od.MODE_OF_OPERATION, Mode.PROFILE_POSITION) == AbortCode.DEVICE_STATE

    @pytest.mark.parametrize(
        ("word", "state"),
        [
            (0x07, State.SWITCHED_ON),
            (0x06, State.READY_TO_SWITCH_ON),
            (0x02, State.SWITCH_ON_DISABLED),
            (0x00, State.SWITCH_ON_DISABLED),
        ],
    )
    def test_switching_off_ends_it(self, fast_kernel: Kernel, word: int, state: State) -> None:
        bench = self.searching(fast_kernel)
        bench.write(od.CONTROLWORD, word)
        bench.wait(200)
        made = len(bench.rises)
        assert bench.state() is state
        for up in (0x06, 0x07, 0x0F):
            bench.write(od.CONTROLWORD, up)
        bench.wait(50)
        assert (bench.bits, len(bench.rises)) == ((1, 0, 0), made)
        bench.home(20)
        assert bench.zero_steps == EDGE

    def test_a_reset_of_the_node_ends_it(self, fast_kernel: Kernel) -> None:
        bench = self.searching(fast_kernel)
        bench.write(od.ABORT_CONNECTION_OPTION, AbortConnection.DISABLE_VOLTAGE)
        bench.nmt(129)
        made = len(bench.rises)
        bench.wait(100)
        assert len(bench.rises) - made <= 1  # the step that the tick in progress had placed
        assert bench.state() is State.SWITCH_ON_DISABLED

    def test_an_emergency_stop_is_a_fault(self, fast_kernel: Kernel) -> None:
        bench = self.searching(fast_kernel)
        bench.machine.switches[DigitalInput.ESTOP] = lambda _: True
        bench.wait(200)
        assert (bench.state(), bench.value(od.ERROR_CODE)) == (State.FAULT, ErrorCode.ESTOP)

    def test_another_stop_behind_the_edge_leaves_the_axis_not_homed(self, fast_kernel: Kernel) -> None:
        """Coordinates are set at rest: cutting the ramp short leaves the axis not homed."""
        bench = bench_for(fast_kernel, 20, -40)
        bench.write(od.HOMING_ACCELERATION, 2_000 * STEP)
        bench.begin(20)
        while len(bench.strokes()) < 3 or bench.machine.position < EDGE:
            bench.wait(5)
        bench.wait(30)
        bench.write(od.CONTROLWORD, 0x07)
        bench.wait(300)
        bench.write(od.CONTROLWORD, 0x0F)
        assert bench.bits == (1, 0, 0)


class TestPresentPosition:
    """Method 37: the axis is where the home offset says, without motion."""

    def test_method_37_presets_the_position_in_units(self, board: BenchBoard) -> None:
        board.enable(mode=6)
        board.write(od.HOME_OFFSET, 1500)
        assert not board.value(od.STATUSWORD) & 1 << 12
        board.write(od.CONTROLWORD, 0x1F)
        assert board.value(od.STATUSWORD) & 1 << 12
        assert (
            board.value(od.POSITION_DEMAND),
            board.value(od.POSITION_ACTUAL),
            board.value(od.FOLLOWING_ERROR_ACTUAL),
        ) == (1500, 1024, 476)

    def test_it_takes_a_rising_start_bit(self, board: BenchBoard) -> None:
        board.enable(mode=6)
        board.write(od.CONTROLWORD, 0x1F)
        board.write(od.HOME_OFFSET, 1500)
        board.write(od.CONTROLWORD, 0x1F)
        assert board.value(od.POSITION_DEMAND) == 0

    def test_it_closes_a_queue_whose_records_it_drops(self, board: BenchBoard) -> None:
        board.enable()
        for sequence in range(3):
            board.record(1000, 0, 10, sequence)
        for address, value in (
            (od.MODE_OF_OPERATION, 6),
            (od.CONTROLWORD, 0x1F),
            (od.CONTROLWORD, 0x0F),
            (od.MODE_OF_OPERATION, 7),
        ):
            assert board.write(address, value) == 0
        board.record(500, 0, 10, 3)
        board.write(od.CONTROLWORD, 0x1F)
        board.wait(100)
        assert board.value(od.POSITION_DEMAND) == 0
        assert (board.value(od.PVT_NEXT_SEQUENCE), board.value(od.PVT_FREE_RECORDS)) == (3, 0)

    @pytest.mark.parametrize("units", [2**31 - 1, -(2**31)])
    def test_at_the_ends_of_the_range_reports_stay_inside_it(self, board: BenchBoard, units: int) -> None:
        """At full steps the counter rounds to a step beyond the i32 range; the objects report the ends of the range."""
        board.write(od.MICROSTEPS, 1)
        board.enable(mode=6)
        board.write(od.HOME_OFFSET, units)
        board.write(od.CONTROLWORD, 0x1F)
        for address in (od.POSITION_DEMAND, od.POSITION_ACTUAL, od.FOLLOWING_ERROR_ACTUAL):
            index, _ = od.index_and_subindex(address)
            board.send(0x610, bytes((0x40, index & 0xFF, index >> 8, 0, 0, 0, 0, 0)))
            answer = board.last(0x590)
            assert answer[0] == 0x43
            if address != od.FOLLOWING_ERROR_ACTUAL:
                assert int.from_bytes(answer[4:], "little", signed=True) == units
