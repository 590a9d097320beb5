"""Stops by command: each option code (605Ah to 605Dh) to its end, and the position reference after it."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.node.pins import Pin
from steptwin.protocol import od
from steptwin.protocol.abort import AbortCode
from steptwin.protocol.cia402 import AbortConnection, Mode, State, Status
from tests.controller.bench_board import BenchBoard
from tests.controller.units import STEP

SPEED = 2000 * STEP
SLOW_MS, QUICK_MS = 100, 50
"""Durations of the two ramps from SPEED."""

SHUTDOWN, DISABLE, QUICK_STOP, DISABLE_VOLTAGE, ENABLE, HALT = 0x06, 0x07, 0x02, 0x00, 0x0F, 0x10F


@pytest.fixture
def moving(fast_kernel: Kernel) -> BenchBoard:
    """A board whose axis has its position reference and moves at SPEED, in profile velocity mode."""
    board = BenchBoard(fast_kernel)
    board.enable(Mode.HOMING)
    board.write(od.CONTROLWORD, 0x1F)
    board.write(od.CONTROLWORD, ENABLE)
    board.write(od.MODE_OF_OPERATION, Mode.PROFILE_VELOCITY)
    for address, value in (
        (od.PROFILE_ACCELERATION, 40_000),
        (od.PROFILE_DECELERATION, 20_000),
        (od.QUICK_STOP_DECELERATION, 40_000),
    ):
        board.write(address, value * STEP)
    board.write(od.TARGET_VELOCITY, SPEED)
    board.wait(200)
    assert board.value(od.VELOCITY_ACTUAL) == SPEED
    assert board.has(Status.POSITION_KNOWN)
    return board


def pulses(board: BenchBoard) -> int:
    """Return the number of CLK pulses since the last call."""
    return len(board.firmware.motion.take_edges()[0].clk_counts) // 2


def energised(board: BenchBoard) -> bool:
    return board.firmware.nodes[0].drive.energised


def comes_to_rest(board: BenchBoard, ramp_ms: int, end: State) -> None:
    """Check that the drive is on for the whole ramp, at half speed in its middle, and then at rest in the end state."""
    start = board.value(od.POSITION_DEMAND)
    board.wait(ramp_ms / 2)
    assert energised(board)
    assert board.value(od.VELOCITY_ACTUAL) == pytest.approx(SPEED / 2, rel=0.06)
    board.wait(ramp_ms / 2 - 2)
    assert board.value(od.VELOCITY_ACTUAL) > 0
    assert energised(board)
    board.wait(4)
    assert board.value(od.VELOCITY_ACTUAL) == 0
    assert board.state() is end
    assert board.value(od.POSITION_DEMAND) - start == pytest.approx(SPEED * ramp_ms / 2000, rel=0.03)
    assert board.has(Status.POSITION_KNOWN)


def is_cut(board: BenchBoard, end: State) -> None:
    """Check that no pulse follows and that the position reference is lost."""
    pulses(board)
    board.wait(100)
    assert pulses(board) == 0
    assert board.state() is end
    assert not board.has(Status.POSITION_KNOWN)


@pytest.mark.parametrize(
    ("option", "ramp_ms", "end"),
    [
        (1, SLOW_MS, State.SWITCH_ON_DISABLED),
        (2, QUICK_MS, State.SWITCH_ON_DISABLED),
        (5, SLOW_MS, State.QUICK_STOP_ACTIVE),
        (6, QUICK_MS, State.QUICK_STOP_ACTIVE),
    ],
)
def test_quick_stop_ramps(moving: BenchBoard, option: int, ramp_ms: int, end: State) -> None:
    assert moving.write(od.QUICK_STOP_OPTION, option) == 0
    moving.write(od.CONTROLWORD, QUICK_STOP)
    assert moving.state() is State.QUICK_STOP_ACTIVE
    comes_to_rest(moving, ramp_ms, end)
    assert energised(moving) is (end is State.QUICK_STOP_ACTIVE)


def test_a_quick_stop_that_stays_can_be_left_both_ways(moving: BenchBoard) -> None:
    moving.write(od.QUICK_STOP_OPTION, 6)
    moving.write(od.CONTROLWORD, QUICK_STOP)
    moving.wait(100)
    moving.write(od.TARGET_VELOCITY, 0)
    moving.write(od.CONTROLWORD, ENABLE)
    assert moving.state() is State.OPERATION_ENABLED
    moving.write(od.CONTROLWORD, QUICK_STOP)
    assert moving.state() is State.QUICK_STOP_ACTIVE  # at rest already; the drive stays in this state
    moving.write(od.CONTROLWORD, DISABLE_VOLTAGE)
    assert moving.state() is State.SWITCH_ON_DISABLED


@pytest.mark.parametrize(
    ("address", "word", "end"),
    [
        (od.QUICK_STOP_OPTION, QUICK_STOP, State.SWITCH_ON_DISABLED),
        (od.SHUTDOWN_OPTION, SHUTDOWN, State.READY_TO_SWITCH_ON),
        (od.DISABLE_OPERATION_OPTION, DISABLE, State.SWITCHED_ON),
    ],
)
def test_option_0_cuts(moving: BenchBoard, address: int, word: int, end: State) -> None:
    assert moving.write(address, 0) == 0
    moving.write(od.CONTROLWORD, word)
    is_cut(moving, end)


def test_disable_voltage_always_cuts(moving: BenchBoard) -> None:
    moving.write(od.CONTROLWORD, DISABLE_VOLTAGE)
    is_cut(moving, State.SWITCH_ON_DISABLED)


@pytest.mark.parametrize(("word", "end"), [(SHUTDOWN, State.READY_TO_SWITCH_ON), (DISABLE, State.SWITCHED_ON)])
def test_shutdown_and_disable_slow_down_by_default(moving: BenchBoard, word: int, end: State) -> None:
    moving.write(od.CONTROLWORD, word)
    assert moving.state() is State.OPERATION_ENABLED
    comes_to_rest(moving, SLOW_MS, end)


def test_a_disabled_drive_keeps_its_current_and_one_shut_down_does_not(moving: BenchBoard) -> None:
    moving.write(od.CONTROLWORD, DISABLE)
    moving.wait(150)
    assert energised(moving)
    moving.write(od.CONTROLWORD, SHUTDOWN)
    assert not energised(moving)
    assert moving.has(Status.POSITION_KNOWN)  # it was at rest


def test_a_quick_stop_hurries_a_slow_ramp_up(moving: BenchBoard) -> None:
    moving.write(od.CONTROLWORD, DISABLE)
    moving.wait(SLOW_MS / 2)
    moving.write(od.CONTROLWORD, QUICK_STOP)
    moving.wait(QUICK_MS / 2 + 2)
    assert moving.value(od.VELOCITY_ACTUAL) == 0
    assert moving.state() is State.SWITCH_ON_DISABLED


@pytest.mark.parametrize(("option", "ramp_ms"), [(1, SLOW_MS), (2, QUICK_MS)])
def test_halt_of_a_profile(moving: BenchBoard, option: int, ramp_ms: int) -> None:
    moving.write(od.HALT_OPTION, option)
    moving.write(od.CONTROLWORD, HALT)
    moving.wait(ramp_ms - 10)
    assert moving.value(od.VELOCITY_ACTUAL) > 0
    moving.wait(30)  # a profile begins with the end of a segment of at most 16 ms
    assert moving.value(od.VELOCITY_ACTUAL) == 0
    assert moving.state() is State.OPERATION_ENABLED
    moving.write(od.CONTROLWORD, ENABLE)
    moving.wait(200)
    assert moving.value(od.VELOCITY_ACTUAL) == SPEED


@pytest.mark.parametrize(("option", "ramp_ms"), [(1, SLOW_MS), (2, QUICK_MS)])
def test_halt_of_a_group(fast_kernel: Kernel, option: int, ramp_ms: int) -> None:
    board = BenchBoard(fast_kernel)
    for address, value in ((od.PROFILE_DECELERATION, 20_000), (od.QUICK_STOP_DECELERATION, 40_000)):
        board.write(address, value * STEP)
    board.write(od.HALT_OPTION, option)
    board.enable()
    board.record(20 * STEP, 2 * STEP * 64, 20, 0)
    for sequence in range(1, 30):
        board.record(40 * STEP, 2 * STEP * 64, 20, sequence)
    board.start()
    board.wait(50)
    board.write(od.CONTROLWORD, 0x11F)
    board.wait(ramp_ms - 2)
    assert board.value(od.VELOCITY_ACTUAL) > 0
    board.wait(3)
    assert board.value(od.VELOCITY_ACTUAL) == 0


@pytest.mark.parametrize(
    ("address", "values"),
    [
        (od.QUICK_STOP_OPTION, {0, 1, 2, 5, 6}),
        (od.SHUTDOWN_OPTION, {0, 1}),
        (od.DISABLE_OPERATION_OPTION, {0, 1}),
        (od.HALT_OPTION, {1, 2}),
        (od.FAULT_REACTION_OPTION, {0, 1, 2}),
    ],
)
def test_options_that_a_stepper_does_not_have_are_refused(fast_kernel: Kernel, address: int, values: set[int]) -> None:
    board = BenchBoard(fast_kernel)
    refusals = {AbortCode.VALUE_RANGE, AbortCode.VALUE_TOO_LOW, AbortCode.VALUE_TOO_HIGH}
    for value in range(-2, 9):
        assert (board.write(address, value) == 0) is (value in values)
        assert board.write(address, value) in refusals | {0}


@pytest.mark.parametrize("option", [AbortConnection.NO_ACTION, AbortConnection.DISABLE_VOLTAGE])
def test_a_reset_that_cuts_a_moving_axis_loses_its_position(moving: BenchBoard, option: AbortConnection) -> None:
    moving.write(od.ABORT_CONNECTION_OPTION, option)
    moving.nmt(0x81)
    is_cut(moving, State.SWITCH_ON_DISABLED)


def test_a_reset_of_a_standing_node_does_not(moving: BenchBoard) -> None:
    moving.write(od.TARGET_VELOCITY, 0)
    moving.wait(200)
    moving.nmt(0x81)
    assert moving.has(Status.POSITION_KNOWN)


def test_another_excitation_mode_resets_the_driver_and_loses_the_position(moving: BenchBoard) -> None:
    moving.write(od.TARGET_VELOCITY, 0)
    moving.wait(200)
    moving.write(od.CONTROLWORD, SHUTDOWN)
    moving.firmware.take_pins()
    assert moving.write(od.MICROSTEPS, 8) == 0
    changes = [(change.pin, change.level) for change in moving.firmware.take_pins()]
    assert changes == [(Pin.RESET, 0), (Pin.M1, 1), (Pin.RESET, 1)]
    assert not moving.has(Status.POSITION_KNOWN)
