"""Profile position through the whole firmware: handshake, steps made, limits, stops."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, Mode, State, Status
from steptwin.protocol.sdo_frames import AbortCode
from tests.controller.modes.profile_bench import AT_ONCE, HALT, NEW, RELATIVE, ProfileBench
from tests.controller.units import STEP


@pytest.fixture
def pp(fast_kernel: Kernel) -> ProfileBench:
    return ProfileBench(fast_kernel, Mode.PROFILE_POSITION)


@pytest.mark.parametrize("profile_type", [0, 3])
@pytest.mark.parametrize("steps", [1, -7, 400, -3000])
def test_a_move_of_n_steps_makes_n_steps(pp: ProfileBench, steps: int, profile_type: int) -> None:
    pp.write(od.MOTION_PROFILE_TYPE, profile_type)
    pp.set_point(steps * STEP)
    assert not pp.has(Status.TARGET_REACHED)
    pp.until(Status.TARGET_REACHED)
    assert (pp.value(od.POSITION_DEMAND), pp.value(od.POSITION_ACTUAL), pp.steps()) == (
        steps * STEP,
        steps * STEP,
        abs(steps),
    )
    pp.wait(100)
    assert pp.steps() == 0


def test_a_move_takes_the_time_of_its_trapezoid(pp: ProfileBench) -> None:
    """4000 steps at 4 kHz with ramps of 100 ms take 1.1 s, and the profile's rounding to whole milliseconds."""
    pp.set_point(4000 * STEP)
    pp.wait(500)
    assert pp.speed_steps_per_s == pytest.approx(4000, abs=1)
    assert pp.until(Status.TARGET_REACHED) == pytest.approx(600, abs=30)


def test_the_acknowledge_follows_the_new_set_point_bit(pp: ProfileBench) -> None:
    pp.write(od.TARGET_POSITION, 400 * STEP)
    pp.word()
    assert not pp.has(Status.SET_POINT_ACKNOWLEDGED)
    pp.word(NEW)
    pp.wait(10)
    assert pp.has(Status.SET_POINT_ACKNOWLEDGED)
    pp.word()
    assert not pp.has(Status.SET_POINT_ACKNOWLEDGED)


def test_without_a_rising_edge_nothing_moves(pp: ProfileBench) -> None:
    pp.set_point(0)
    pp.word(NEW)
    pp.write(od.TARGET_POSITION, 400 * STEP)
    pp.word(NEW)
    pp.wait(100)
    assert pp.value(od.POSITION_DEMAND) == 0


def test_one_further_set_point_waits_and_holds_the_acknowledge(pp: ProfileBench) -> None:
    pp.set_point(400 * STEP)
    pp.set_point(1000 * STEP)
    assert pp.has(Status.SET_POINT_ACKNOWLEDGED)
    pp.write(od.TARGET_POSITION, -5 * STEP)
    pp.word(NEW)  # only one set-point can wait: this third one is not taken
    pp.word()
    highest = 0
    while pp.has(Status.SET_POINT_ACKNOWLEDGED):
        pp.wait(1)
        highest = max(highest, pp.value(od.POSITION_DEMAND))
    assert highest == 400 * STEP
    assert not pp.has(Status.TARGET_REACHED)
    pp.until(Status.TARGET_REACHED)
    assert (pp.value(od.POSITION_DEMAND), pp.steps()) == (1000 * STEP, 1000)


@pytest.mark.parametrize("target", [3000, 600, 100, -500])
def test_an_immediate_change_replaces_both(pp: ProfileBench, target: int) -> None:
    """Farther, nearer, too near to stop and behind: each is reached, from the speed of 4 kHz."""
    pp.set_point(2000 * STEP)
    pp.set_point(2500 * STEP)
    pp.wait(180)
    pp.set_point(target * STEP, AT_ONCE)
    assert not pp.has(Status.SET_POINT_ACKNOWLEDGED)
    fastest = 0.0
    while not pp.has(Status.TARGET_REACHED):
        pp.wait(1)
        fastest = max(fastest, abs(pp.speed_steps_per_s))
    assert (pp.value(od.POSITION_DEMAND), pp.value(od.POSITION_ACTUAL)) == (target * STEP, target * STEP)
    assert fastest == pytest.approx(4000, abs=1)
    assert pp.state() is State.OPERATION_ENABLED


def test_relative_targets_count_from_the_target_before(pp: ProfileBench) -> None:
    pp.set_point(300 * STEP, RELATIVE)
    pp.set_point(300 * STEP, RELATIVE)
    pp.until(Status.TARGET_REACHED)
    assert pp.value(od.POSITION_DEMAND) == 600 * STEP
    pp.set_point(-100 * STEP, RELATIVE)
    pp.wait(20)
    pp.set_point(-100 * STEP, RELATIVE | AT_ONCE)
    pp.until(Status.TARGET_REACHED)
    assert pp.value(od.POSITION_DEMAND) == 400 * STEP


def test_halt_ramps_to_rest_and_its_release_goes_on(pp: ProfileBench) -> None:
    pp.set_point(2000 * STEP)
    pp.wait(200)
    pp.word(HALT)
    took_ms = pp.until(Status.TARGET_REACHED)
    assert took_ms == pytest.approx(100, abs=30)
    stood_at = pp.value(od.POSITION_DEMAND)
    assert 0 < stood_at < 2000 * STEP
    pp.wait(100)
    assert pp.value(od.POSITION_DEMAND) == stood_at
    pp.word()
    assert not pp.has(Status.TARGET_REACHED)
    pp.until(Status.TARGET_REACHED)
    assert (pp.value(od.POSITION_DEMAND), pp.steps()) == (2000 * STEP, 2000)


def test_a_set_point_during_halt_waits_for_its_release(pp: ProfileBench) -> None:
    pp.word(HALT)
    pp.set_point(100 * STEP, HALT)
    pp.wait(100)
    assert pp.value(od.POSITION_DEMAND) == 0
    pp.word()
    pp.until(Status.TARGET_REACHED)
    assert pp.value(od.POSITION_DEMAND) == 100 * STEP


@pytest.mark.parametrize(("target", "reached"), [(900, 500), (-900, -200)])
def test_targets_beyond_soft_limits_end_there(pp: ProfileBench, target: int, reached: int) -> None:
    pp.write(od.POSITION_LIMIT_MIN, -200 * STEP)
    pp.write(od.POSITION_LIMIT_MAX, 500 * STEP)
    pp.set_point(target * STEP)
    assert pp.has(Status.INTERNAL_LIMIT)
    pp.until(Status.TARGET_REACHED)
    assert pp.value(od.POSITION_DEMAND) == reached * STEP
    pp.set_point(0)
    assert not pp.has(Status.INTERNAL_LIMIT)


def test_quick_stop_at_speed(pp: ProfileBench) -> None:
    pp.write(od.QUICK_STOP_DECELERATION, 80_000 * STEP)
    pp.set_point(2000 * STEP)
    pp.wait(200)
    pp.write(od.CONTROLWORD, 0x02)
    assert pp.state() is State.QUICK_STOP_ACTIVE
    pp.wait(52)
    assert pp.state() is State.SWITCH_ON_DISABLED
    stood_at = pp.value(od.POSITION_DEMAND)
    assert stood_at == pytest.approx((4000 * 0.15 + 4000 * 0.025) * STEP, rel=0.05)
    pp.enable(Mode.PROFILE_POSITION)
    pp.wait(100)
    assert pp.value(od.POSITION_DEMAND) == stood_at, "a set-point must not outlive a stop"


def test_a_set_point_given_during_a_quick_stop_moves_nothing(pp: ProfileBench) -> None:
    """Option code 2 leads to SWITCH ON DISABLED, whatever the controlword says meanwhile."""
    pp.set_point(2000 * STEP)
    pp.wait(200)
    pp.write(od.CONTROLWORD, 0x02)
    pp.word()
    pp.write(od.TARGET_POSITION, 0)
    pp.word(NEW)
    pp.wait(1000)
    assert pp.state() is State.SWITCH_ON_DISABLED
    stood_at = pp.value(od.POSITION_DEMAND)
    assert 0 < stood_at < 1000 * STEP
    pp.enable(Mode.PROFILE_POSITION)
    pp.wait(100)
    assert pp.value(od.POSITION_DEMAND) == stood_at
    pp.set_point(0)
    pp.until(Status.TARGET_REACHED)
    assert (pp.value(od.POSITION_DEMAND), pp.value(od.POSITION_ACTUAL)) == (0, 0)


def test_disabling_the_voltage_stops_dead(pp: ProfileBench) -> None:
    pp.set_point(2000 * STEP)
    pp.wait(200)
    pp.write(od.CONTROLWORD, 0)
    pp.steps()
    pp.wait(200)
    assert pp.steps() == 0
    assert pp.value(od.VELOCITY_ACTUAL) == 0


def test_modes_change_at_standstill_only(pp: ProfileBench) -> None:
    pp.set_point(200 * STEP)
    assert pp.write(od.MODE_OF_OPERATION, Mode.PROFILE_VELOCITY) == AbortCode.DEVICE_STATE
    pp.until(Status.TARGET_REACHED)
    assert pp.write(od.MODE_OF_OPERATION, Mode.PROFILE_VELOCITY) == 0


def test_a_target_beyond_the_i32_range_is_still_planned(pp: ProfileBench) -> None:
    pp.set_point(-(2**31))
    assert pp.has(Status.INTERNAL_LIMIT)
    pp.wait(1000)
    assert pp.speed_steps_per_s == pytest.approx(-4000, abs=1)


def test_records_of_interpolation_do_not_get_into_a_profile(pp: ProfileBench) -> None:
    pp.record(50 * STEP, 0, 50, 0)
    pp.set_point(100 * STEP)
    pp.record(50 * STEP, 0, 50, 1)
    pp.until(Status.TARGET_REACHED)
    pp.wait(100)
    assert (pp.value(od.POSITION_DEMAND), pp.steps()) == (100 * STEP, 100)


def test_as_fast_as_the_pulse_timing_allows(pp: ProfileBench) -> None:
    """A profile velocity above the axis' limit is allowed: the axis keeps the limit, less a rounding margin."""
    pp.write(od.PROFILE_VELOCITY, 2**32 - 1)
    pp.write(od.PROFILE_ACCELERATION, 2**32 - 1)
    pp.set_point(30_000 * STEP)
    pp.wait(500)
    assert 14_998 < pp.speed_steps_per_s <= 15_000
    pp.until(Status.TARGET_REACHED)
    assert pp.value(od.POSITION_DEMAND) == 30_000 * STEP


@pytest.mark.parametrize("bits", [AT_ONCE, HALT])
@pytest.mark.parametrize("change_ms", [40, 80, 120, 160])
def test_a_jerk_limited_change_on_the_way_steps_in_no_acceleration(pp: ProfileBench, change_ms: int, bits: int) -> None:
    """It begins with the acceleration of the segment in execution, not of one that waited and was dropped.

    Accelerations of 1 ms apart differ by the jerk, and by the rounding of velocities to whole units per ms.
    """
    pp.write(od.MOTION_PROFILE_TYPE, 3)
    pp.write(od.PROFILE_VELOCITY, 10_000 * STEP)
    pp.write(od.PROFILE_ACCELERATION, 100_000 * STEP)
    pp.write(od.PROFILE_DECELERATION, 100_000 * STEP)
    jerk = pp.value(od.PROFILE_JERK)
    pp.set_point(800 * STEP)
    pp.wait(change_ms)
    pp.write(od.TARGET_POSITION, 1500 * STEP)
    pp.word(NEW | bits if bits == AT_ONCE else HALT)
    velocities = []
    while not pp.has(Status.TARGET_REACHED):
        velocities.append(pp.value(od.VELOCITY_ACTUAL))
        pp.wait(1)
    changes = [after - before for before, after in pairwise(velocities)]
    steepest = max(abs(after - before) for before, after in pairwise(changes))
    assert steepest <= jerk / 1e6 + 2 * 1000


@pytest.mark.parametrize("profile_type", [-1, 1, 2, 4])
def test_profile_types_that_are_not_offered(pp: ProfileBench, profile_type: int) -> None:
    assert pp.write(od.MOTION_PROFILE_TYPE, profile_type) != 0


def test_an_overshoot_beyond_the_last_position_is_a_fault(pp: ProfileBench) -> None:
    pp.write(od.MODE_OF_OPERATION, Mode.HOMING)
    pp.write(od.HOME_OFFSET, 2**31 - 1 - 900 * STEP)
    pp.word(NEW)
    pp.word()
    pp.write(od.MODE_OF_OPERATION, Mode.PROFILE_POSITION)
    pp.set_point(2**31 - 1)
    pp.wait(200)
    pp.write(od.PROFILE_DECELERATION, 1000 * STEP)  # now the distance is too short to stop
    pp.set_point(0, AT_ONCE)
    pp.wait(2000)
    assert pp.state() is State.FAULT
    assert pp.value(od.ERROR_CODE) == ErrorCode.SEGMENT_REFUSED


changes = st.tuples(
    st.integers(-(10**6), 10**6),  # target
    st.sampled_from([0, AT_ONCE, RELATIVE, RELATIVE | AT_ONCE, HALT]),
    st.sampled_from([0, 3]),
    st.sampled_from([10**4, 10**6, 10**7, 2**32 - 1]),  # velocity
    st.sampled_from([10**7, 10**8, 2**32 - 1]),  # acceleration
    st.sampled_from([10**7, 10**8, 2**32 - 1]),  # deceleration
    st.sampled_from([0, 0.3, 5, 16, 60, 150]),  # ms until the next command
)


@pytest.mark.slow
@given(script=st.lists(changes, min_size=1, max_size=8), microsteps=st.sampled_from([1, 2, 8, 16]))
def test_for_any_set_points_the_queue_neither_runs_out_nor_is_refused(
    fast_kernel: Kernel, script: list[tuple[int, int, int, int, int, int, float]], microsteps: int
) -> None:
    board = ProfileBench.with_microsteps(fast_kernel, microsteps)
    for target, bits, profile_type, velocity, acceleration, deceleration, wait_ms in script:
        board.write(od.MOTION_PROFILE_TYPE, profile_type)
        board.write(od.PROFILE_VELOCITY, velocity)
        board.write(od.PROFILE_ACCELERATION, acceleration)
        board.write(od.PROFILE_DECELERATION, deceleration)
        board.write(od.TARGET_POSITION, target)
        board.word(NEW | bits)
        board.word(bits & HALT)
        board.wait(wait_ms)
    board.ends_at_a_last_target()
