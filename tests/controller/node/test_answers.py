"""Answers that a real drive gives: to careless controlwords, crossed limits, refused values, a missing supply."""

import itertools
import re
from pathlib import Path

import pytest

from steptwin import controller
from steptwin.controller.motion.backend import Kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, Mode, State
from steptwin.protocol.pdo import ANNOUNCED
from tests.controller.bench_board import BenchBoard
from tests.controller.units import STEP

SHUTDOWN, SWITCH_ON, ENABLE = 0x06, 0x07, 0x0F
START = 0x1F
VOLTAGE_ENABLED = 0x10
MAX_BELOW_MIN = 0x0609_0036


# --- a bit that rises in the word that enables the drive


@pytest.mark.parametrize("way", [(SHUTDOWN,), (SHUTDOWN, SWITCH_ON), (SHUTDOWN, ENABLE, 0x02)], ids=str)
@pytest.mark.parametrize("mode", [Mode.PROFILE_POSITION, Mode.HOMING, Mode.INTERPOLATED_POSITION])
def test_the_word_that_enables_starts_nothing(board: BenchBoard, mode: Mode, way: tuple[int, ...]) -> None:
    """From READY TO SWITCH ON, SWITCHED ON and QUICK STOP ACTIVE: bit 4 counts when it rises after that."""
    board.nmt(1)
    assert board.write(od.QUICK_STOP_OPTION, 6) == 0
    assert board.write(od.HOMING_METHOD, 18) == 0
    assert board.write(od.MODE_OF_OPERATION, mode) == 0
    for word in way:
        assert board.write(od.CONTROLWORD, word) == 0
    assert board.write(od.TARGET_POSITION, 40 * STEP) == 0
    board.record(40 * STEP, 0, 100, 0)
    assert board.write(od.CONTROLWORD, START) == 0
    assert board.state() is State.OPERATION_ENABLED
    board.wait(200)
    assert board.value(od.POSITION_DEMAND) == 0
    for word in (ENABLE, START):
        assert board.write(od.CONTROLWORD, word) == 0
    board.wait(200)
    assert board.value(od.POSITION_DEMAND) > 0


def test_switch_on_disabled_ignores_such_a_word(board: BenchBoard) -> None:
    board.enable(Mode.PROFILE_POSITION)
    board.write(od.CONTROLWORD, 0)
    board.write(od.TARGET_POSITION, 40 * STEP)
    board.write(od.CONTROLWORD, START)
    board.wait(100)
    assert board.state() is State.SWITCH_ON_DISABLED
    assert board.value(od.POSITION_DEMAND) == 0


# --- bit 4 of the statusword


def test_voltage_enabled_follows_the_supply(board: BenchBoard) -> None:
    """The limit is 0x2002:03, 10 V after power-up; an OPERATIONAL node reports the change at once."""
    board.nmt(1)
    board.wait(150)
    for supply_10mv, bit in ((999, 0), (0, 0), (1000, VOLTAGE_ENABLED), (2400, VOLTAGE_ENABLED)):
        board.wait(6)  # the inhibit time of TPDO1
        board.sent.clear()
        board.measure(supply_10mv)
        assert board.value(od.STATUSWORD) & VOLTAGE_ENABLED == bit
        assert board.state() is State.SWITCH_ON_DISABLED
        if supply_10mv in (999, 1000):
            assert board.frames(0x190)[0][0] & VOLTAGE_ENABLED == bit
    assert board.write(od.SUPPLY_VOLTAGE_MIN, 2401) == 0
    assert not board.value(od.STATUSWORD) & VOLTAGE_ENABLED


def test_an_enabled_drive_loses_its_voltage_and_cuts(board: BenchBoard) -> None:
    board.enable()
    board.measure(999)
    assert (board.state(), board.value(od.STATUSWORD) & VOLTAGE_ENABLED) == (State.FAULT, 0)
    assert board.errors() == [ErrorCode.UNDERVOLTAGE]


# --- soft limits


def test_a_low_limit_above_the_high_one_is_refused(board: BenchBoard) -> None:
    low, high = od.POSITION_LIMIT_MIN, od.POSITION_LIMIT_MAX
    assert board.write(high, 100) == 0
    assert board.write(low, 101) == MAX_BELOW_MIN
    assert board.write(low, 100) == 0
    assert board.write(high, 99) == MAX_BELOW_MIN
    assert (board.value(low), board.value(high)) == (100, 100)
    assert board.write(high, 300) == 0
    assert board.write(low, 200) == 0


# --- refused values of RPDOs


def test_values_that_an_rpdo_brings_in_vain_are_counted(board: BenchBoard) -> None:
    """RPDO1 carries controlword and mode: an unknown mode, then another mode while the axis moves."""
    board.enable(Mode.PROFILE_VELOCITY)
    board.send(0x210, bytes((ENABLE, 0, 10)))
    assert (board.value(od.RPDO_VALUES_REFUSED), board.value(od.RPDO_LAST_REFUSED)) == (1, 0x6060_0008)
    board.write(od.TARGET_VELOCITY, 100 * STEP)
    board.wait(50)
    board.send(0x210, bytes((ENABLE, 0, 1)))
    assert board.value(od.RPDO_VALUES_REFUSED) == 2
    board.nmt(0x80)  # the counters stay while the PDOs are made anew
    assert board.value(0x2014_03) == 2
    assert board.write(od.RPDO_VALUES_REFUSED, 0) == 0x0601_0002, "it is read only"


# --- changes that nobody announces


def test_a_tpdo_of_positions_is_sent_while_the_axis_moves(board: BenchBoard) -> None:
    """TPDO2 maps 0x6064 alone: type 255, no event timer, inhibit time 10 ms."""
    board.nmt(0x80)
    for address, value in (
        (0x1801_02, 255),
        (0x1801_03, 100),
        (0x1A01_00, 0),
        (0x1A01_01, 0x6064_0020),
        (0x1A01_00, 1),
        (0x1801_01, 0x4000_0290),
    ):
        assert board.write(address, value) == 0
    board.enable(Mode.PROFILE_VELOCITY)
    board.wait(100)
    assert len(board.frames(0x290)) == 1, "at rest once, when the node becomes OPERATIONAL"
    board.write(od.TARGET_VELOCITY, 1000 * STEP)
    board.wait(300)
    instants = [counts / 72_000 for counts, frame in board.sent if frame.cob_id == 0x290][1:]
    assert 28 <= len(instants) <= 31
    assert min(late - early for early, late in itertools.pairwise(instants)) >= 10
    position = int.from_bytes(board.last(0x290), "little", signed=True)
    assert 0 <= board.value(od.POSITION_ACTUAL) - position <= 10 * STEP


def test_the_table_of_announced_changes_is_what_the_firmware_announces() -> None:
    sources = [path.read_text(encoding="utf-8") for path in Path(controller.__path__[0]).rglob("*.py")]
    names = {name for source in sources for name in re.findall(r"\bchanged\(od\.(\w+)\)", source)}
    assert {getattr(od, name) for name in names} == ANNOUNCED


# --- which node is which


def test_serial_numbers_differ(fast_kernel: Kernel) -> None:
    board = BenchBoard(fast_kernel, axes=8)
    serials = [board.value(0x1018_04, axis) for axis in range(8)]
    assert serials == [*range(0x10, 0x18)]


# --- the longest string in one block


@pytest.mark.parametrize("length", [1, 7, 50, 56, 57, 60, 63, 64])
def test_a_block_upload_of_a_whole_name_loses_no_segment(board: BenchBoard, length: int) -> None:
    """The client takes 127 segments a block; the transmit queue has room for all of the longest entry's."""
    name = bytes(range(0x30, 0x30 + length))
    board.firmware.nodes[0].dictionary.write(od.ROBOT_NAME, name)
    board.send(0x610, bytes.fromhex("a0 16 20 01 7f 00 00 00"))
    board.sent.clear()
    board.send(0x610, bytes.fromhex("a3 00 00 00 00 00 00 00"))
    segments = board.frames(0x590)
    assert len(segments) == -(-length // 7)
    assert b"".join(segment[1:] for segment in segments)[:length] == name
    assert board.value(od.FRAMES_LOST) == 0
    assert board.errors() == []
