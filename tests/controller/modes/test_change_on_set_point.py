"""Profile position through targets without stopping: bit 9 of the controlword and the end velocity, in the firmware."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import Mode, State, Status
from tests.controller.modes.profile_bench import AT_ONCE, HALT, NEW, RELATIVE, ProfileBench
from tests.controller.units import MS, STEP
from tests.one_example import one_example

ON_SET_POINT = 0x200
"""Bit 9 of the controlword."""
WAITS, REACHED = Status.SET_POINT_ACKNOWLEDGED, Status.TARGET_REACHED


@pytest.fixture
def pp(fast_kernel: Kernel) -> ProfileBench:
    """At 4000 steps/s after ramps of 100 ms and 200 steps."""
    return ProfileBench(fast_kernel, Mode.PROFILE_POSITION)


def rises_ms(board: ProfileBench) -> list[float]:
    """Return when each pulse since the last call rose, in ms since power-up; the test is shorter than a drain."""
    return [float(counts) / MS for counts in board.firmware.motion.take_edges()[0].clk_counts[::2]]


def pulses(board: ProfileBench, timeout_ms: int = 5000) -> list[float]:
    """Return the pulses until the last target has been reached, and some time longer."""
    board.until(REACHED, timeout_ms)
    board.wait(50)
    return rises_ms(board)


def farthest_units(board: ProfileBench, every_ms: float) -> int:
    """Return the farthest demand until the last target has been reached, looked at so often."""
    farthest = 0
    while not board.has(REACHED):
        board.wait(every_ms)
        farthest = max(farthest, board.value(od.POSITION_DEMAND))
    return farthest


def rate_at(rises: list[float], step: int) -> float:
    """Return the steps per second around a step, from the pulses nearest to it."""
    return 2000 / (rises[step + 1] - rises[step - 1])


def passing_time_ms(at: float, distance: float = 1000, onward: float = 1000) -> tuple[float, float]:
    """Return when exact trapezoids of 4 steps/ms and 0.04 steps/ms^2 pass the first target, and when they end."""
    v, a = 4.0, 0.04
    first_ms = v / a + (v - at) / a + (distance - v**2 / (2 * a) - (v**2 - at**2) / (2 * a)) / v
    second_ms = (v - at) / a + v / a + (onward - v**2 / (2 * a) - (v**2 - at**2) / (2 * a)) / v
    return first_ms, first_ms + second_ms


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("bits", "end_velocity", "passes_at"),
    [(ON_SET_POINT, 0, 4000), (0, 1000, 1000), (0, 4000, 4000), (ON_SET_POINT, 1000, 4000), (0, 9000, 4000)],
)
def test_the_first_target_is_passed(
    fast_kernel: Kernel, bits: int, end_velocity: int, passes_at: int, sign: int
) -> None:
    """At the profile velocity by bit 9, else at the end velocity, but never faster than at the profile velocity."""
    board = ProfileBench(fast_kernel, Mode.PROFILE_POSITION)
    board.write(od.END_VELOCITY, end_velocity * STEP)
    begins_ms = board.now / MS
    board.set_point(sign * 1000 * STEP)
    board.set_point(sign * 2000 * STEP, bits)
    rises = pulses(board)
    assert len(rises) == 2000
    assert board.value(od.POSITION_DEMAND) == board.value(od.POSITION_ACTUAL) == sign * 2000 * STEP
    assert rate_at(rises, 1000) == pytest.approx(passes_at, rel=0.03)
    passed_ms, ended_ms = passing_time_ms(passes_at / 1000)
    assert rises[999] - begins_ms == pytest.approx(passed_ms, abs=17)
    assert rises[-1] - begins_ms == pytest.approx(ended_ms, abs=35)


GOLDEN_COUNTS = {
    0: (381_755, 12_611_749, 19_321_620, 19_600_658, 20_325_755, 20_580_324, 27_154_125, 35_944_658),
    1000: (381_755, 12_672_985, 18_187_336, 18_256_788, 18_328_038, 18_397_183, 23_923_125, 32_771_337),
    4000: (381_755, 12_667_394, 16_246_123, 16_264_124, 16_282_125, 16_300_125, 19_882_125, 28_672_658),
}
"""Rises of some pulses in timer counts, by the end velocity in steps/s."""


@pytest.mark.parametrize("end_velocity", GOLDEN_COUNTS)
def test_golden_pulses(pp: ProfileBench, end_velocity: int) -> None:
    """With 0 the profile is that of a drive without end velocity."""
    golden_pulses(pp, end_velocity)


@pytest.mark.slow
def test_golden_pulses_of_every_kernel(kernel: Kernel) -> None:
    golden_pulses(ProfileBench(kernel, Mode.PROFILE_POSITION), 4000)


def golden_pulses(board: ProfileBench, end_velocity: int) -> None:
    board.write(od.END_VELOCITY, end_velocity * STEP)
    board.set_point(700 * STEP)
    board.set_point(1200 * STEP)
    board.until(REACHED)
    counts = board.firmware.motion.take_edges()[0].clk_counts[::2]
    assert len(counts) == 1200
    assert tuple(int(counts[i]) for i in (0, 500, 698, 699, 700, 701, 900, 1199)) == GOLDEN_COUNTS[end_velocity]


def test_the_bits_of_the_statusword(pp: ProfileBench) -> None:
    """Bit 12 falls as the first target is passed, when the next set-point may be given; bit 10 rises at the last."""
    pp.set_point(1000 * STEP)
    assert not pp.has(WAITS)
    pp.set_point(2000 * STEP, ON_SET_POINT)
    assert pp.has(WAITS)
    pp.write(od.TARGET_POSITION, 9000 * STEP)
    pp.word(NEW | ON_SET_POINT)  # a third one is not taken
    pp.word()
    while pp.has(WAITS):
        assert not pp.has(REACHED)
        before = pp.value(od.POSITION_DEMAND)
        pp.wait(1)
    assert before <= 1000 * STEP + 4 * STEP
    assert 0 <= pp.value(od.POSITION_DEMAND) - 1000 * STEP <= 8 * STEP, "within a millisecond, and a tick"
    assert pp.speed_steps_per_s == pytest.approx(4000, abs=1)
    pp.set_point(3000 * STEP, ON_SET_POINT)
    assert pp.has(WAITS)
    while not pp.has(REACHED):
        pp.wait(1)
        assert pp.has(WAITS) is (pp.value(od.POSITION_DEMAND) < 2000 * STEP) or not pp.has(WAITS)
    assert pp.value(od.POSITION_DEMAND) == 3000 * STEP


def test_bit_12_stays_while_the_new_set_point_bit_does(pp: ProfileBench) -> None:
    pp.set_point(1000 * STEP)
    pp.write(od.TARGET_POSITION, 2000 * STEP)
    pp.word(NEW | ON_SET_POINT)
    pp.until(REACHED)
    assert pp.has(WAITS)
    pp.word()
    assert not pp.has(WAITS)


@pytest.mark.parametrize("end_velocity", [1, 1000, 2**32 - 1])
def test_without_a_set_point_that_waits_the_end_velocity_has_no_effect(fast_kernel: Kernel, end_velocity: int) -> None:
    """Every pulse is that of a drive whose end velocity is 0: it stops, and does not run away."""
    made = []
    for value in (0, end_velocity):
        board = ProfileBench(fast_kernel, Mode.PROFILE_POSITION)
        board.write(od.END_VELOCITY, value)
        board.set_point(1000 * STEP, ON_SET_POINT)
        made.append(pulses(board))
        assert board.value(od.VELOCITY_ACTUAL) == 0
    assert made[0] == made[1]
    assert len(made[0]) == 1000


def test_the_end_velocity_is_that_of_the_time_of_its_set_point(pp: ProfileBench) -> None:
    pp.write(od.END_VELOCITY, 2000 * STEP)
    pp.set_point(1000 * STEP)
    pp.write(od.END_VELOCITY, 0)
    pp.set_point(2000 * STEP)
    assert rate_at(pulses(pp), 1000) == pytest.approx(2000, rel=0.02)


@pytest.mark.parametrize("bits", [0, ON_SET_POINT])
@pytest.mark.parametrize("second", [999, 0, -500])
def test_it_stops_at_a_target_where_it_turns_round(pp: ProfileBench, second: int, bits: int) -> None:
    pp.write(od.END_VELOCITY, 4000 * STEP)
    pp.set_point(1000 * STEP)
    pp.set_point(second * STEP, bits)
    assert farthest_units(pp, 1) == 1000 * STEP
    assert pp.value(od.POSITION_DEMAND) == second * STEP
    assert len(rises_ms(pp)) == 1000 + 1000 - second


@pytest.mark.parametrize("second", [1000, 1001, 1050, 1100, 1199, 1210, 9999])
def test_a_way_onward_too_short_for_the_velocity_is_passed_more_slowly(pp: ProfileBench, second: int) -> None:
    """It stops at the next target, and never goes beyond: there may be the end of the allowed range."""
    pp.write(od.POSITION_LIMIT_MAX, 1210 * STEP)
    pp.set_point(1000 * STEP)
    pp.set_point(second * STEP, ON_SET_POINT)
    farthest = farthest_units(pp, 0.25)
    last = min(second, 1210)
    assert farthest == pp.value(od.POSITION_DEMAND) == last * STEP
    assert pp.has(Status.INTERNAL_LIMIT) is (second > 1210)
    rises = rises_ms(pp)
    assert len(rises) == last
    if last >= 1050:
        assert rate_at(rises, 1000) == pytest.approx(min(4000, (2 * 40_000 * (last - 1000)) ** 0.5), rel=0.12)


@pytest.mark.parametrize(("acceleration", "deceleration"), [(40, 40), (40, 20), (20, 40)])
@pytest.mark.parametrize("end_velocity", [500, 2000, 4000])
def test_it_keeps_both_accelerations(pp: ProfileBench, end_velocity: int, acceleration: int, deceleration: int) -> None:
    """Velocities of 1 ms apart change by no more than they allow, and by 8 steps/s of rounding."""
    pp.write(od.END_VELOCITY, end_velocity * STEP)
    pp.write(od.PROFILE_ACCELERATION, acceleration * 1000 * STEP)
    pp.write(od.PROFILE_DECELERATION, deceleration * 1000 * STEP)
    pp.set_point(1000 * STEP)
    pp.set_point(2500 * STEP)
    speeds = [0.0]
    while not pp.has(REACHED):
        pp.wait(1)
        speeds.append(pp.speed_steps_per_s)
    changes = [after - before for before, after in pairwise(speeds)]
    assert max(speeds) <= 4001
    assert max(changes) <= acceleration + 8
    assert min(changes) >= -deceleration - 8


def test_the_limits_of_the_next_set_point_hold_from_the_target_on(pp: ProfileBench) -> None:
    pp.set_point(1000 * STEP)
    pp.write(od.PROFILE_VELOCITY, 1000 * STEP)
    pp.set_point(2000 * STEP, ON_SET_POINT)
    rises = pulses(pp)
    assert rate_at(rises, 990) == pytest.approx(4000, rel=0.02)
    assert rate_at(rises, 1500) == pytest.approx(1000, rel=0.02)


@pytest.mark.parametrize("limit", [3000, 4000, 5000])
def test_it_passes_no_faster_than_the_max_profile_velocity(pp: ProfileBench, limit: int) -> None:
    pp.write(od.MAX_PROFILE_VELOCITY, limit * STEP)
    pp.set_point(1000 * STEP)
    pp.set_point(2000 * STEP, ON_SET_POINT)
    assert rate_at(pulses(pp), 1000) == pytest.approx(min(limit, 4000), rel=0.02)


@pytest.mark.parametrize("halt_ms", [50, 200, 260, 290, 300, 310, 320, 400, 480])
def test_halt_and_its_release_go_on_to_the_targets_left(pp: ProfileBench, halt_ms: int) -> None:
    """The first target is passed after 300 ms. A halt that ends beyond it has passed it: the axis never comes back."""
    pp.set_point(1000 * STEP)
    pp.set_point(2000 * STEP, ON_SET_POINT)
    pp.wait(halt_ms)
    pp.word(HALT)
    pp.until(REACHED)
    stood = pp.value(od.POSITION_DEMAND)
    pp.wait(100)
    assert pp.has(WAITS) is (stood < 1000 * STEP)
    assert pp.value(od.POSITION_DEMAND) == stood
    pp.word()
    before = stood
    while not pp.has(REACHED):
        pp.wait(1)
        assert pp.value(od.POSITION_DEMAND) >= before
        before = pp.value(od.POSITION_DEMAND)
    assert before == 2000 * STEP
    assert len(rises_ms(pp)) == 2000


@pytest.mark.parametrize("halt_ms", [297, 300, 303, 306])
def test_a_halt_at_the_passing_ends_before_the_next_target(pp: ProfileBench, halt_ms: int) -> None:
    """Even if the next set-point may decelerate more steeply than the present one."""
    pp.set_point(1000 * STEP)
    pp.write(od.PROFILE_DECELERATION, 400_000 * STEP)
    pp.set_point(1100 * STEP, ON_SET_POINT)
    pp.wait(halt_ms)
    pp.word(HALT)
    pp.until(REACHED)
    assert pp.value(od.POSITION_DEMAND) <= 1100 * STEP


@pytest.mark.parametrize("change_ms", [100, 280, 310])
@pytest.mark.parametrize("target", [3000, 1200, -300])
def test_a_set_point_at_once_replaces_both(pp: ProfileBench, change_ms: int, target: int) -> None:
    pp.set_point(1000 * STEP)
    pp.set_point(2000 * STEP, ON_SET_POINT)
    pp.wait(change_ms)
    pp.set_point(target * STEP, AT_ONCE | ON_SET_POINT)
    assert not pp.has(WAITS)
    pp.until(REACHED)
    assert pp.value(od.POSITION_DEMAND) == pp.value(od.POSITION_ACTUAL) == target * STEP
    pp.wait(100)
    assert pp.value(od.POSITION_DEMAND) == target * STEP


@pytest.mark.parametrize("profile_type", [0, 3])
@pytest.mark.parametrize("given_ms", [10, 150, 250, 300, 340, 345, 349, 360])
def test_a_set_point_that_comes_late(pp: ProfileBench, given_ms: int, profile_type: int) -> None:
    """Also while the axis brakes already, it goes on if there is room; the way is the same."""
    pp.write(od.MOTION_PROFILE_TYPE, profile_type)
    pp.set_point(1000 * STEP)
    pp.wait(given_ms)
    pp.set_point(2000 * STEP, ON_SET_POINT)
    before = pp.value(od.POSITION_DEMAND)
    while not pp.has(REACHED):
        pp.wait(1)
        assert pp.value(od.POSITION_DEMAND) >= before
        before = pp.value(od.POSITION_DEMAND)
    assert before == 2000 * STEP
    assert len(rises_ms(pp)) == 2000


@pytest.mark.parametrize("microsteps", [1, 16])
def test_a_row_of_relative_set_points_is_one_motion(fast_kernel: Kernel, microsteps: int) -> None:
    """Ten ways of a tenth of a second each take as long as one of them all: 1.1 s with the ramps."""
    board = ProfileBench.with_microsteps(fast_kernel, microsteps)
    full_step = 16384
    speed = min(4000, 8000 // microsteps) * full_step
    board.write(od.PROFILE_VELOCITY, speed)
    board.write(od.PROFILE_ACCELERATION, 10 * speed)
    board.write(od.PROFILE_DECELERATION, 10 * speed)
    begins_ms = board.now / MS
    for _ in range(10):
        while board.has(WAITS):
            board.wait(1)
        board.set_point(speed // 10, RELATIVE | ON_SET_POINT)
    board.until(REACHED)
    took_ms = board.now / MS - begins_ms
    assert board.value(od.POSITION_DEMAND) == speed
    assert took_ms == pytest.approx(1000 + 100, abs=40)


def test_a_quick_stop_forgets_both(pp: ProfileBench) -> None:
    pp.set_point(1000 * STEP)
    pp.set_point(2000 * STEP, ON_SET_POINT)
    pp.wait(295)
    pp.write(od.CONTROLWORD, 0x02)
    pp.wait(200)
    assert pp.state() is State.SWITCH_ON_DISABLED
    stood = pp.value(od.POSITION_DEMAND)
    pp.enable(Mode.PROFILE_POSITION)
    pp.wait(200)
    assert pp.value(od.POSITION_DEMAND) == stood
    assert not pp.has(WAITS)


def test_what_it_does_is_the_same_each_time(fast_kernel: Kernel) -> None:
    made = []
    for _ in range(2):
        board = ProfileBench(fast_kernel, Mode.PROFILE_POSITION)
        board.set_point(777 * STEP)
        board.wait(33.3)
        board.set_point(1555 * STEP, ON_SET_POINT)
        made.append((pulses(board), board.sent))
    assert made[0] == made[1]


commands = st.tuples(
    st.integers(-(10**6), 10**6),  # target
    st.sampled_from([0, ON_SET_POINT, RELATIVE | ON_SET_POINT, AT_ONCE, ON_SET_POINT | HALT, RELATIVE]),
    st.sampled_from([0, 3]),
    st.sampled_from([10**4, 10**6, 10**7, 2**32 - 1]),  # velocity
    st.sampled_from([0, 0, 10**5, 10**6, 2**32 - 1]),  # end velocity
    st.sampled_from([10**7, 10**8, 2**32 - 1]),  # acceleration
    st.sampled_from([10**7, 10**8, 2**32 - 1]),  # deceleration
    st.sampled_from([0, 0.3, 5, 16, 60, 150]),  # ms until the next command
)


@pytest.mark.slow
@given(script=st.lists(commands, min_size=1, max_size=8), microsteps=st.sampled_from([1, 8, 16]))
def test_for_any_set_points_it_ends_at_the_last_target(
    fast_kernel: Kernel, script: list[tuple[int, int, int, int, int, int, int, float]], microsteps: int
) -> None:
    """The queue neither runs out nor is refused: that would be an emergency."""
    board = ProfileBench.with_microsteps(fast_kernel, microsteps)
    for target, bits, profile_type, velocity, end_velocity, acceleration, deceleration, wait_ms in script:
        board.write(od.MOTION_PROFILE_TYPE, profile_type)
        board.write(od.PROFILE_VELOCITY, velocity)
        board.write(od.END_VELOCITY, end_velocity)
        board.write(od.PROFILE_ACCELERATION, acceleration)
        board.write(od.PROFILE_DECELERATION, deceleration)
        board.write(od.TARGET_POSITION, target)
        board.word(NEW | bits)
        board.word(bits & HALT)
        board.wait(wait_ms)
    board.ends_at_a_last_target()


@pytest.mark.slow
@given(
    ways=st.lists(st.integers(1, 100_000), min_size=2, max_size=6),
    velocity=st.sampled_from([10**5, 10**6, 10**7]),
    deceleration=st.sampled_from([10**7, 10**8, 10**9]),
    halt_ms=st.one_of(st.none(), st.integers(0, 400)),
    profile_type=st.sampled_from([0, 3]),
    sign=st.sampled_from([1, -1]),
)
def test_in_one_direction_no_target_given_is_ever_exceeded(
    fast_kernel: Kernel,
    ways: list[int],
    velocity: int,
    deceleration: int,
    halt_ms: int | None,
    profile_type: int,
    sign: int,
) -> None:
    """Whatever is waiting, and through a halt: beyond the last target might be the end of the allowed range."""
    board = ProfileBench(fast_kernel, Mode.PROFILE_POSITION)
    board.write(od.PROFILE_VELOCITY, velocity)
    board.write(od.PROFILE_DECELERATION, deceleration)
    board.write(od.PROFILE_ACCELERATION, 10**8)
    board.write(od.MOTION_PROFILE_TYPE, profile_type)
    left, last, ms = list(ways), 0, 0
    halted = False
    while left or not board.has(REACHED) or halted:
        if left and not board.has(WAITS) and not halted:
            last += left.pop(0)
            board.set_point(sign * last, ON_SET_POINT)
        if halt_ms is not None and ms == halt_ms:
            board.word(HALT)
            halted = True
        if halted and board.has(REACHED):
            board.word()
            halted = False
        board.wait(1)
        ms += 1
        assert sign * board.value(od.POSITION_DEMAND) <= last
        assert ms < 20_000
    assert board.value(od.POSITION_DEMAND) == sign * last


@pytest.mark.parametrize(("halt_ms", "profile_type"), [(None, 3), (150, 0)])
def test_a_row_of_targets_is_never_exceeded(fast_kernel: Kernel, halt_ms: int | None, profile_type: int) -> None:
    one_example(
        test_in_one_direction_no_target_given_is_ever_exceeded,
        fast_kernel, ways=[100_000, 1, 90_000], velocity=10**6, deceleration=10**7, halt_ms=halt_ms,
        profile_type=profile_type, sign=-1,
    )  # fmt: skip
