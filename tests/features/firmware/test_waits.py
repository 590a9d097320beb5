"""Firmware that waits in its interrupts, and firmware whose STEP rests high: what the drivers and the bus see."""

import pytest

from steptwin.emulator.drivers.axis_wires import Wire, WireState
from steptwin.features.faults.kinds.machine import BrownOut, EmergencyStop, WatchdogReset
from steptwin.features.faults.kinds.wiring import SetWire
from steptwin.features.firmware.options import FirmwareOptions
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from tests.features.firmware.compilers import CPP, NEEDS_GCC, Build

pytestmark = NEEDS_GCC

HAL = "steptwin_hal.c"

ROBOT = load_robot("teaching-scara")
JOINT = ROBOT.axis_names[0]
US, MS = 72, 72_000
IN_CAN, IN_TIMER, NESTED, CAN_BUSY = 1, 2, 3, 4


def wait_until(board: BoardUnderTest, at_s: float) -> None:
    """Let time pass up to an instant since power-up."""
    board.wait(at_s - board.now_s())


def moved(board: BoardUnderTest) -> int:
    """The steps that the driver has made since power-up."""
    return int(board.pins(JOINT).step_signs.sum())


def told(board: BoardUnderTest) -> list[tuple[int, str]]:
    """The frames of the firmware: milliseconds since power-up, rounded down, and what each says."""
    return [(counts // MS, chr(frame.data[0])) for counts, frame in board.bus_log if frame.cob_id == 0x300]


def test_busy_waits_in_the_can_interrupt_make_pulses(build: Build) -> None:
    board = BoardUnderTest(ROBOT, extras=[FirmwareOptions(firmware=build("waits.c", HAL, WAY=IN_CAN))])
    board.wait(0.01)
    for _ in range(3):
        board.network.send_message(0x123, b"")
        board.wait(0.001)
    pins = board.pins(JOINT)
    assert moved(board) == -3
    assert (pins.clk_fall_counts - pins.clk_rise_counts).tolist() == [35 * US] * 3
    assert board.violations() == []


def test_busy_waits_in_a_timers_interrupt_make_pulses(build: Build) -> None:
    board = BoardUnderTest(ROBOT, extras=[FirmwareOptions(firmware=build("waits.c", HAL, WAY=IN_TIMER))])
    wait_until(board, 0.0101)
    assert board.pins(JOINT).clk_rise_counts.tolist() == [ms * MS for ms in range(6, 11)]
    assert (board.pins(JOINT).clk_fall_counts - board.pins(JOINT).clk_rise_counts).tolist() == [35 * US] * 5


def test_what_a_waiting_interrupt_lets_through(build: Build) -> None:
    """One that waits from 25 to 35 ms: the urgent timer comes in time, the lazy one once, after it, then main."""
    board = BoardUnderTest(ROBOT, extras=[FirmwareOptions(firmware=build("waits.c", HAL, WAY=NESTED))])
    wait_until(board, 0.03)
    board.operate(EmergencyStop(pressed=True))
    wait_until(board, 0.0409)
    assert [event for event in told(board) if event[0] >= 23] == [
        (23, "L"),
        (25, "<"),
        (35, ">"),
        (35, "L"),
        (35, "i"),
        (35, "m"),
        (38, "L"),
    ]
    pins = board.pins(JOINT)
    assert pins.clk_rise_counts.tolist() == [ms * MS for ms in (9, 17, 25, 33)]
    assert pins.clk_fall_counts.tolist() == [ms * MS for ms in (13, 21, 29, 37)]


def test_a_waiting_can_interrupt_has_three_frames_pending(build: Build) -> None:
    board = BoardUnderTest(ROBOT, extras=[FirmwareOptions(firmware=build("waits.c", HAL, WAY=CAN_BUSY))])
    wait_until(board, 0.0101)
    for name in b"abcde":
        board.network.send_message(0x123, bytes([name]))
    wait_until(board, 0.035)
    assert [what for _, what in told(board)] == ["a", "b", "c", "d"]
    assert [ms for ms, _ in told(board)] == [10, 15, 20, 25]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("profile", "low_us"), [("3a-module", 10), ("3a-module", 950), ("dm542", 10), ("slow-blue-board", 200)]
)
def test_step_that_rests_high_makes_every_step(build: Build, profile: str, low_us: int) -> None:
    """Each is known at once, those before DIR turns and ENABLE falls go the right way, and the last one counts."""
    board = BoardUnderTest(
        ROBOT, extras=[FirmwareOptions(firmware=build("rests_high.c", HAL, LOW_US=low_us))], driver_profile=profile
    )
    seen = []
    for at_s in (0.0175, 0.0219, 0.0500):
        wait_until(board, at_s)
        seen.append(moved(board))
    assert seen == [10, 7 if low_us == 950 else 6, 0]
    pins, at_us = board.pins(JOINT), 0 if profile == "slow-blue-board" else low_us
    assert pins.step_counts.tolist() == [ms * MS + at_us * US for ms in (*range(7, 17), *range(18, 28))]
    assert pins.step_signs.tolist() == [1] * 10 + [-1] * 10
    assert board.violations() == []


def test_a_short_low_pulse_is_seen_and_a_driver_that_steps_at_falls_misses_it(build: Build) -> None:
    board = BoardUnderTest(
        ROBOT,
        extras=[FirmwareOptions(firmware=build("rests_high.c", HAL, LOW_US=20))],
        driver_profile="slow-blue-board",
    )
    wait_until(board, 0.03)
    assert moved(board) == 0
    assert {(each.rule, each.value) for each in board.violations()} == {("clk_high", 20.0)}
    assert len(board.violations()) == 20


@pytest.mark.slow
def test_the_emergency_stop_and_the_supply_end_a_motion_that_rests_high(build: Build) -> None:
    """The firmware is not run ahead of the inputs, however fast it steps."""
    board = BoardUnderTest(
        ROBOT, extras=[FirmwareOptions(firmware=build("rests_high.c", HAL, LOW_US=10))], driver_profile="chip-100pf"
    )
    wait_until(board, 0.0124)
    board.operate(EmergencyStop(pressed=True))
    board.wait(0.01)
    assert moved(board) == 6
    board.operate(EmergencyStop(pressed=False))
    board.operate(WatchdogReset())
    board.wait(0.0125)
    assert moved(board) == 6 + 3
    board.operate(BrownOut(5))
    board.wait(0.1)
    pins = board.pins(JOINT)
    assert moved(board) == 6 + 3 + 0
    assert pins.clk_rise_counts.size == pins.clk_fall_counts.size == 3 + 6 + 3 + 20
    assert (pins.clk_fall_counts > pins.clk_rise_counts).all()
    assert (pins.clk_rise_counts[1:] > pins.clk_fall_counts[:-1]).all()


@pytest.mark.parametrize(("wire", "steps"), [(Wire.DIR, 3 - 17), (Wire.STEP, 3)])
def test_a_broken_wire_while_step_rests_high(build: Build, wire: Wire, steps: int) -> None:
    board = BoardUnderTest(ROBOT, extras=[FirmwareOptions(firmware=build("rests_high.c", HAL, LOW_US=10))])
    board.operate(SetWire(0, wire, WireState.BROKEN))
    board.wait(0.05)
    assert moved(board) == steps


@pytest.mark.skipif(CPP is None, reason="no C++ compiler is installed")
def test_the_interface_is_for_cpp_too(build: Build) -> None:
    board = BoardUnderTest(ROBOT, extras=[FirmwareOptions(firmware=build("waits.c", HAL, compiler=CPP, WAY=IN_TIMER))])
    wait_until(board, 0.0101)
    assert moved(board) == -5
