"""Stops by command: each option code (605Ah to 605Dh) to its end, and the position reference after it."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.node.pins import Pin
from steptwin.controller.node.stops import StopKind
from steptwin.protocol import od
from steptwin.protocol.cia402 import AbortConnection, ErrorCode, Mode, State, Status
from steptwin.protocol.pvt import PvtFlag
from steptwin.protocol.sdo_frames import AbortCode
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


@pytest.mark.parametrize(
    ("deceleration_steps_per_s2", "ramp_ms"),
    [(20_000, 100), (20_001, 100), (19_999, 101), (30_000, 67), (2_000_000, 1), (2_000_001, 1), (100, 255 * 64)],
)
def test_a_ramp_lasts_whole_milliseconds_and_is_never_steeper(
    moving: BenchBoard, deceleration_steps_per_s2: int, ramp_ms: int
) -> None:
    """At most as long as 64 segments of 255 ms: a deceleration that would take longer is exceeded."""
    moving.write(od.PROFILE_DECELERATION, deceleration_steps_per_s2 * STEP)
    assert moving.firmware.nodes[0].drive.stop.duration_ms(StopKind.SLOW_DOWN) == ramp_ms


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


class TestStopsOfAStream:
    def moving(self, board: BenchBoard, records: int = 8) -> None:
        """Every axis runs at 4 kHz, axis 1 the other way, with 20 ms records."""
        board.write(od.QUICK_STOP_DECELERATION, 40_000 * STEP)
        board.write(od.PROFILE_DECELERATION, 40_000 * STEP)
        board.enable()
        for axis in range(len(board.firmware.nodes)):
            sign = 1 - 2 * axis
            board.record(sign * 40 * STEP, sign * 4 * STEP * 64, 20, 0, axis)
            for sequence in range(1, records):
                board.record(sign * 80 * STEP, sign * 4 * STEP * 64, 20, sequence, axis)
        board.start()
        board.wait(50)

    def test_underrun_stops_the_group_and_is_reported(self, pair: BenchBoard) -> None:
        """Axis 0 runs out of records at 4 kHz. Both ramp down in 100 ms, with their own codes, and stay referenced."""
        self.moving(pair, records=5)
        pair.record(-80 * STEP, -4 * STEP * 64, 20, 5, axis=1)
        pair.wait(49)
        assert pair.state(0) is State.OPERATION_ENABLED
        pair.wait(2)
        assert pair.state(0) is State.FAULT_REACTION_ACTIVE
        pair.wait(98)
        assert pair.state(0) is State.FAULT_REACTION_ACTIVE
        pair.wait(10)
        assert pair.state(0) is pair.state(1) is State.FAULT
        assert (pair.emergencies(0), pair.emergencies(1)) == ([0xFF01], [0xFF02])
        assert pair.value(od.ERROR_CODE) == ErrorCode.PVT_UNDERRUN
        assert pair.flags(0) & PvtFlag.UNDERRUN
        assert pair.value(od.PVT_UNDERRUNS) == 1
        assert pair.value(od.POSITION_DEMAND, 0) == pytest.approx((40 + 320 + 15) * STEP, abs=200 * STEP)
        assert abs(pair.value(od.FOLLOWING_ERROR_ACTUAL, 0)) <= 0.57 * STEP

    def test_without_group_stop_the_others_run_on(self, pair: BenchBoard) -> None:
        pair.write(od.GROUP_STOP, 0)
        self.moving(pair, records=5)
        pair.record(-40 * STEP, 0, 20, 5, axis=1)
        pair.wait(300)
        assert (pair.state(0), pair.state(1)) == (State.FAULT, State.OPERATION_ENABLED)
        assert pair.value(od.POSITION_DEMAND, 1) == -(40 + 320 + 40) * STEP

    def test_fault_is_reset_and_the_axis_works_on(self, board: BenchBoard) -> None:
        self.moving(board, records=3)
        board.wait(300)
        assert board.state() is State.FAULT
        board.write(od.CONTROLWORD, 0x80)
        assert board.state() is State.SWITCH_ON_DISABLED
        assert board.emergencies() == [0xFF01, 0]
        assert board.value(od.ERROR_CODE) == board.value(od.ERROR_REGISTER) == 0
        board.write(od.BUFFER_CLEAR, 0)
        board.enable()
        before = board.value(od.POSITION_DEMAND)
        board.record(5 * STEP, 0, 20, 0)
        board.start()
        board.wait(50)
        assert board.value(od.POSITION_DEMAND) == before + 5 * STEP

    def test_quick_stop_ramps_down_then_switches_off(self, board: BenchBoard) -> None:
        self.moving(board)
        board.write(od.CONTROLWORD, 0x02)
        assert board.state() is State.QUICK_STOP_ACTIVE
        board.wait(98)
        assert board.state() is State.QUICK_STOP_ACTIVE
        board.wait(10)
        assert board.state() is State.SWITCH_ON_DISABLED
        assert abs(board.value(od.FOLLOWING_ERROR_ACTUAL)) <= 0.57 * STEP

    def test_interpolation_is_stopped_by_its_enable_bit(self, board: BenchBoard) -> None:
        self.moving(board)
        board.write(od.CONTROLWORD, 0x0F)
        board.wait(110)
        assert board.state() is State.OPERATION_ENABLED
        assert not board.firmware.motion.axes[0].running
        assert not board.flags() & PvtFlag.RUNNING

    @pytest.mark.parametrize(
        ("words", "end"),
        [
            ((0x02, 0x0F, 0x1F), State.SWITCH_ON_DISABLED),
            ((0x0F, 0x1F), State.OPERATION_ENABLED),
            ((0x11F, 0x0F, 0x1F), State.OPERATION_ENABLED),
        ],
    )
    def test_a_start_bit_during_a_ramp_does_not_cut_it_short(
        self, board: BenchBoard, words: tuple[int, ...], end: State
    ) -> None:
        """The demand may never jump: at 4 kHz it moves by at most one step in 250 us."""
        self.moving(board)
        previous = board.value(od.POSITION_DEMAND)
        for word in words:
            board.write(od.CONTROLWORD, word)
        for _ in range(500):
            board.wait(0.25)
            assert abs(board.value(od.POSITION_DEMAND) - previous) <= STEP + 1
            previous = board.value(od.POSITION_DEMAND)
        assert not board.firmware.motion.axes[0].running
        assert board.state() is end

    def test_homing_waits_for_standstill(self, board: BenchBoard) -> None:
        self.moving(board)
        board.write(od.CONTROLWORD, 0x0F)
        assert board.write(od.MODE_OF_OPERATION, 6) == AbortCode.DEVICE_STATE
        board.wait(120)
        assert board.write(od.MODE_OF_OPERATION, 6) == 0
        board.write(od.CONTROLWORD, 0x1F)
        assert board.value(od.POSITION_DEMAND) == 0

    @pytest.mark.parametrize("controlword", [0x02, 0x07, 0x0F, 0x00])
    def test_records_that_arrive_during_and_after_a_stop_move_nothing(
        self, board: BenchBoard, controlword: int
    ) -> None:
        """A host that goes on streaming must not set the axis moving again; clearing the queue opens it."""
        self.moving(board)
        board.write(od.CONTROLWORD, controlword)
        for sequence in range(8, 30):
            board.record(80 * STEP, 4 * STEP * 64, 20, sequence)
            board.wait(10)
        assert not board.firmware.motion.axes[0].running
        assert (board.value(od.PVT_NEXT_SEQUENCE), board.value(od.PVT_FREE_RECORDS)) == (8, 0)
        assert board.flags() & PvtFlag.OVERFLOW
        assert board.write(od.BUFFER_CLEAR, 0) == 0
        assert (board.value(od.PVT_NEXT_SEQUENCE), board.value(od.PVT_FREE_RECORDS)) == (0, 64)

    def just_before_the_end(self, board: BenchBoard, end_velocity: int) -> None:
        """Run one record of 20 ms until the kernel has computed its last tick and the clock is within that tick."""
        board.enable()
        board.record(8 * STEP, end_velocity, 20, 0)
        board.start()
        board.wait(19.9)
        assert board.state() is State.OPERATION_ENABLED

    def test_voltage_cut_in_the_tick_before_an_underrun_stays_cut(self, board: BenchBoard) -> None:
        self.just_before_the_end(board, 64 * STEP)
        board.firmware.take_pins()
        board.write(od.CONTROLWORD, 0x00)
        board.wait(500)
        assert board.state() is State.SWITCH_ON_DISABLED
        assert [(change.pin, change.level) for change in board.firmware.take_pins()] == [(Pin.ENABLE, 0)]
        assert board.emergencies() == []

    def test_quick_stop_in_the_tick_before_an_underrun_is_a_ramp(self, board: BenchBoard) -> None:
        self.just_before_the_end(board, 64 * STEP)
        board.write(od.QUICK_STOP_DECELERATION, 20_000 * STEP)
        board.write(od.PROFILE_DECELERATION, 20_000 * STEP)
        board.write(od.CONTROLWORD, 0x02)
        assert board.state() is State.QUICK_STOP_ACTIVE
        board.wait(45)
        assert board.state() is State.QUICK_STOP_ACTIVE
        board.wait(15)
        assert board.state() is State.SWITCH_ON_DISABLED
        assert board.value(od.POSITION_DEMAND) == pytest.approx((8 + 25) * STEP, abs=2)
        assert board.emergencies() == []

    def test_an_axis_is_under_way_until_the_tick_of_its_end(self, board: BenchBoard) -> None:
        self.just_before_the_end(board, 0)
        assert not board.value(od.STATUSWORD) & 1 << 10
        board.record(STEP, 0, 20, 1)
        for word in (0x0F, 0x1F):  # too early to start again
            board.write(od.CONTROLWORD, word)
        board.wait(100)
        assert board.value(od.STATUSWORD) & 1 << 10
        assert not board.flags() & PvtFlag.RUNNING

    def test_a_fault_does_not_switch_a_drive_on(self, board: BenchBoard) -> None:
        with board.firmware.nodes[0].drive_at(0) as drive:
            drive.fault(ErrorCode.GROUP_STOPPED, detail=0, stop_ms=10)
        assert board.state() is State.SWITCH_ON_DISABLED
        assert board.emergencies() == []

    def at_the_end_of_the_range(self, board: BenchBoard) -> None:
        """Full steps, 800 units/ms, and 200 000 units from the end of i32: a ramp of 0.5 s needs as much again."""
        board.write(od.MICROSTEPS, 1)
        board.write(od.QUICK_STOP_DECELERATION, 100 * 16_384)
        board.write(od.PROFILE_DECELERATION, 100 * 16_384)
        board.enable(mode=6)
        board.write(od.HOME_OFFSET, 2**31 - 1 - 100_000)
        for address, value in ((od.CONTROLWORD, 0x1F), (od.CONTROLWORD, 0x0F), (od.MODE_OF_OPERATION, 7)):
            assert board.write(address, value) == 0
        for sequence, displacement in enumerate((4000, 8000, 8000)):
            board.record(displacement, 800 * 64, 10, sequence)
        board.start()

    def test_a_fault_without_room_for_its_ramp_ends_in_fault(self, board: BenchBoard) -> None:
        self.at_the_end_of_the_range(board)
        board.wait(31)
        assert board.state() is State.FAULT
        board.write(od.CONTROLWORD, 0x80)
        assert board.state() is State.SWITCH_ON_DISABLED

    @pytest.mark.parametrize(
        ("word", "target"),
        [
            (0x02, State.SWITCH_ON_DISABLED),
            (0x06, State.READY_TO_SWITCH_ON),
            (0x07, State.SWITCHED_ON),
            (0x0F, State.OPERATION_ENABLED),
        ],
    )
    def test_a_stop_without_room_for_its_ramp_is_done_at_once(
        self, board: BenchBoard, word: int, target: State
    ) -> None:
        self.at_the_end_of_the_range(board)
        board.wait(25)
        board.write(od.CONTROLWORD, word)
        assert board.state() is target
        assert board.value(od.PVT_FREE_RECORDS) == 0
        board.wait(1000)
        assert board.state() is target

    @pytest.mark.parametrize(
        ("words", "target"),
        [
            ((0x07, 0x0F), State.SWITCHED_ON),
            ((0x06, 0x1F), State.READY_TO_SWITCH_ON),
            ((0x07, 0x06), State.READY_TO_SWITCH_ON),
            ((0x06, 0x0F, 0x07), State.READY_TO_SWITCH_ON),
            ((0x07, 0x02), State.SWITCH_ON_DISABLED),
        ],
    )
    def test_during_a_ramp_only_a_command_that_leads_further_away_counts(
        self, board: BenchBoard, words: tuple[int, ...], target: State
    ) -> None:
        self.moving(board)
        for word in words:
            board.write(od.CONTROLWORD, word)
            board.wait(2)
        assert board.firmware.motion.axes[0].running
        board.wait(110)
        assert not board.firmware.motion.axes[0].running
        assert board.state() is target

    def test_a_command_repeated_during_its_ramp_changes_nothing(self, board: BenchBoard) -> None:
        """A controlword repeated every 0.1 ms must not restart the ramp each time: it would never end."""
        self.moving(board)
        for _ in range(1020):
            board.write(od.CONTROLWORD, 0x07)
            board.wait(0.1)
        assert board.state() is State.SWITCHED_ON

    def test_disable_operation_ramps_down_first(self, board: BenchBoard) -> None:
        self.moving(board)
        board.write(od.CONTROLWORD, 0x07)
        assert board.state() is State.OPERATION_ENABLED
        board.wait(110)
        assert board.state() is State.SWITCHED_ON

    def test_disable_voltage_cuts_at_once(self, board: BenchBoard) -> None:
        self.moving(board)
        board.firmware.motion.take_edges()
        board.write(od.CONTROLWORD, 0x00)
        assert board.state() is State.SWITCH_ON_DISABLED
        board.wait(100)
        assert len(board.firmware.motion.take_edges()[0].clk_counts) == 0

    def test_quick_stop_at_rest_switches_off_at_once(self, board: BenchBoard) -> None:
        board.enable()
        board.write(od.CONTROLWORD, 0x02)
        assert board.state() is State.SWITCH_ON_DISABLED

    def test_steps_that_come_too_late_are_a_fault(self, board: BenchBoard) -> None:
        """A DIR setup of 1 ms delays the first step after a sharp reversal by more than a tick."""
        board.write(od.DIRSETUP_NS, 1_000_000)
        board.enable()
        board.record(10 * STEP, 0, 10, 0)
        board.record(-30 * STEP, 0, 7, 1)
        board.start()
        board.wait(100)
        assert board.emergencies() == [0xFF04]
        assert board.value(od.DELAYED_STEPS) > 0
