"""A master chooses the units of positions: gear ratio (6091h), feed constant (6092h), SI unit (60A8h); CiA 402-2."""

import struct
from fractions import Fraction
from math import floor

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, Mode, State, Status
from steptwin.protocol.entry import Access
from steptwin.protocol.exports import render_eds
from steptwin.protocol.objects import ENTRIES
from steptwin.protocol.sdo_frames import AbortCode
from tests.controller.bench_board import BenchBoard
from tests.controller.modes.profile_bench import ProfileBench

RESET_NODE = 0x81
SAVE, LOAD = (int.from_bytes(word, "little") for word in (b"save", b"load"))
REVOLUTION = 3_276_800
"""Wire units in a revolution of the motor."""
TURN = 360_000
"""The same in thousandths of a degree."""
MILLIDEGREE = Fraction(REVOLUTION, TURN)
MILLIDEGREES = 0xFD41_0000
"""Object 60A8h: thousandths (FDh is -3) of a degree (41h), CiA 303-2."""
I32_MAX, U32_MAX = 2**31 - 1, 2**32 - 1
OFF = {
    0x6065_00: U32_MAX,
    0x6067_00: U32_MAX,
    0x607B_01: -(2**31),
    0x607B_02: I32_MAX,
    0x607D_01: -(2**31),
    0x607D_02: I32_MAX,
    0x60C5_00: U32_MAX,
    0x60C6_00: U32_MAX,
}
"""Limits and windows, and the number that switches each off, as after power-up."""
SETTINGS = (
    *OFF,
    0x2011_00,
    0x607A_00,
    0x607C_00,
    0x607F_00,
    0x6081_00,
    0x6082_00,
    0x6083_00,
    0x6084_00,
    0x6085_00,
    0x6099_01,
    0x6099_02,
    0x609A_00,
    0x60A4_01,
    0x60FF_00,
)
READINGS = (
    0x2F00_05,
    0x6062_00,
    0x6064_00,
    0x606C_00,
    0x60BA_00,
    0x60BB_00,
    0x60BC_00,
    0x60BD_00,
    0x60F4_00,
)


def nearest(value: Fraction) -> int:
    return floor(value + Fraction(1, 2))


def place(address: int) -> str:
    return od.place_text(address)


def choose(board: BenchBoard, feed: int = TURN, *, motor: int = 1, shaft: int = 1, feed_shaft: int = 1) -> None:
    """Choose the user unit, as a master does: the four parts in the order of their addresses."""
    factors = (
        (od.GEAR_MOTOR_REVOLUTIONS, motor),
        (od.GEAR_SHAFT_REVOLUTIONS, shaft),
        (od.FEED_UNITS, feed),
        (od.FEED_SHAFT_REVOLUTIONS, feed_shaft),
    )
    for address, value in factors:
        assert board.write(address, value) == 0


@pytest.fixture
def degrees(board: BenchBoard) -> BenchBoard:
    """An axis in thousandths of a degree of its motor's shaft."""
    choose(board)
    return board


def test_these_entries_are_in_user_units() -> None:
    units = ("units", "units per second", "units per second squared", "units per second cubed")
    in_units = {address for address, entry in ENTRIES.items() if entry.unit.value in units}
    of_the_board = {0x608F_01, 0x6092_01, 0x60C1_01}  # the encoder, the factor itself, the PVT record of this maker
    assert in_units - of_the_board == {*SETTINGS, *READINGS}
    assert of_the_board < in_units


@pytest.mark.parametrize("address", SETTINGS, ids=place)
def test_a_setting_is_stored_in_wire_units_and_read_as_it_was_written(degrees: BenchBoard, address: int) -> None:
    for number in (1000, 1001):
        high = address in (0x607B_02, 0x607D_02)
        written = number if not high else 2 * number
        assert degrees.write(address, written) == 0
        end = int(address == 0x607B_02)  # a range includes its last unit
        assert degrees.value(address) == nearest((written + end) * MILLIDEGREE) - end
        assert degrees.read(address) == written


@pytest.mark.parametrize("address", READINGS, ids=place)
def test_a_reading_is_shown_in_user_units(degrees: BenchBoard, address: int) -> None:
    degrees.firmware.nodes[0].dictionary.cell(address).supply = lambda: -REVOLUTION - 5
    assert degrees.value(address) == -REVOLUTION - 5
    assert degrees.read(address) == -TURN - 1  # 0.55 of a unit more


@pytest.mark.slow
@given(st.integers(1, REVOLUTION), st.integers(1, 50), st.integers(1, 50), st.integers(-(2**31), I32_MAX))
def test_a_position_by_sdo_against_fractions(feed: int, motor: int, feed_shaft: int, position: int) -> None:
    board = BenchBoard(fastest_kernel())
    assert board.write(od.HOMING_ZERO_SPEED, U32_MAX) == 0  # so that no speed is below half a unit
    assert board.write(od.GEAR_MOTOR_REVOLUTIONS, motor) == 0
    assert board.write(od.FEED_SHAFT_REVOLUTIONS, feed_shaft) == 0
    size = Fraction(REVOLUTION * motor * feed_shaft, feed)
    slowest = board.value(od.HOMING_SEARCH_SPEED)
    if 2 * slowest < size:
        assert board.write(od.FEED_UNITS, feed) == AbortCode.INCOMPATIBLE
        return
    assert board.write(od.FEED_UNITS, feed) == 0
    wire = nearest(position * size)
    code = board.write(od.TARGET_POSITION, position)
    if wire > I32_MAX:
        assert code == AbortCode.VALUE_TOO_HIGH
    elif wire < -(2**31):
        assert code == AbortCode.VALUE_TOO_LOW
    else:
        assert (code, board.value(od.TARGET_POSITION), board.read(od.TARGET_POSITION)) == (0, wire, position)


@pytest.mark.parametrize(("last", "step"), [(235_929_599, 1), (-235_929_600, -1)])
def test_both_sides_of_what_the_board_can_count(degrees: BenchBoard, last: int, step: int) -> None:
    """655 turns and a third: 2^31 wire units."""
    assert degrees.write(od.TARGET_POSITION, last) == 0
    assert degrees.read(od.TARGET_POSITION) == last
    code = AbortCode.VALUE_TOO_HIGH if step > 0 else AbortCode.VALUE_TOO_LOW
    assert degrees.write(od.TARGET_POSITION, last + step) == code
    assert degrees.read(od.TARGET_POSITION) == last


# --- the ends that mean "off"


@pytest.mark.parametrize(("address", "off"), OFF.items(), ids=[place(address) for address in OFF])
def test_off_is_off_in_every_unit(degrees: BenchBoard, address: int, off: int) -> None:
    assert degrees.read(address) == degrees.value(address) == off
    assert degrees.write(address, 1000) == 0
    assert degrees.value(address) != off
    assert degrees.write(address, off) == 0
    assert degrees.read(address) == degrees.value(address) == off


def test_no_number_becomes_off(board: BenchBoard) -> None:
    choose(board, REVOLUTION, motor=3)
    assert U32_MAX == 3 * 1_431_655_765
    assert board.write(od.POSITION_WINDOW, 1_431_655_765) == AbortCode.VALUE_TOO_HIGH
    assert board.write(od.POSITION_WINDOW, 1_431_655_764) == 0
    assert board.value(od.POSITION_WINDOW) == U32_MAX - 3
    assert board.write(od.MAX_PROFILE_VELOCITY, 1_431_655_765) == 0  # an ordinary number where none means "off"
    assert board.write(od.MAX_PROFILE_VELOCITY, 1_431_655_766) == AbortCode.VALUE_TOO_HIGH


# --- a factor that is refused


@pytest.mark.parametrize("address", [0x6091_01, 0x6091_02, 0x6092_01, 0x6092_02], ids=place)
def test_a_factor_of_zero_is_refused(board: BenchBoard, address: int) -> None:
    before = board.read(address)
    assert board.write(address, 0) == AbortCode.VALUE_TOO_LOW
    assert board.read(address) == before


def test_a_unit_smaller_than_the_boards_own_is_refused(board: BenchBoard) -> None:
    assert board.write(od.FEED_UNITS, REVOLUTION + 1) == 0x0609_0030
    assert board.write(od.GEAR_SHAFT_REVOLUTIONS, 2) == 0x0609_0030
    assert board.write(od.FEED_UNITS, REVOLUTION) == 0
    assert board.write(od.GEAR_MOTOR_REVOLUTIONS, 2) == 0
    assert board.write(od.GEAR_SHAFT_REVOLUTIONS, 2) == 0
    assert board.write(od.GEAR_SHAFT_REVOLUTIONS, 3) == 0x0609_0030
    assert board.read(od.GEAR_SHAFT_REVOLUTIONS) == 2


def test_a_unit_in_which_a_value_written_would_be_zero_is_refused(board: BenchBoard) -> None:
    """A quarter of a revolution per second is the slowest speed after power-up, 0x6099:02."""
    assert board.write(od.FEED_UNITS, 1) == 0x0604_0043
    assert board.read(od.FEED_UNITS) == REVOLUTION
    assert board.read(od.HOMING_ZERO_SPEED) == REVOLUTION // 4
    assert board.write(od.HOMING_ZERO_SPEED, REVOLUTION // 2 - 1) == 0
    assert board.write(od.FEED_UNITS, 1) == 0x0604_0043
    assert board.write(od.HOMING_ZERO_SPEED, REVOLUTION // 2) == 0
    assert board.write(od.FEED_UNITS, 1) == 0
    assert board.read(od.HOMING_ZERO_SPEED) == 1
    assert board.value(od.HOMING_ZERO_SPEED) == REVOLUTION // 2


def test_a_limit_stays_where_it_is_when_the_units_change(board: BenchBoard) -> None:
    """The highest speed is 40 revolutions per second, in whatever numbers, and never "no limit"."""
    for feed, shown in ((REVOLUTION, 40 * REVOLUTION), (TURN, 40 * TURN), (360, 14_400), (8, 320), (REVOLUTION, None)):
        assert board.write(od.FEED_UNITS, feed) == 0
        assert board.value(od.MAX_PROFILE_VELOCITY) == 40 * REVOLUTION
        assert shown in (None, board.read(od.MAX_PROFILE_VELOCITY))
        assert board.firmware.nodes[0].drive.settings.microsteps == 16
        assert board.firmware.motion.axes[0].config.velocity_max_units_per_s == 40 * REVOLUTION


@pytest.mark.parametrize("address", [0x6091_01, 0x6091_02, 0x6092_01, 0x6092_02, od.SI_UNIT_POSITION], ids=place)
def test_units_stay_while_a_motion_can_be_commanded(board: BenchBoard, address: int) -> None:
    value = board.read(address)
    board.nmt(1)
    for word in (0x06, 0x07):
        assert board.write(od.CONTROLWORD, word) == 0
        assert board.write(address, value) == 0
    assert board.write(od.QUICK_STOP_OPTION, 6) == 0
    for word, state in ((0x0F, State.OPERATION_ENABLED), (0x02, State.QUICK_STOP_ACTIVE)):
        assert board.write(od.CONTROLWORD, word) == 0
        assert board.state() is state
        assert board.write(address, value) == 0x0800_0022
    assert board.write(od.CONTROLWORD, 0) == 0
    assert board.write(address, value) == 0


def test_units_stay_during_the_fault_reaction(degrees: BenchBoard) -> None:
    degrees.enable(Mode.PROFILE_VELOCITY)
    assert degrees.write(od.TARGET_VELOCITY, 10 * TURN) == 0
    degrees.wait(2000)
    degrees.set_inputs(DigitalInput.ESTOP)
    degrees.wait(1)
    assert degrees.state() is State.FAULT_REACTION_ACTIVE
    assert degrees.write(od.FEED_UNITS, 360) == 0x0800_0022
    degrees.wait(5000)
    assert degrees.state() is State.FAULT
    assert degrees.write(od.FEED_UNITS, 360) == 0


@pytest.mark.parametrize(
    ("word", "code"),
    [
        (0xFD41_0000, 0),  # thousandths of a degree
        (0x0041_0000, 0),
        (0xFA01_0000, 0),  # micrometres
        (0x00B4_0000, 0),
        (0x0000_0000, 0),
        (0xF701_0000, 0),  # nanometres
        (0xF601_0000, 0x0609_0030),
        (0x0301_0000, 0),  # kilometres
        (0x0401_0000, 0x0609_0030),
        (0x0002_0000, 0x0609_0030),  # kilograms
        (0x0001_0300, 0x0609_0030),  # metres per second
        (0x0001_0001, 0x0609_0030),  # a reserved bit
    ],
)
def test_the_si_unit_names_a_length_or_an_angle(board: BenchBoard, word: int, code: int) -> None:
    assert board.read(od.SI_UNIT_POSITION) == 0x00B5_0000  # increments
    assert board.write(od.SI_UNIT_POSITION, word) == code
    assert board.read(od.SI_UNIT_POSITION) == (0x00B5_0000 if code else word)
    assert board.read(od.MAX_PROFILE_VELOCITY) == 40 * REVOLUTION


# --- flash


def test_the_units_are_stored_with_what_is_written_in_them(degrees: BenchBoard) -> None:
    assert degrees.write(od.POSITION_LIMIT_MAX, 90_000) == 0
    assert degrees.write(od.SI_UNIT_POSITION, MILLIDEGREES) == 0
    degrees.nmt(RESET_NODE)
    assert degrees.read(od.FEED_UNITS) == REVOLUTION
    assert degrees.read(od.POSITION_LIMIT_MAX) == I32_MAX
    choose(degrees)
    assert degrees.write(od.POSITION_LIMIT_MAX, 90_000) == 0
    assert degrees.write(od.SI_UNIT_POSITION, MILLIDEGREES) == 0
    assert degrees.write(od.STORE_APPLICATION, SAVE) == 0
    assert degrees.write(od.POSITION_LIMIT_MAX, 80_000) == 0
    degrees.nmt(RESET_NODE)
    assert degrees.read(od.FEED_UNITS) == TURN
    assert degrees.read(od.SI_UNIT_POSITION) == MILLIDEGREES
    assert degrees.read(od.POSITION_LIMIT_MAX) == 90_000
    assert degrees.read(od.MAX_PROFILE_VELOCITY) == 40 * TURN
    assert degrees.write(od.RESTORE_APPLICATION, LOAD) == 0
    assert degrees.read(od.POSITION_LIMIT_MAX) == 90_000
    degrees.nmt(RESET_NODE)
    assert degrees.read(od.FEED_UNITS) == REVOLUTION
    assert degrees.read(od.SI_UNIT_POSITION) == 0x00B5_0000
    assert degrees.read(od.POSITION_LIMIT_MAX) == I32_MAX
    assert degrees.read(od.MAX_PROFILE_VELOCITY) == 40 * REVOLUTION


def test_each_axis_has_units_of_its_own(pair: BenchBoard) -> None:
    choose(pair)
    assert pair.read(od.MAX_PROFILE_VELOCITY) == 40 * TURN
    assert pair.read(od.MAX_PROFILE_VELOCITY, 1) == 40 * REVOLUTION


# --- PDOs


def test_pdos_carry_user_units(degrees: BenchBoard) -> None:
    assert degrees.write(od.address_of(0x1801, 1), 0x290) == 0  # TPDO2: position and velocity by SYNC
    degrees.nmt(1)
    degrees.send(0x410, struct.pack("<i", 90_000))
    degrees.send(0x080, b"")
    assert degrees.value(od.TARGET_POSITION) == 819_200
    degrees.send(0x410, struct.pack("<i", 235_929_600))
    degrees.send(0x080, b"")
    assert degrees.value(od.TARGET_POSITION) == 819_200
    assert degrees.value(od.RPDO_VALUES_REFUSED) == 1
    assert degrees.value(od.RPDO_LAST_REFUSED) == 0x607A_0020
    assert degrees.write(od.HOME_OFFSET, -45_000) == 0
    degrees.enable(Mode.HOMING)
    assert degrees.write(od.CONTROLWORD, 0x1F) == 0
    degrees.wait(10)
    degrees.send(0x080, b"")
    assert struct.unpack("<ii", degrees.last(0x290)) == (-45_000, 0)


def test_a_pvt_record_stays_in_wire_units(degrees: BenchBoard) -> None:
    degrees.enable()
    assert degrees.write(od.BUFFER_CLEAR, 0) == 0
    for sequence in range(2):
        degrees.record(8_192, 26_214 * (1 - sequence), 40, sequence)
    degrees.start()
    degrees.wait(200)
    assert degrees.value(od.POSITION_DEMAND) == 16_384
    assert degrees.read(od.POSITION_DEMAND) == 1_800


# --- motion


@pytest.fixture
def positioned(fast_kernel: Kernel) -> ProfileBench:
    """An axis in profile position, in thousandths of a degree."""
    bench = ProfileBench(fast_kernel, Mode.PROFILE_POSITION)
    assert bench.write(od.CONTROLWORD, 0) == 0
    choose(bench)
    bench.enable(Mode.PROFILE_POSITION)
    return bench


def test_a_quarter_of_a_turn(positioned: ProfileBench) -> None:
    assert positioned.write(od.PROFILE_VELOCITY, TURN) == 0
    assert positioned.value(od.PROFILE_VELOCITY) == REVOLUTION
    positioned.set_point(90_000)
    positioned.until(Status.TARGET_REACHED)
    assert positioned.value(od.POSITION_DEMAND) == 819_200
    assert positioned.read(od.POSITION_DEMAND) == positioned.read(od.POSITION_ACTUAL) == 90_000
    assert positioned.read(od.POSITION_DEMAND_STEPS) == 800


def test_a_soft_limit(positioned: ProfileBench) -> None:
    assert positioned.write(od.POSITION_LIMIT_MAX, 45_000) == 0
    positioned.set_point(90_000)
    positioned.until(Status.TARGET_REACHED)
    assert positioned.read(od.POSITION_DEMAND) == 45_000
    assert positioned.has(Status.INTERNAL_LIMIT)


def test_a_turn_has_all_its_units(positioned: ProfileBench) -> None:
    """From 0 to 359 999, both included, is a whole revolution, to the wire unit."""
    assert positioned.write(od.POSITION_RANGE_MIN, 0) == 0
    assert positioned.write(od.POSITION_RANGE_MAX, TURN - 1) == 0
    assert positioned.value(od.POSITION_RANGE_MAX) == REVOLUTION - 1
    assert positioned.read(od.POSITION_RANGE_MAX) == TURN - 1
    assert positioned.write(od.POSITIONING_OPTION, 0xC0) == 0
    positioned.set_point(350_000)
    positioned.until(Status.TARGET_REACHED)
    assert positioned.read(od.POSITION_DEMAND) == -10_000


def test_a_speed(degrees: BenchBoard) -> None:
    degrees.enable(Mode.PROFILE_VELOCITY)
    assert degrees.write(od.TARGET_VELOCITY, -TURN) == 0
    degrees.wait(3000)
    assert degrees.value(od.VELOCITY_ACTUAL) == pytest.approx(-REVOLUTION, abs=20)
    assert degrees.read(od.VELOCITY_ACTUAL) == pytest.approx(-TURN, abs=3)


def test_the_eds_says_that_they_may_be_written() -> None:
    eds = render_eds()
    for section in ("6091sub1", "6091sub2", "6092sub1", "6092sub2", "60A8"):
        text = eds.partition(f"[{section}]")[2].partition("[")[0]
        assert "AccessType=rw\n" in text
    for address in (0x6091_01, 0x6091_02, 0x6092_01, 0x6092_02, 0x60A8_00):
        assert ENTRIES[address].access is Access.READ_WRITE
