"""Parameters that survive a reset and a power cycle: objects 1010h and 1011h (CiA 301, 7.5.2.13 and 7.5.2.14)."""

from binascii import crc32

import pytest

from steptwin.controller.node.pins import Pin
from steptwin.protocol import od
from steptwin.protocol.cia402 import State
from steptwin.protocol.frame import COB_ID_INVALID
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError
from steptwin.protocol.storage import NO_NAME
from tests.controller.bench_board import BenchBoard
from tests.controller.units import STEP
from tests.messages import refusing

SAVE = int.from_bytes(b"save", "little")
LOAD = int.from_bytes(b"load", "little")
RESET_NODE, RESET_COMMUNICATION = 0x81, 0x82


CHANGES = ((od.PRODUCER_HEARTBEAT_TIME, 500), (od.STEPLEN_NS, 40_000), (od.HOME_OFFSET, 77))
"""One parameter of each group: communication, board, application."""


def change(board: BenchBoard) -> None:
    for address, value in CHANGES:
        assert board.write(address, value) == 0


def changed(board: BenchBoard, axis: int = 0) -> list[bool]:
    return [board.value(address, axis) == value for address, value in CHANGES]


def test_nothing_is_stored_unasked(pair: BenchBoard) -> None:
    change(pair)
    pair.nmt(RESET_NODE)
    assert changed(pair) == [False] * 3


@pytest.mark.parametrize(
    ("store", "kept"),
    [
        (od.STORE_ALL, [True, True, True]),
        (od.STORE_COMMUNICATION, [True, False, False]),
        (od.STORE_APPLICATION, [False, False, True]),
        (od.STORE_BOARD, [False, True, False]),
    ],
)
def test_each_sub_index_saves_its_group(pair: BenchBoard, store: int, kept: list[bool]) -> None:
    change(pair)
    assert pair.write(store, SAVE) == 0
    assert pair.value(store) == 1
    pair.nmt(RESET_NODE)
    assert changed(pair) == kept
    assert changed(pair, axis=1) == [False] * 3


@pytest.mark.parametrize(
    ("restore", "kept"),
    [
        (od.RESTORE_ALL, [False, False, False]),
        (od.RESTORE_COMMUNICATION, [False, True, True]),
        (od.RESTORE_APPLICATION, [True, True, False]),
        (od.RESTORE_BOARD, [True, False, True]),
    ],
)
def test_each_sub_index_restores_its_group_at_the_next_reset(pair: BenchBoard, restore: int, kept: list[bool]) -> None:
    change(pair)
    pair.write(od.STORE_ALL, SAVE)
    assert pair.write(restore, LOAD) == 0
    assert changed(pair) == [True] * 3
    pair.nmt(RESET_NODE)
    assert changed(pair) == kept


def test_a_communication_reset_brings_back_what_is_stored_of_communication(pair: BenchBoard) -> None:
    change(pair)
    pair.write(od.STORE_ALL, SAVE)
    pair.write(od.PRODUCER_HEARTBEAT_TIME, 0)
    pair.write(od.HOME_OFFSET, 78)
    pair.nmt(RESET_COMMUNICATION)
    assert (pair.value(od.PRODUCER_HEARTBEAT_TIME), pair.value(od.HOME_OFFSET)) == (500, 78)


@pytest.mark.parametrize("address", [od.STORE_ALL, od.RESTORE_ALL])
@pytest.mark.parametrize("word", [0, 1, LOAD, SAVE, int.from_bytes(b"SAVE", "little"), 0xFFFF_FFFF])
def test_wrong_signatures(pair: BenchBoard, address: int, word: int) -> None:
    right = SAVE if address == od.STORE_ALL else LOAD
    expected = 0 if word == right else AbortCode.NOT_STORED
    assert pair.write(address, word) == expected
    assert pair.value(address) == 1


def test_stored_services_are_at_work_after_boot(pair: BenchBoard) -> None:
    """Heartbeat, heartbeat consumer, EMCY inhibit time and step timing are also kept outside the dictionary."""
    for address, value in (
        (od.EMCY_INHIBIT_TIME, 10_000),
        (od.CONSUMER_HEARTBEATS[0], 0x7F_0064),
        (od.PRODUCER_HEARTBEAT_TIME, 100),
        (od.MICROSTEPS, 8),
    ):
        pair.write(address, value)
    pair.write(od.STORE_ALL, SAVE)
    pair.sent.clear()
    pair.nmt(RESET_NODE, node=0x10)
    pair.wait(250)
    assert [data[0] for data in pair.frames(0x710)] == [0, 127, 127, 127]
    assert pair.firmware.motion.axes[0].config.microsteps == 8
    pair.send(0x77F, b"\5")
    pair.nmt(1)
    pair.send(0x510, b"")
    pair.wait(150)
    assert len(pair.frames(0x090)) == 1, "the second waits for the inhibit time"
    pair.wait(1000)
    assert [data[:2].hex() for data in pair.frames(0x090)] == ["1082", "3081"]


def test_a_stored_pdo_is_mapped_after_a_reset(pair: BenchBoard) -> None:
    for address, value in (
        (od.address_of(od.RPDO_COMMUNICATION[2], od.PDO_COB_ID), COB_ID_INVALID | 0x410),
        (od.address_of(od.RPDO_MAPPING[2], 0), 0),
        (od.address_of(od.RPDO_MAPPING[2], 1), 0x60FE_0120),
        (od.address_of(od.RPDO_MAPPING[2], 0), 1),
        (od.address_of(od.RPDO_COMMUNICATION[2], od.PDO_TRANSMISSION_TYPE), 255),
        (od.address_of(od.RPDO_COMMUNICATION[2], od.PDO_COB_ID), 0x2A0),
        (od.STORE_COMMUNICATION, SAVE),
    ):
        assert pair.write(address, value) == 0
    pair.nmt(RESET_NODE)
    pair.nmt(1)
    pair.send(0x2A0, bytes.fromhex("00000300"))
    assert {pin for _, _, pin, level in pair.firmware.take_pins() if level} >= {Pin.OUT1, Pin.OUT2}


def test_commands_are_not_stored(pair: BenchBoard) -> None:
    """When the power returns, no axis may move and no output may switch."""
    pair.enable()
    for address, value in (
        (od.DIGITAL_OUTPUTS, 1 << 16),
        (od.TARGET_POSITION, 5),
        (od.TARGET_VELOCITY, 5),
        (od.PVT_DISPLACEMENT, 5),
    ):
        pair.write(address, value)
    pair.write(od.STORE_ALL, SAVE)
    pair.nmt(RESET_NODE)
    assert pair.firmware.nodes[0].drive.state is State.SWITCH_ON_DISABLED
    addresses = (
        od.CONTROLWORD,
        od.MODE_OF_OPERATION,
        od.DIGITAL_OUTPUTS,
        od.TARGET_POSITION,
        od.TARGET_VELOCITY,
        od.PVT_DISPLACEMENT,
    )
    assert [pair.value(address) for address in addresses] == [0] * 6


@pytest.mark.parametrize("address", [od.PROFILE_VELOCITY, od.PROFILE_ACCELERATION, od.PROFILE_DECELERATION])
def test_stored_profile_limits_return_after_a_reset(pair: BenchBoard, address: int) -> None:
    pair.write(address, 12_345)
    pair.write(od.STORE_APPLICATION, SAVE)
    pair.nmt(RESET_NODE)
    assert pair.value(address) == 12_345


def test_flash_is_not_written_while_any_axis_moves(pair: BenchBoard) -> None:
    """The chip halts while it writes: the other axes' steps would come late."""
    pair.enable()
    pair.record(10 * STEP, 0, 100, 0, axis=1)
    pair.start()
    assert pair.write(od.STORE_ALL, SAVE) == AbortCode.DEVICE_STATE
    assert pair.write(od.RESTORE_ALL, LOAD) == AbortCode.DEVICE_STATE
    pair.wait(110)
    assert pair.write(od.STORE_ALL, SAVE) == 0


def test_the_robots_name_is_stored(pair: BenchBoard) -> None:
    """A visible string, by segments; its checksum follows it at once."""
    node = pair.firmware.nodes[0]
    node.dictionary.write(od.ROBOT_NAME, b"my arm")
    assert pair.value(od.ROBOT_NAME_CRC) == crc32(b"my arm")
    pair.nmt(RESET_NODE)
    assert (node.dictionary.read(od.ROBOT_NAME), pair.value(od.ROBOT_NAME_CRC)) == (b"", NO_NAME)
    node.dictionary.write(od.ROBOT_NAME, b"my arm")
    pair.write(od.STORE_BOARD, SAVE)
    node.dictionary.write(od.ROBOT_NAME, b"other")
    pair.nmt(RESET_NODE)
    assert node.dictionary.read(od.ROBOT_NAME) == b"my arm"
    assert pair.write(od.RESTORE_ALL, LOAD) == 0
    assert node.dictionary.read(od.ROBOT_NAME) == b"my arm"
    pair.nmt(RESET_NODE)
    assert node.dictionary.read(od.ROBOT_NAME) == b""


@pytest.mark.parametrize("name", [b"\x1f", b"caf\xe9", b"\x7f", b"a\0b"])
def test_a_name_is_printable(pair: BenchBoard, name: bytes) -> None:
    dictionary = pair.firmware.nodes[0].dictionary
    with refusing(SdoAbortError):
        dictionary.write(od.ROBOT_NAME, name)
    dictionary.write(od.ROBOT_NAME, b" ~\0\0")
    assert dictionary.read(od.ROBOT_NAME) == b" ~"
