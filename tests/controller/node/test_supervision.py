"""Faults that stop an axis: switches, e-stop, voltage, temperature, following error."""

from collections.abc import Callable

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.node.firmware import Firmware
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, ErrorCode, Mode, State, Status
from steptwin.protocol.frame import Frame
from tests.controller.bench_board import BenchBoard
from tests.controller.units import STEP

RAMP_MS = 50
NEGATIVE, POSITIVE = DigitalInput.NEGATIVE_LIMIT, DigitalInput.POSITIVE_LIMIT
NOTHING = DigitalInput(0)
RESET = 0x80


def configure(board: BenchBoard) -> None:
    """Set every axis' position reference and ramps of 40 000 steps/s2."""
    board.enable(Mode.HOMING)
    for axis in range(len(board.inputs)):
        board.write(od.CONTROLWORD, 0x1F, axis)
        board.write(od.CONTROLWORD, 0x0F, axis)
        for address in (od.PROFILE_ACCELERATION, od.PROFILE_DECELERATION, od.QUICK_STOP_DECELERATION):
            board.write(address, 40_000 * STEP, axis)


def jog(board: BenchBoard, steps_per_s: int = 2000, axis: int = 0) -> None:
    board.write(od.TARGET_VELOCITY, steps_per_s * STEP, axis)
    board.write(od.MODE_OF_OPERATION, Mode.PROFILE_VELOCITY, axis)


def recover(board: BenchBoard, axis: int = 0) -> None:
    """Reset the fault and enable again."""
    board.write(od.TARGET_VELOCITY, 0, axis)
    for word in (RESET, 0x06, 0x07, 0x0F):
        board.write(od.CONTROLWORD, word, axis)
    assert board.state(axis) is State.OPERATION_ENABLED


@pytest.fixture
def board(fast_kernel: Kernel) -> BenchBoard:
    board = BenchBoard(fast_kernel)
    configure(board)
    return board


@pytest.fixture
def trio(fast_kernel: Kernel) -> BenchBoard:
    """A board with two axes that interpolate and one that is enabled at rest."""
    board = BenchBoard(fast_kernel, axes=3)
    configure(board)
    board.write(od.MODE_OF_OPERATION, Mode.PROFILE_POSITION, 2)
    for axis in (0, 1):
        board.write(od.MODE_OF_OPERATION, Mode.INTERPOLATED_POSITION, axis)
        board.record(20 * STEP, 2 * STEP * 64, 20, 0, axis)
        for sequence in range(1, 20):
            board.record(40 * STEP, 2 * STEP * 64, 20, sequence, axis)
    for node in board.firmware.nodes[:2]:
        board.send(0x300 + node.node_id, b"\x1f\x00")
    board.send(0x080, b"")
    board.wait(60)
    return board


class TestLimitSwitches:
    @pytest.mark.parametrize(("ahead", "behind", "sign"), [(POSITIVE, NEGATIVE, 1), (NEGATIVE, POSITIVE, -1)])
    def test_only_the_one_ahead_stops_the_axis(
        self, board: BenchBoard, ahead: DigitalInput, behind: DigitalInput, sign: int
    ) -> None:
        jog(board, 2000 * sign)
        board.wait(200)
        board.set_inputs(behind)
        board.wait(10)
        assert board.state() is State.OPERATION_ENABLED
        board.set_inputs(ahead)
        assert board.state() is State.FAULT_REACTION_ACTIVE
        board.wait(RAMP_MS + 2)
        assert board.state() is State.FAULT
        assert board.errors() == [ErrorCode.LIMIT_SWITCH]
        assert board.value(od.ERROR_CODE) == ErrorCode.LIMIT_SWITCH
        assert board.value(od.DIGITAL_INPUTS) == ahead
        assert board.has(Status.POSITION_KNOWN)

    def test_one_can_move_away_from_it_but_not_on(self, board: BenchBoard) -> None:
        jog(board)
        board.wait(200)
        board.set_inputs(POSITIVE)
        board.wait(100)
        recover(board)
        board.write(od.TARGET_VELOCITY, -1000 * STEP)
        board.wait(200)
        assert board.value(od.VELOCITY_ACTUAL) == -1000 * STEP
        assert board.state() is State.OPERATION_ENABLED
        board.write(od.TARGET_VELOCITY, 0)
        board.wait(100)
        stood = board.value(od.POSITION_DEMAND)
        board.write(od.TARGET_VELOCITY, 1000 * STEP)
        board.wait(0.9)
        assert board.state() is State.OPERATION_ENABLED
        board.wait(0.2)  # it is looked at every millisecond
        assert board.state() is not State.OPERATION_ENABLED
        board.wait(100)
        assert board.state() is State.FAULT
        assert abs(board.value(od.POSITION_DEMAND) - stood) < 20 * STEP

    def test_interpolating_axes_stop_with_it_and_report_it(self, trio: BenchBoard) -> None:
        trio.set_inputs(POSITIVE, 1)
        assert [trio.state(axis) for axis in (0, 1)] == [State.FAULT_REACTION_ACTIVE] * 2
        trio.wait(RAMP_MS + 5)
        assert [trio.errors(axis) for axis in range(3)] == [[ErrorCode.GROUP_STOPPED], [ErrorCode.LIMIT_SWITCH], []]
        assert trio.state(2) is State.OPERATION_ENABLED  # it is not in the group
        assert (
            abs(trio.value(od.POSITION_DEMAND) - trio.value(od.POSITION_DEMAND, 1)) <= 1
        )  # the tool keeps its direction


class TestSoftLimits:
    def record_ends(self, board: BenchBoard, low: int, high: int, *records: tuple[int, int]) -> list[int]:
        """Send records of 20 ms; return the details of the EMCYs 0xFF03."""
        board.write(od.MODE_OF_OPERATION, Mode.INTERPOLATED_POSITION)
        board.write(od.POSITION_LIMIT_MIN, low)
        board.write(od.POSITION_LIMIT_MAX, high)
        for sequence, (displacement, velocity) in enumerate(records):
            board.record(displacement, velocity, 20, sequence)
        board.wait(1)
        frames = [data for data in board.frames(0x090) if data[:2] == b"\x03\xff"]
        return [int.from_bytes(data[3:], "little") for data in frames]

    @pytest.mark.parametrize(("displacement", "refused"), [(1000, False), (1001, True), (-1000, False), (-1001, True)])
    def test_a_record_may_end_on_a_limit(self, board: BenchBoard, displacement: int, refused: bool) -> None:
        assert bool(self.record_ends(board, -1000, 1000, (displacement, 0))) is refused

    @pytest.mark.parametrize(("velocity", "refused"), [(150 * 64, False), (151 * 64, True)])
    def test_a_record_may_not_lead_beyond_a_limit_on_its_way(
        self, board: BenchBoard, velocity: int, refused: bool
    ) -> None:
        """To 0 with an end velocity: the hull reaches v T / 3 before the end, 1000 units for 150 units per ms."""
        assert bool(self.record_ends(board, -1000, 10**6, (0, velocity))) is refused

    def test_the_rejection_names_its_reason(self, board: BenchBoard) -> None:
        assert self.record_ends(board, 0, 1000, (500, 0), (501, 0)) == [6 << 8 | 1]
        assert board.value(od.PVT_FLAGS) & 8

    def test_an_axis_outside_may_come_in(self, board: BenchBoard) -> None:
        assert self.record_ends(board, 5000, 10_000, (4000, 0), (0, 0)) == []
        assert board.value(od.BUFFER_POSITION) == 2


class TestEstop:
    def test_all_axes_stop_together_then_lose_their_power(self, trio: BenchBoard) -> None:
        trio.set_inputs(DigitalInput.ESTOP)
        assert [trio.state(axis) for axis in range(3)] == [State.FAULT_REACTION_ACTIVE] * 2 + [State.FAULT]
        assert trio.firmware.nodes[0].drive.energised
        trio.wait(RAMP_MS + 2)
        for axis in range(3):
            assert trio.state(axis) is State.FAULT
            assert not trio.firmware.nodes[axis].drive.energised
            assert trio.errors(axis) == [ErrorCode.ESTOP]
            assert trio.has(Status.POSITION_KNOWN, axis)

    @pytest.mark.parametrize("option", [0, 1, 2])
    def test_the_ramp_is_the_quick_stop_for_any_fault_reaction_option(self, board: BenchBoard, option: int) -> None:
        board.write(od.FAULT_REACTION_OPTION, option)
        jog(board)
        board.wait(200)
        board.set_inputs(DigitalInput.ESTOP)
        board.wait(RAMP_MS - 2)
        assert board.state() is State.FAULT_REACTION_ACTIVE
        board.wait(4)
        assert board.state() is State.FAULT

    def test_it_must_be_released_before_the_fault_is_reset(self, board: BenchBoard) -> None:
        board.set_inputs(DigitalInput.ESTOP)
        board.write(od.CONTROLWORD, RESET)
        assert board.state() is State.FAULT
        board.set_inputs(NOTHING)
        assert board.state() is State.FAULT
        board.write(od.CONTROLWORD, 0)
        recover(board)

    def test_a_drive_is_not_switched_on_while_it_is_pressed(self, fast_kernel: Kernel) -> None:
        board = BenchBoard(fast_kernel)
        board.set_inputs(DigitalInput.ESTOP)
        assert board.state() is State.SWITCH_ON_DISABLED
        assert board.errors() == []
        board.write(od.CONTROLWORD, 0x06)
        board.write(od.CONTROLWORD, 0x07)
        assert board.state() is State.FAULT
        assert not board.firmware.nodes[0].drive.energised

    def test_power_lost_on_the_ramp_loses_the_position(self, board: BenchBoard) -> None:
        jog(board)
        board.wait(200)
        board.set_inputs(DigitalInput.ESTOP)
        board.wait(10)
        board.measure(supply_10mv=500)
        assert board.state() is State.FAULT
        assert not board.has(Status.POSITION_KNOWN)
        assert board.value(od.ERROR_CODE) == ErrorCode.UNDERVOLTAGE


LevelCase = tuple[Callable[[BenchBoard], None], Callable[[BenchBoard], None], ErrorCode, int, bool]
LEVELS: dict[str, LevelCase] = {
    "undervoltage": (lambda b: b.measure(999), lambda b: b.measure(1000), ErrorCode.UNDERVOLTAGE, 0x05, False),
    "overvoltage": (lambda b: b.measure(3401), lambda b: b.measure(3400), ErrorCode.OVERVOLTAGE, 0x05, True),
    "board too hot": (lambda b: b.measure(2400, 851), lambda b: b.measure(2400, 850), ErrorCode.TEMPERATURE, 9, True),
    "driver too hot": (
        lambda b: b.set_inputs(DigitalInput.DRIVER_PROTECT),
        lambda b: b.set_inputs(NOTHING),
        ErrorCode.TEMPERATURE,
        0x09,
        False,
    ),
}
"""The cause, the last value allowed, the error with its register, and whether the axis can still ramp down."""


@pytest.mark.parametrize("case", LEVELS.values(), ids=LEVELS)
def test_levels(board: BenchBoard, case: LevelCase) -> None:
    """Each cause trips beyond its limit, not at it, and prevents the fault reset while it lasts."""
    happens, is_allowed, code, register, ramps = case
    jog(board)
    board.wait(200)
    is_allowed(board)
    board.wait(5)
    assert board.state() is State.OPERATION_ENABLED
    happens(board)
    assert board.state() is (State.FAULT_REACTION_ACTIVE if ramps else State.FAULT)
    board.wait(RAMP_MS + 5)
    assert board.state() is State.FAULT
    assert board.has(Status.POSITION_KNOWN) is ramps
    assert board.errors() == [code]
    assert board.value(od.ERROR_REGISTER) == register
    assert board.value(od.ERROR_HISTORY[0]) & 0xFFFF == code
    board.write(od.CONTROLWORD, RESET)
    assert board.state() is State.FAULT
    is_allowed(board)
    board.write(od.CONTROLWORD, 0)
    recover(board)
    assert board.value(od.ERROR_REGISTER) == 0
    assert board.value(od.ERROR_CODE) == 0
    board.write(od.TARGET_VELOCITY, 1000 * STEP)
    board.wait(200)
    assert board.value(od.VELOCITY_ACTUAL) == 1000 * STEP


def test_undervoltage_of_one_board_stops_all_its_axes(trio: BenchBoard) -> None:
    trio.measure(supply_10mv=800)
    assert [trio.state(axis) for axis in range(3)] == [State.FAULT] * 3
    assert [trio.has(Status.POSITION_KNOWN, axis) for axis in range(3)] == [False, False, True]  # axis 2 was at rest


@pytest.mark.parametrize(("option", "ramp_ms"), [(0, 0), (1, 100), (2, 50)])
def test_fault_reactions(board: BenchBoard, option: int, ramp_ms: int) -> None:
    board.write(od.FAULT_REACTION_OPTION, option)
    board.write(od.PROFILE_DECELERATION, 20_000 * STEP)
    jog(board)
    board.wait(300)
    board.measure(supply_10mv=3500)
    if ramp_ms:
        board.wait(ramp_ms - 2)
        assert board.state() is State.FAULT_REACTION_ACTIVE
        board.wait(4)
    assert board.state() is State.FAULT
    assert board.has(Status.POSITION_KNOWN) is bool(ramp_ms)


class SlippingBoard(BenchBoard):
    """A bench board with the lost steps that the test sets."""

    def __init__(self, kernel: Kernel) -> None:
        super().__init__(kernel)
        self.lost_steps = 0
        self.firmware = Firmware(kernel, 1)
        dictionary = self.firmware.nodes[0].dictionary
        dictionary.cell(od.LOST_STEPS).supply = lambda: self.lost_steps
        dictionary.cell(od.ROTOR_POSITION_STEPS).supply = lambda: -self.lost_steps
        self.firmware.boot(0)
        configure(self)


class TestFollowingError:
    WINDOW = 10 * STEP

    @pytest.fixture
    def slipping(self, fast_kernel: Kernel) -> SlippingBoard:
        board = SlippingBoard(fast_kernel)
        board.write(od.FOLLOWING_ERROR_WINDOW, self.WINDOW)
        board.write(od.FOLLOWING_ERROR_TIMEOUT_MS, 100)
        jog(board)
        board.wait(200)
        return board

    def test_it_is_the_demand_less_the_count_of_the_driver(self, slipping: SlippingBoard) -> None:
        slipping.lost_steps = 7
        assert abs(slipping.value(od.FOLLOWING_ERROR_ACTUAL) - 7 * STEP) <= 0.57 * STEP
        assert slipping.value(od.ROTOR_POSITION_STEPS) == -7
        assert slipping.value(od.LOST_STEPS) == 7

    def test_within_the_window_nothing_happens(self, slipping: SlippingBoard) -> None:
        slipping.lost_steps = 9
        slipping.wait(500)
        assert slipping.state() is State.OPERATION_ENABLED

    def test_beyond_it_for_its_time_is_a_fault(self, slipping: SlippingBoard) -> None:
        slipping.lost_steps = 11
        slipping.wait(95)
        assert slipping.state() is State.OPERATION_ENABLED
        slipping.wait(20)
        assert slipping.state() is State.FAULT_REACTION_ACTIVE
        slipping.wait(RAMP_MS)
        assert slipping.errors() == [ErrorCode.FOLLOWING_ERROR]
        assert slipping.value(od.ERROR_REGISTER) == 0x21

    def test_a_short_following_error_is_no_fault(self, slipping: SlippingBoard) -> None:
        for _ in range(3):
            slipping.lost_steps = 20
            slipping.wait(80)
            slipping.lost_steps = 0
            slipping.wait(80)
        assert slipping.state() is State.OPERATION_ENABLED

    def test_at_standstill_its_time_does_not_run(self, slipping: SlippingBoard) -> None:
        """Out of its window while the axis stops, for a second at rest, and again in motion: its 100 ms begin anew."""
        slipping.lost_steps = 20
        slipping.wait(30)
        slipping.write(od.TARGET_VELOCITY, 0)
        slipping.wait(1000)
        slipping.write(od.TARGET_VELOCITY, 2000 * STEP)
        slipping.wait(80)
        assert slipping.state() is State.OPERATION_ENABLED
        slipping.wait(40)
        assert slipping.errors() == [ErrorCode.FOLLOWING_ERROR]

    def test_a_new_reference_resets_it(self, slipping: SlippingBoard) -> None:
        slipping.lost_steps = 50
        slipping.wait(300)
        assert slipping.state() is State.FAULT
        recover(slipping)
        slipping.write(od.MODE_OF_OPERATION, Mode.HOMING)
        slipping.write(od.CONTROLWORD, 0x1F)
        assert abs(slipping.value(od.FOLLOWING_ERROR_ACTUAL)) <= STEP
        slipping.write(od.CONTROLWORD, 0x0F)
        jog(slipping, -500)
        slipping.wait(500)
        assert slipping.state() is State.OPERATION_ENABLED

    def test_it_is_off_by_default(self, fast_kernel: Kernel) -> None:
        board = SlippingBoard(fast_kernel)
        jog(board)
        board.lost_steps = 10_000
        board.wait(500)
        assert board.state() is State.OPERATION_ENABLED

    @pytest.mark.parametrize("mode", [Mode.PROFILE_POSITION, Mode.CYCLIC_SYNCHRONOUS_POSITION])
    def test_bit_13_shows_it_in_the_modes_that_define_it(self, slipping: SlippingBoard, mode: Mode) -> None:
        slipping.write(od.TARGET_VELOCITY, 0)
        slipping.wait(100)
        slipping.write(od.MODE_OF_OPERATION, mode)
        assert not slipping.has(Status.FOLLOWING_ERROR)
        slipping.lost_steps = 11
        assert slipping.has(Status.FOLLOWING_ERROR)


class TestPositionWindow:
    def moved(self, board: BenchBoard, window_units: int, time_ms: int) -> None:
        """Move to 100.5 steps: the counter is then half a step off."""
        board.write(od.POSITION_WINDOW, window_units)
        board.write(od.POSITION_WINDOW_TIME_MS, time_ms)
        board.write(od.MODE_OF_OPERATION, Mode.PROFILE_POSITION)
        board.write(od.PROFILE_VELOCITY, 2000 * STEP)
        board.write(od.TARGET_POSITION, 100 * STEP + STEP // 2)
        board.write(od.CONTROLWORD, 0x1F)
        board.write(od.CONTROLWORD, 0x0F)
        while board.firmware.motion.axes[0].running:
            board.wait(1)

    @pytest.mark.parametrize(("window_units", "reached"), [(STEP // 2, True), (STEP // 2 - 1, False)])
    def test_target_reached_requires_the_window(self, board: BenchBoard, window_units: int, reached: bool) -> None:
        self.moved(board, window_units, 0)
        board.wait(1)
        assert board.has(Status.TARGET_REACHED) is reached

    def test_target_reached_requires_the_window_time(self, board: BenchBoard) -> None:
        self.moved(board, STEP, 20)
        board.wait(17)
        assert not board.has(Status.TARGET_REACHED)
        board.wait(4)
        assert board.has(Status.TARGET_REACHED)


def test_inputs_are_reported_at_once(board: BenchBoard) -> None:
    """TPDO4 is event-driven: digital inputs (60FDh) and error code (603Fh)."""
    board.sent.clear()
    board.set_inputs(DigitalInput.HOME)
    assert board.frames(0x490) == [b"\x04\0\0\0\0\0"]
    board.set_inputs(DigitalInput.HOME)
    assert len(board.frames(0x490)) == 1


def test_polarity_and_invert_mask_reverse_dir(fast_kernel: Kernel) -> None:
    levels = {}
    for polarity in (0, 0xC0):
        for mask in (0, 2):
            board = BenchBoard(fast_kernel)
            assert board.write(od.POLARITY, polarity) == 0
            assert board.write(od.INVERT_MASK, mask) == 0
            configure(board)
            jog(board, 1000)
            board.wait(100)
            [edges] = board.firmware.motion.take_edges()
            assert board.value(od.POSITION_ACTUAL) > 0
            levels[polarity, mask] = [int(edge) & 1 for edge in edges.direction]
    assert levels == {(0, 0): [1], (0, 2): [], (0xC0, 0): [], (0xC0, 2): [1]}


def test_torque_at_rest(fast_kernel: Kernel) -> None:
    board = BenchBoard(fast_kernel)
    assert board.write(od.REST_TORQUE_PERCENT, 50) == 0
    configure(board)
    board.firmware.take_pins()

    def torque_pins() -> list[tuple[str, int]]:
        return [(change.pin.value, change.level) for change in board.firmware.take_pins()]

    board.wait(490)
    assert torque_pins() == []
    board.wait(20)
    assert torque_pins() == [("TQ2", 1)]
    jog(board)
    assert torque_pins() == [("TQ2", 0)]


def test_time_stamp_counts_on_from_what_is_written(board: BenchBoard) -> None:
    board.write(od.TIME_STAMP, 5_000_000)
    board.wait(3)
    board.send(0x610, bytes.fromhex("4013100000000000"))
    answer = board.last(0x590)
    assert int.from_bytes(answer[4:], "little") == 5_003_000


def test_frames_with_unknown_cob_ids_change_nothing(board: BenchBoard) -> None:
    before = board.firmware.dropped_frames
    board.firmware.receive(Frame(0x7FF, b""), board.now)
    assert board.firmware.dropped_frames == before + 1
