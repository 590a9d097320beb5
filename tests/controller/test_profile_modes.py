"""Profile position and profile velocity through the whole firmware: handshake, steps made, limits, stops."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel, python_kernel
from steptwin.protocol import od
from steptwin.protocol.abort import AbortCode
from steptwin.protocol.cia402 import DigitalInput, ErrorCode, Mode, State, Status
from tests.controller.bench_board import BenchBoard
from tests.controller.units import STEP

NEW, AT_ONCE, RELATIVE, HALT = 0x10, 0x20, 0x40, 0x100


class ProfileBench(BenchBoard):
    """A bench board with one axis, enabled in a profile mode, and that mode's controlwords."""

    def __init__(self, kernel: Kernel, mode: Mode) -> None:
        super().__init__(kernel)
        self.enable(mode)
        self.write(od.PROFILE_VELOCITY, 4000 * STEP)
        self.write(od.PROFILE_ACCELERATION, 40_000 * STEP)
        self.write(od.PROFILE_DECELERATION, 40_000 * STEP)

    def word(self, bits: int = 0) -> None:
        assert self.write(od.CONTROLWORD, 0x0F | bits) == 0

    def set_point(self, target: int, bits: int = 0) -> None:
        """Give a set-point, with its whole handshake."""
        assert self.write(od.TARGET_POSITION, target) == 0
        self.word(NEW | bits)
        assert self.has(Status.SET_POINT_ACKNOWLEDGED)
        self.word(bits & HALT)

    def until(self, bit: Status, timeout_ms: int = 20_000) -> float:
        """Wait for a bit of the statusword; return how long it took in ms."""
        for ms in range(timeout_ms):
            if self.has(bit):
                return ms
            self.wait(1)
        raise AssertionError(f"no {bit!r} in {timeout_ms} ms")

    def steps(self) -> int:
        """Return the number of CLK rises since the last call."""
        return len(self.firmware.motion.take_edges()[0].clk_counts) // 2

    @property
    def speed_steps_per_s(self) -> float:
        return self.value(od.VELOCITY_ACTUAL) / STEP


@pytest.fixture
def pp(fast_kernel: Kernel) -> ProfileBench:
    return ProfileBench(fast_kernel, Mode.PROFILE_POSITION)


@pytest.fixture
def pv(fast_kernel: Kernel) -> ProfileBench:
    return ProfileBench(fast_kernel, Mode.PROFILE_VELOCITY)


class TestPosition:
    @pytest.mark.parametrize("profile_type", [0, 3])
    @pytest.mark.parametrize("steps", [1, -7, 400, -3000])
    def test_a_move_of_n_steps_makes_n_steps(self, kernel: Kernel, steps: int, profile_type: int) -> None:
        board = ProfileBench(kernel, Mode.PROFILE_POSITION)
        board.write(od.MOTION_PROFILE_TYPE, profile_type)
        board.set_point(steps * STEP)
        assert not board.has(Status.TARGET_REACHED)
        board.until(Status.TARGET_REACHED)
        assert (board.value(od.POSITION_DEMAND), board.value(od.POSITION_ACTUAL), board.steps()) == (
            steps * STEP,
            steps * STEP,
            abs(steps),
        )
        board.wait(100)
        assert board.steps() == 0

    def test_a_move_takes_the_time_of_its_trapezoid(self, pp: ProfileBench) -> None:
        """4000 steps at 4 kHz with ramps of 100 ms take 1.1 s, and the profile's rounding to whole milliseconds."""
        pp.set_point(4000 * STEP)
        pp.wait(500)
        assert pp.speed_steps_per_s == pytest.approx(4000, abs=1)
        assert pp.until(Status.TARGET_REACHED) == pytest.approx(600, abs=30)

    def test_the_acknowledge_follows_the_new_set_point_bit(self, pp: ProfileBench) -> None:
        pp.write(od.TARGET_POSITION, 400 * STEP)
        pp.word()
        assert not pp.has(Status.SET_POINT_ACKNOWLEDGED)
        pp.word(NEW)
        pp.wait(10)
        assert pp.has(Status.SET_POINT_ACKNOWLEDGED)
        pp.word()
        assert not pp.has(Status.SET_POINT_ACKNOWLEDGED)

    def test_without_a_rising_edge_nothing_moves(self, pp: ProfileBench) -> None:
        pp.set_point(0)
        pp.word(NEW)
        pp.write(od.TARGET_POSITION, 400 * STEP)
        pp.word(NEW)
        pp.wait(100)
        assert pp.value(od.POSITION_DEMAND) == 0

    def test_one_further_set_point_waits_and_holds_the_acknowledge(self, pp: ProfileBench) -> None:
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
    def test_an_immediate_change_replaces_both(self, pp: ProfileBench, target: int) -> None:
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

    def test_relative_targets_count_from_the_target_before(self, pp: ProfileBench) -> None:
        pp.set_point(300 * STEP, RELATIVE)
        pp.set_point(300 * STEP, RELATIVE)
        pp.until(Status.TARGET_REACHED)
        assert pp.value(od.POSITION_DEMAND) == 600 * STEP
        pp.set_point(-100 * STEP, RELATIVE)
        pp.wait(20)
        pp.set_point(-100 * STEP, RELATIVE | AT_ONCE)
        pp.until(Status.TARGET_REACHED)
        assert pp.value(od.POSITION_DEMAND) == 400 * STEP

    def test_halt_ramps_to_rest_and_its_release_goes_on(self, pp: ProfileBench) -> None:
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

    def test_a_set_point_during_halt_waits_for_its_release(self, pp: ProfileBench) -> None:
        pp.word(HALT)
        pp.set_point(100 * STEP, HALT)
        pp.wait(100)
        assert pp.value(od.POSITION_DEMAND) == 0
        pp.word()
        pp.until(Status.TARGET_REACHED)
        assert pp.value(od.POSITION_DEMAND) == 100 * STEP

    @pytest.mark.parametrize(("target", "reached"), [(900, 500), (-900, -200)])
    def test_targets_beyond_soft_limits_end_there(self, pp: ProfileBench, target: int, reached: int) -> None:
        pp.write(od.POSITION_LIMIT_MIN, -200 * STEP)
        pp.write(od.POSITION_LIMIT_MAX, 500 * STEP)
        pp.set_point(target * STEP)
        assert pp.has(Status.INTERNAL_LIMIT)
        pp.until(Status.TARGET_REACHED)
        assert pp.value(od.POSITION_DEMAND) == reached * STEP
        pp.set_point(0)
        assert not pp.has(Status.INTERNAL_LIMIT)

    def test_quick_stop_at_speed(self, pp: ProfileBench) -> None:
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

    def test_a_set_point_given_during_a_quick_stop_starts_after_it(self, pp: ProfileBench) -> None:
        pp.set_point(2000 * STEP)
        pp.wait(200)
        pp.write(od.CONTROLWORD, 0x02)
        pp.word()
        pp.set_point(0)
        assert pp.state() is State.OPERATION_ENABLED
        pp.until(Status.TARGET_REACHED)
        assert (pp.value(od.POSITION_DEMAND), pp.value(od.POSITION_ACTUAL)) == (0, 0)

    def test_disabling_the_voltage_stops_dead(self, pp: ProfileBench) -> None:
        pp.set_point(2000 * STEP)
        pp.wait(200)
        pp.write(od.CONTROLWORD, 0)
        pp.steps()
        pp.wait(200)
        assert pp.steps() == 0
        assert pp.value(od.VELOCITY_ACTUAL) == 0

    def test_modes_change_at_standstill_only(self, pp: ProfileBench) -> None:
        pp.set_point(200 * STEP)
        assert pp.write(od.MODE_OF_OPERATION, Mode.PROFILE_VELOCITY) == AbortCode.DEVICE_STATE
        pp.until(Status.TARGET_REACHED)
        assert pp.write(od.MODE_OF_OPERATION, Mode.PROFILE_VELOCITY) == 0

    def test_a_target_beyond_the_i32_range_is_still_planned(self, pp: ProfileBench) -> None:
        pp.set_point(-(2**31))
        assert pp.has(Status.INTERNAL_LIMIT)
        pp.wait(1000)
        assert pp.speed_steps_per_s == pytest.approx(-4000, abs=1)

    def test_records_of_interpolation_do_not_get_into_a_profile(self, pp: ProfileBench) -> None:
        pp.record(50 * STEP, 0, 50, 0)
        pp.set_point(100 * STEP)
        pp.record(50 * STEP, 0, 50, 1)
        pp.until(Status.TARGET_REACHED)
        pp.wait(100)
        assert (pp.value(od.POSITION_DEMAND), pp.steps()) == (100 * STEP, 100)

    def test_as_fast_as_the_pulse_timing_allows(self, pp: ProfileBench) -> None:
        """A profile velocity above the axis' limit is allowed: the axis keeps the limit, less a rounding margin."""
        pp.write(od.PROFILE_VELOCITY, 2**32 - 1)
        pp.write(od.PROFILE_ACCELERATION, 2**32 - 1)
        pp.set_point(30_000 * STEP)
        pp.wait(500)
        assert 14_998 < pp.speed_steps_per_s <= 15_000
        pp.until(Status.TARGET_REACHED)
        assert pp.value(od.POSITION_DEMAND) == 30_000 * STEP

    @pytest.mark.parametrize("profile_type", [-1, 1, 2, 4])
    def test_profile_types_that_are_not_offered(self, pp: ProfileBench, profile_type: int) -> None:
        assert pp.write(od.MOTION_PROFILE_TYPE, profile_type) != 0

    def test_an_overshoot_beyond_the_last_position_is_a_fault(self, pp: ProfileBench) -> None:
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


class TestVelocity:
    @pytest.mark.parametrize("profile_type", [0, 3])
    def test_up_down_and_reverse(self, kernel: Kernel, profile_type: int) -> None:
        pv = ProfileBench(kernel, Mode.PROFILE_VELOCITY)
        pv.write(od.MOTION_PROFILE_TYPE, profile_type)
        assert pv.has(Status.ZERO_SPEED)
        for steps_per_s in (3000, 1000, -2000, 2000, 0):
            pv.write(od.TARGET_VELOCITY, steps_per_s * STEP)
            assert not pv.has(Status.TARGET_REACHED)
            pv.until(Status.TARGET_REACHED, 400)
            assert pv.speed_steps_per_s == pytest.approx(steps_per_s, abs=0.5)
            assert pv.has(Status.ZERO_SPEED) is (steps_per_s == 0)
            pv.wait(50)
            assert pv.has(Status.TARGET_REACHED)
        assert pv.state() is State.OPERATION_ENABLED

    @pytest.mark.parametrize(
        "leave",
        [
            lambda pv: pv.write(od.CONTROLWORD, 0x00),
            lambda pv: pv.write(od.CONTROLWORD, 0x02),
            lambda pv: pv.write(od.CONTROLWORD, 0x06),
            lambda pv: pv.write(od.CONTROLWORD, 0x07),
            lambda pv: pv.set_inputs(DigitalInput.ESTOP),
            lambda pv: pv.measure(supply_10mv=900),
            lambda pv: pv.nmt(0x81),
            lambda pv: pv.write(od.CONSUMER_HEARTBEATS[0], 0x7F_0032) or pv.send(0x77F, b"\x05"),
        ],
        ids=[
            "disable voltage",
            "quick stop",
            "shutdown",
            "disable operation",
            "e-stop",
            "supply",
            "reset",
            "lost host",
        ],
    )
    def test_a_target_does_not_outlive_operation_enabled(
        self, pv: ProfileBench, leave: Callable[[ProfileBench], object]
    ) -> None:
        pv.write(od.TARGET_VELOCITY, 2000 * STEP)
        pv.wait(200)
        leave(pv)
        pv.wait(500)
        assert pv.state() is not State.OPERATION_ENABLED
        pv.set_inputs(DigitalInput(0))
        pv.measure()
        pv.write(od.CONSUMER_HEARTBEATS[0], 0)
        pv.steps()
        pv.write(od.CONTROLWORD, 0x80)
        pv.enable(Mode.PROFILE_VELOCITY)
        pv.wait(500)
        assert (pv.state(), pv.value(od.TARGET_VELOCITY), pv.steps()) == (State.OPERATION_ENABLED, 0, 0)
        pv.write(od.TARGET_VELOCITY, 100 * STEP)
        pv.wait(500)
        assert pv.steps() > 0

    def test_a_target_given_before_the_drive_is_enabled_is_void(self, kernel: Kernel) -> None:
        pv = ProfileBench(kernel, Mode.PROFILE_VELOCITY)
        pv.write(od.CONTROLWORD, 0x07)
        pv.write(od.TARGET_VELOCITY, 100 * STEP)
        pv.word()
        pv.wait(500)
        assert (pv.value(od.TARGET_VELOCITY), pv.steps()) == (0, 0)

    def test_a_target_does_not_outlive_its_mode(self, pv: ProfileBench) -> None:
        pv.write(od.TARGET_VELOCITY, 100 * STEP)
        pv.word(HALT)
        pv.until(Status.TARGET_REACHED)
        pv.steps()
        for mode in (Mode.PROFILE_POSITION, Mode.PROFILE_VELOCITY):
            assert pv.write(od.MODE_OF_OPERATION, mode) == 0
        pv.word()
        pv.wait(500)
        assert (pv.value(od.TARGET_VELOCITY), pv.steps()) == (0, 0)

    def test_the_mean_velocity_is_exact(self, pv: ProfileBench) -> None:
        """1234 steps/s are 1 263 616 units/s, to the grid of 1/64 unit per ms; nothing drifts in 8 s."""
        pv.write(od.TARGET_VELOCITY, 1234 * STEP)
        pv.wait(300)
        begin = pv.value(od.POSITION_DEMAND)
        pv.wait(8000)
        assert pv.value(od.POSITION_DEMAND) - begin == pytest.approx(8 * 1234 * STEP, abs=8 * 1000 / 64 + 2)

    def test_ramps_keep_the_profile_acceleration(self, pv: ProfileBench) -> None:
        pv.write(od.TARGET_VELOCITY, 4000 * STEP)
        assert pv.until(Status.TARGET_REACHED) == pytest.approx(100, abs=2)
        pv.write(od.PROFILE_DECELERATION, 20_000 * STEP)
        pv.write(od.TARGET_VELOCITY, 2000 * STEP)
        assert pv.until(Status.TARGET_REACHED) == pytest.approx(100, abs=17)

    def test_halt_and_its_release(self, pv: ProfileBench) -> None:
        pv.write(od.TARGET_VELOCITY, 2000 * STEP)
        pv.until(Status.TARGET_REACHED)
        pv.word(HALT)
        assert not pv.has(Status.TARGET_REACHED)
        pv.until(Status.ZERO_SPEED)
        assert pv.has(Status.TARGET_REACHED)
        pv.write(od.TARGET_VELOCITY, 1000 * STEP)
        pv.wait(50)
        assert pv.has(Status.ZERO_SPEED)
        pv.word()
        pv.until(Status.TARGET_REACHED)
        assert pv.speed_steps_per_s == pytest.approx(1000, abs=0.5)

    @pytest.mark.parametrize("profile_type", [0, 3])
    @pytest.mark.parametrize("sign", [1, -1])
    def test_soft_limits_stop_it_in_time(self, pv: ProfileBench, sign: int, profile_type: int) -> None:
        pv.write(od.MOTION_PROFILE_TYPE, profile_type)
        pv.write(od.POSITION_LIMIT_MIN, -1000 * STEP)
        pv.write(od.POSITION_LIMIT_MAX, 1500 * STEP)
        pv.write(od.TARGET_VELOCITY, sign * 3000 * STEP)
        pv.until(Status.ZERO_SPEED)
        pv.wait(1)
        end = 1500 if sign > 0 else -1000
        while not pv.has(Status.ZERO_SPEED):
            assert -1000 * STEP <= pv.value(od.POSITION_DEMAND) <= 1500 * STEP
            pv.wait(1)
        assert pv.value(od.POSITION_DEMAND) == end * STEP
        assert pv.has(Status.INTERNAL_LIMIT)
        assert not pv.has(Status.TARGET_REACHED)
        pv.write(od.TARGET_VELOCITY, sign * 100 * STEP)
        pv.wait(50)
        assert pv.value(od.POSITION_DEMAND) == end * STEP
        pv.write(od.TARGET_VELOCITY, -sign * 1000 * STEP)
        assert not pv.has(Status.INTERNAL_LIMIT)
        pv.until(Status.TARGET_REACHED)

    def test_it_starts_when_the_drive_is_enabled_and_stops_when_it_is_disabled(self, pv: ProfileBench) -> None:
        pv.write(od.CONTROLWORD, 0x07)
        pv.write(od.TARGET_VELOCITY, 1000 * STEP)
        pv.wait(50)
        assert pv.value(od.VELOCITY_ACTUAL) == 0
        pv.word()
        pv.until(Status.TARGET_REACHED)
        pv.write(od.CONTROLWORD, 0x07)
        pv.wait(200)
        assert (pv.state(), pv.value(od.VELOCITY_ACTUAL)) == (State.SWITCHED_ON, 0)

    def test_quick_stop_at_speed(self, pv: ProfileBench) -> None:
        pv.write(od.TARGET_VELOCITY, 3000 * STEP)
        pv.until(Status.TARGET_REACHED)
        pv.write(od.CONTROLWORD, 0x02)
        assert pv.state() is State.QUICK_STOP_ACTIVE
        pv.wait(100)
        assert (pv.state(), pv.value(od.VELOCITY_ACTUAL)) == (State.SWITCH_ON_DISABLED, 0)

    def test_it_is_slowed_to_the_axis_limit(self, pv: ProfileBench) -> None:
        pv.write(od.TARGET_VELOCITY, 2**31 - 1)
        pv.until(Status.TARGET_REACHED)
        assert pv.has(Status.INTERNAL_LIMIT)
        assert 14_998 < pv.speed_steps_per_s <= 15_000

    def test_a_process_data_object_sets_it(self, pv: ProfileBench) -> None:
        pv.nmt(0x80)
        for address, value in (
            (od.address_of(od.RPDO_COMMUNICATION[2], od.PDO_COB_ID), 1 << 31 | 0x410),
            (od.address_of(od.RPDO_COMMUNICATION[2], od.PDO_TRANSMISSION_TYPE), 255),
            (od.address_of(od.RPDO_MAPPING[2], 0), 0),
        ):
            assert pv.write(address, value) == 0
        for address, value in (
            (od.address_of(od.RPDO_MAPPING[2], 1), 0x60FF_0020),
            (od.address_of(od.RPDO_MAPPING[2], 0), 1),
            (od.address_of(od.RPDO_COMMUNICATION[2], od.PDO_COB_ID), 0x410),
        ):
            assert pv.write(address, value) == 0
        pv.nmt(1)
        pv.send(0x410, (1000 * STEP).to_bytes(4, "little"))
        pv.wait(1000)
        assert pv.speed_steps_per_s == pytest.approx(1000, abs=0.5)
        statuswords = [int.from_bytes(data[:2], "little") for data in pv.frames(0x190)]
        assert statuswords[-1] & Status.TARGET_REACHED

    def test_an_axis_too_slow_for_the_rounding_stays(self) -> None:
        board = BenchBoard(python_kernel())
        board.write(od.MAX_PROFILE_VELOCITY, 400)
        board.enable(Mode.PROFILE_VELOCITY)
        board.write(od.TARGET_VELOCITY, 400)
        board.wait(100)
        assert board.value(od.VELOCITY_ACTUAL) == 0
        assert board.value(od.STATUSWORD) & Status.INTERNAL_LIMIT


changes = st.tuples(
    st.integers(-(10**6), 10**6),  # target
    st.sampled_from([0, AT_ONCE, RELATIVE, RELATIVE | AT_ONCE, HALT]),
    st.sampled_from([0, 3]),
    st.sampled_from([10**4, 10**6, 10**7, 2**32 - 1]),  # velocity
    st.sampled_from([10**7, 10**8, 2**32 - 1]),  # acceleration
    st.sampled_from([10**7, 10**8, 2**32 - 1]),  # deceleration
    st.sampled_from([0, 0.3, 5, 16, 60, 150]),  # ms until the next command
)


@given(script=st.lists(changes, min_size=1, max_size=8), microsteps=st.sampled_from([1, 2, 8, 16]))
def test_for_any_set_points_the_queue_neither_runs_out_nor_is_refused(
    fast_kernel: Kernel, script: list[tuple[int, int, int, int, int, int, float]], microsteps: int
) -> None:
    board = ProfileBench(fast_kernel, Mode.NONE)
    board.write(od.CONTROLWORD, 0)
    board.write(od.MICROSTEPS, microsteps)
    board.enable(Mode.PROFILE_POSITION)
    for target, bits, profile_type, velocity, acceleration, deceleration, wait_ms in script:
        board.write(od.MOTION_PROFILE_TYPE, profile_type)
        board.write(od.PROFILE_VELOCITY, velocity)
        board.write(od.PROFILE_ACCELERATION, acceleration)
        board.write(od.PROFILE_DECELERATION, deceleration)
        board.write(od.TARGET_POSITION, target)
        board.word(NEW | bits)
        board.word(bits & HALT)
        board.wait(wait_ms)
    board.write(od.PROFILE_VELOCITY, 10**7)
    board.write(od.PROFILE_ACCELERATION, 10**8)
    board.write(od.TARGET_POSITION, 12_345)
    board.word()
    board.word(NEW | AT_ONCE)
    board.until(Status.TARGET_REACHED)
    assert board.value(od.POSITION_DEMAND) == 12_345
    assert board.frames(0x090) == [], "no emergency"
