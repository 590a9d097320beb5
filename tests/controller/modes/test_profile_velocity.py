"""Profile velocity through the whole firmware: ramps, limits, stops, targets that end with their mode."""

from collections.abc import Callable

import pytest

from steptwin.controller.motion.backend import Kernel, python_kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, Mode, State, Status
from tests.controller.bench_board import BenchBoard
from tests.controller.modes.profile_bench import HALT, ProfileBench
from tests.controller.units import STEP


@pytest.fixture
def pv(fast_kernel: Kernel) -> ProfileBench:
    return ProfileBench(fast_kernel, Mode.PROFILE_VELOCITY)


@pytest.mark.parametrize("profile_type", [0, 3])
def test_up_down_and_reverse(fast_kernel: Kernel, profile_type: int) -> None:
    pv = ProfileBench(fast_kernel, Mode.PROFILE_VELOCITY)
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
def test_a_target_does_not_outlive_operation_enabled(pv: ProfileBench, leave: Callable[[ProfileBench], object]) -> None:
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


def test_a_target_given_before_the_drive_is_enabled_is_void(pv: ProfileBench) -> None:
    pv.write(od.CONTROLWORD, 0x07)
    pv.write(od.TARGET_VELOCITY, 100 * STEP)
    pv.word()
    pv.wait(500)
    assert (pv.value(od.TARGET_VELOCITY), pv.steps()) == (0, 0)


def test_a_target_does_not_outlive_its_mode(pv: ProfileBench) -> None:
    pv.write(od.TARGET_VELOCITY, 100 * STEP)
    pv.word(HALT)
    pv.until(Status.TARGET_REACHED)
    pv.steps()
    for mode in (Mode.PROFILE_POSITION, Mode.PROFILE_VELOCITY):
        assert pv.write(od.MODE_OF_OPERATION, mode) == 0
    pv.word()
    pv.wait(500)
    assert (pv.value(od.TARGET_VELOCITY), pv.steps()) == (0, 0)


def test_the_mean_velocity_is_exact(pv: ProfileBench) -> None:
    """1234 steps/s are 1 263 616 units/s, to the grid of 1/64 unit per ms; nothing drifts in 8 s."""
    pv.write(od.TARGET_VELOCITY, 1234 * STEP)
    pv.wait(300)
    begin = pv.value(od.POSITION_DEMAND)
    pv.wait(8000)
    assert pv.value(od.POSITION_DEMAND) - begin == pytest.approx(8 * 1234 * STEP, abs=8 * 1000 / 64 + 2)


def test_ramps_keep_the_profile_acceleration(pv: ProfileBench) -> None:
    pv.write(od.TARGET_VELOCITY, 4000 * STEP)
    assert pv.until(Status.TARGET_REACHED) == pytest.approx(100, abs=2)
    pv.write(od.PROFILE_DECELERATION, 20_000 * STEP)
    pv.write(od.TARGET_VELOCITY, 2000 * STEP)
    assert pv.until(Status.TARGET_REACHED) == pytest.approx(100, abs=17)


def test_halt_and_its_release(pv: ProfileBench) -> None:
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
def test_soft_limits_stop_it_in_time(pv: ProfileBench, sign: int, profile_type: int) -> None:
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


def test_it_starts_when_the_drive_is_enabled_and_stops_when_it_is_disabled(pv: ProfileBench) -> None:
    pv.write(od.CONTROLWORD, 0x07)
    pv.write(od.TARGET_VELOCITY, 1000 * STEP)
    pv.wait(50)
    assert pv.value(od.VELOCITY_ACTUAL) == 0
    pv.word()
    pv.until(Status.TARGET_REACHED)
    pv.write(od.CONTROLWORD, 0x07)
    pv.wait(200)
    assert (pv.state(), pv.value(od.VELOCITY_ACTUAL)) == (State.SWITCHED_ON, 0)


def test_quick_stop_at_speed(pv: ProfileBench) -> None:
    pv.write(od.TARGET_VELOCITY, 3000 * STEP)
    pv.until(Status.TARGET_REACHED)
    pv.write(od.CONTROLWORD, 0x02)
    assert pv.state() is State.QUICK_STOP_ACTIVE
    pv.wait(100)
    assert (pv.state(), pv.value(od.VELOCITY_ACTUAL)) == (State.SWITCH_ON_DISABLED, 0)


def test_it_is_slowed_to_the_axis_limit(pv: ProfileBench) -> None:
    pv.write(od.TARGET_VELOCITY, 2**31 - 1)
    pv.until(Status.TARGET_REACHED)
    assert pv.has(Status.INTERNAL_LIMIT)
    assert 14_998 < pv.speed_steps_per_s <= 15_000


def test_a_process_data_object_sets_it(pv: ProfileBench) -> None:
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


def test_an_axis_too_slow_for_the_rounding_stays() -> None:
    board = BenchBoard(python_kernel())
    board.write(od.MAX_PROFILE_VELOCITY, 400)
    board.enable(Mode.PROFILE_VELOCITY)
    board.write(od.TARGET_VELOCITY, 400)
    board.wait(100)
    assert board.value(od.VELOCITY_ACTUAL) == 0
    assert board.value(od.STATUSWORD) & Status.INTERNAL_LIMIT
