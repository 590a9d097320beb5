"""Cyclic synchronous velocity through the whole firmware: the axis is where the set-points' integral leads."""

from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.controller.modes.cyclic_position import NO_SYNC
from steptwin.controller.motion.backend import Kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, State, Status
from tests.controller.modes.cyclic_bench import CyclicBench
from tests.controller.modes.test_cyclic_position import LIMIT, Planned, elapsed_ms, fault_of
from tests.controller.units import STEP

CYCLIC_SYNCHRONOUS_VELOCITY = 9
PERIODS = pytest.mark.parametrize("period_ms", [1, 2, 5, 10])
ENABLE, HALT, QUICK_STOP, DISABLE = 0x0F, 0x10F, 0x02, 0x07


class VelocityBench(CyclicBench):
    """A bench board in the mode, whose third RPDO carries the target velocity."""

    def __init__(self, kernel: Kernel, period_ms: int) -> None:
        super().__init__(kernel, period_ms)
        communication, mapping = 0x1402_00, 0x1602_00
        self.nmt(0x80)  # PRE-OPERATIONAL, in which PDOs are configured
        for address, value in (
            (communication + 1, 1 << 31 | 0x410),
            (mapping, 0),
            (mapping + 1, 0x60FF_0020),
            (mapping, 1),
            (communication + 1, 0x410),
            (od.MODE_OF_OPERATION, CYCLIC_SYNCHRONOUS_VELOCITY),
        ):
            assert self.write(address, value) == 0
        self.nmt(0x01)


def integral(velocities: list[int], period_ms: int) -> list[int]:
    """Return the set-points of position that the velocities, in units per s, lead to: whole units, nothing lost."""
    points, exact = [], Fraction(0)
    for velocity in velocities:
        exact += Fraction(velocity * period_ms, 1000)
        points.append(exact.__floor__())
    return points


@PERIODS
@pytest.mark.parametrize("velocity", [333, -7, 600_001, -2_000_000])
def test_a_constant_velocity(fast_kernel: Kernel, period_ms: int, velocity: int) -> None:
    """At the end the demand has gone the whole way; meanwhile its speed is the set-point, to a unit or two a period."""
    speeds = [round(velocity * min(i, 20) / 20) for i in range(400 // period_ms)]
    board = VelocityBench(fast_kernel, period_ms)
    board.follow(speeds)
    assert board.value(od.VELOCITY_ACTUAL) == pytest.approx(velocity, abs=2000 / period_ms + abs(velocity) / 500)
    board.follow([0] * 5)
    assert board.value(od.POSITION_DEMAND) == integral([*speeds, 0], period_ms)[-1]
    assert not board.firmware.motion.axes[0].running
    assert board.state() is State.OPERATION_ENABLED


@pytest.mark.slow
@given(steps=st.lists(st.integers(-40_000, 40_000), min_size=4, max_size=25), period_ms=st.integers(1, 10))
@settings(max_examples=60, deadline=None)
def test_any_velocities_against_exact_arithmetic(fast_kernel: Kernel, steps: list[int], period_ms: int) -> None:
    """At every tick the demand is within a unit of the cubics through the exact integral's whole units."""
    velocities = [0, 0]
    for step in steps:
        velocities.append(velocities[-1] + step)
    points = integral(velocities, period_ms)
    planned = Planned(points, period_ms)
    board = VelocityBench(fast_kernel, period_ms)
    for i, velocity in enumerate(velocities):
        board.cycle(velocity)
        if i < 2:
            continue
        for _ in range(4 * period_ms - 1):
            board.wait(0.25)
            assert abs(board.firmware.motion.axes[0].demand_units - planned.position(elapsed_ms(board))) <= 1


def test_the_mode_is_told(fast_kernel: Kernel) -> None:
    board = VelocityBench(fast_kernel, 5)
    assert board.value(od.SUPPORTED_DRIVE_MODES) & 1 << 8
    assert board.value(od.MODE_OF_OPERATION_DISPLAY) == CYCLIC_SYNCHRONOUS_VELOCITY
    assert not board.has(Status.FOLLOWS_COMMAND)
    board.cycle(1000)
    assert board.has(Status.FOLLOWS_COMMAND)


@pytest.mark.parametrize(("excess", "limited"), [(0, False), (1000, True)])
def test_a_velocity_beyond_the_highest_is_reduced(fast_kernel: Kernel, excess: int, limited: bool) -> None:
    board = VelocityBench(fast_kernel, 10)
    for i in range(100):
        board.cycle(min(LIMIT // 50 * i, LIMIT + excess))
    assert board.value(od.VELOCITY_ACTUAL) == pytest.approx(LIMIT, rel=1e-3)
    assert board.has(Status.INTERNAL_LIMIT) is limited
    assert board.state() is State.OPERATION_ENABLED


@pytest.mark.parametrize("sign", [-1, 1])
def test_it_stops_at_a_soft_limit_and_comes_back(fast_kernel: Kernel, sign: int) -> None:
    board = VelocityBench(fast_kernel, 10)
    board.write(od.CONTROLWORD, DISABLE)
    board.write(od.POSITION_LIMIT_MIN, -100 * STEP)
    board.write(od.POSITION_LIMIT_MAX, 100 * STEP)
    board.write(od.CONTROLWORD, ENABLE)
    speeds = [sign * 100 * STEP * min(i, 10) // 10 for i in range(300)]
    board.follow(speeds)
    assert board.value(od.POSITION_DEMAND) == sign * 100 * STEP
    assert board.has(Status.INTERNAL_LIMIT)
    board.follow([-sign * 100 * STEP * min(i, 10) // 10 for i in range(60)])
    assert abs(board.value(od.POSITION_DEMAND)) < 90 * STEP
    assert not board.has(Status.INTERNAL_LIMIT)


@pytest.mark.parametrize("word", [HALT, QUICK_STOP, DISABLE])
def test_stops_forget_the_velocity(fast_kernel: Kernel, word: int) -> None:
    """What the host had asked for before moves nothing when the drive is enabled again, in any mode."""
    board = VelocityBench(fast_kernel, 5)
    board.follow([600 * STEP * min(i, 20) // 20 for i in range(60)])
    board.write(od.CONTROLWORD, word)
    assert not board.has(Status.FOLLOWS_COMMAND)
    assert board.value(od.TARGET_VELOCITY) == 0
    board.wait(2000)
    assert not board.firmware.motion.axes[0].running
    board.skip()
    stood = board.value(od.POSITION_DEMAND)
    for mode in (CYCLIC_SYNCHRONOUS_VELOCITY, 3):
        for each in (0x06, 0x07, 0x0F):
            board.write(od.CONTROLWORD, each)
        board.write(od.MODE_OF_OPERATION, mode)
        for _ in range(20):
            board.cycle()
        assert board.value(od.POSITION_DEMAND) == stood


def test_a_velocity_written_before_enabling_is_no_set_point(fast_kernel: Kernel) -> None:
    board = VelocityBench(fast_kernel, 1)
    board.write(od.CONTROLWORD, 0x07)
    board.write(od.TARGET_VELOCITY, 10**6)
    board.write(od.CONTROLWORD, ENABLE)
    for _ in range(50):
        board.cycle()
    assert board.value(od.POSITION_DEMAND) == 0


@pytest.mark.parametrize(("lost", "fails"), [(3, False), (5, True)])
def test_lost_syncs_are_bridged_at_the_same_velocity_and_then_a_fault(
    fast_kernel: Kernel, lost: int, fails: bool
) -> None:
    board = VelocityBench(fast_kernel, 5)
    board.write(od.QUICK_STOP_DECELERATION, 40_000_000)
    board.follow([600_000 * min(i, 20) // 20 for i in range(60)])
    for _ in range(lost):
        board.cycle(None, sync=False)
    if fails:
        board.wait(100)
        assert fault_of(board) == (ErrorCode.SYNC_CONTROLLER, NO_SYNC)
        assert board.value(od.TARGET_VELOCITY) == 0
        return
    for _ in range(8):
        board.cycle(600_000)
        assert board.value(od.VELOCITY_ACTUAL) == 600_000
    assert board.state() is State.OPERATION_ENABLED


def test_the_period_stays_while_the_axis_follows(fast_kernel: Kernel) -> None:
    board = VelocityBench(fast_kernel, 5)
    board.cycle(0)
    assert board.write(od.INTERPOLATION_PERIOD, 10) != 0
    board.write(od.CONTROLWORD, DISABLE)
    assert board.write(od.INTERPOLATION_PERIOD, 10) == 0
