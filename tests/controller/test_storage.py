"""Parameters that outlive a reset and the power: objects 0x1010 and 0x1011 (CiA 301, 7.5.2.13 and 7.5.2.14)."""

import pytest

from steptwin.controller.backend import Kernel
from steptwin.controller.pins import Pin
from steptwin.protocol.abort import AbortCode
from steptwin.protocol.cia402 import State
from steptwin.protocol.frame import COB_ID_INVALID
from tests.controller.bench_board import BenchBoard

SAVE = int.from_bytes(b"save", "little")
LOAD = int.from_bytes(b"load", "little")
STEP = 1024
RESET_NODE, RESET_COMMUNICATION = 0x81, 0x82


@pytest.fixture
def pair(fast_kernel: Kernel) -> BenchBoard:
    return BenchBoard(fast_kernel, axes=2)


CHANGES = ((0x1017, 0, 500), (0x2001, 1, 40_000), (0x607C, 0, 77))
"""One parameter of each group: communication, board, application."""


def change(board: BenchBoard) -> None:
    for index, subindex, value in CHANGES:
        assert board.write(index, subindex, value) == 0


def changed(board: BenchBoard, axis: int = 0) -> list[bool]:
    return [board.value(index, subindex, axis) == value for index, subindex, value in CHANGES]


def test_nothing_is_stored_unasked(pair: BenchBoard) -> None:
    change(pair)
    pair.nmt(RESET_NODE)
    assert changed(pair) == [False] * 3


@pytest.mark.parametrize(
    ("subindex", "kept"),
    [(1, [True, True, True]), (2, [True, False, False]), (3, [False, False, True]), (4, [False, True, False])],
)
def test_each_sub_index_saves_its_group(pair: BenchBoard, subindex: int, kept: list[bool]) -> None:
    change(pair)
    assert pair.write(0x1010, subindex, SAVE) == 0
    assert pair.value(0x1010, subindex) == 1
    pair.nmt(RESET_NODE)
    assert changed(pair) == kept
    assert changed(pair, axis=1) == [False] * 3


@pytest.mark.parametrize(
    ("subindex", "kept"),
    [(1, [False, False, False]), (2, [False, True, True]), (3, [True, True, False]), (4, [True, False, True])],
)
def test_each_sub_index_restores_its_group_at_the_next_reset(pair: BenchBoard, subindex: int, kept: list[bool]) -> None:
    change(pair)
    pair.write(0x1010, 1, SAVE)
    assert pair.write(0x1011, subindex, LOAD) == 0
    assert changed(pair) == [True] * 3
    pair.nmt(RESET_NODE)
    assert changed(pair) == kept


def test_a_communication_reset_brings_back_what_is_stored_of_communication(pair: BenchBoard) -> None:
    change(pair)
    pair.write(0x1010, 1, SAVE)
    pair.write(0x1017, 0, 0)
    pair.write(0x607C, 0, 78)
    pair.nmt(RESET_COMMUNICATION)
    assert (pair.value(0x1017), pair.value(0x607C)) == (500, 78)


@pytest.mark.parametrize("index", [0x1010, 0x1011])
@pytest.mark.parametrize("word", [0, 1, LOAD, SAVE, int.from_bytes(b"SAVE", "little"), 0xFFFF_FFFF])
def test_wrong_signatures(pair: BenchBoard, index: int, word: int) -> None:
    right = SAVE if index == 0x1010 else LOAD
    expected = 0 if word == right else AbortCode.NOT_STORED
    assert pair.write(index, 1, word) == expected
    assert pair.value(index, 1) == 1


def test_stored_services_are_at_work_after_boot(pair: BenchBoard) -> None:
    """Heartbeat, heartbeat consumer, EMCY inhibit time and step timing live outside of the dictionary."""
    for index, subindex, value in (
        (0x1015, 0, 10_000),
        (0x1016, 1, 0x7F_0064),
        (0x1017, 0, 100),
        (0x2000, 1, 8),
    ):
        pair.write(index, subindex, value)
    pair.write(0x1010, 1, SAVE)
    pair.sent.clear()
    pair.nmt(RESET_NODE, node=0x10)
    pair.wait(250)
    assert [data[0] for data in pair.frames(0x710)] == [0, 127, 127, 127]
    assert pair.firmware.motion.config(0).microsteps == 8
    pair.send(0x77F, b"\5")
    pair.nmt(1)
    pair.send(0x510, b"")
    pair.wait(150)
    assert len(pair.frames(0x090)) == 1, "the second waits for the inhibit time"
    pair.wait(1000)
    assert [data[:2].hex() for data in pair.frames(0x090)] == ["1082", "3081"]


def test_a_stored_pdo_is_mapped_after_a_reset(pair: BenchBoard) -> None:
    for index, subindex, value in (
        (0x1402, 1, COB_ID_INVALID | 0x410),
        (0x1602, 0, 0),
        (0x1602, 1, 0x60FE_0120),
        (0x1602, 0, 1),
        (0x1402, 2, 255),
        (0x1402, 1, 0x2A0),
        (0x1010, 2, SAVE),
    ):
        assert pair.write(index, subindex, value) == 0
    pair.nmt(RESET_NODE)
    pair.nmt(1)
    pair.send(0x2A0, bytes.fromhex("00000300"))
    assert {pin for _, _, pin, level in pair.firmware.take_pins() if level} >= {Pin.OUT1, Pin.OUT2}


def test_commands_are_not_stored(pair: BenchBoard) -> None:
    """Power that comes back must not move an axis or switch an output."""
    pair.enable()
    for index, subindex, value in ((0x60FE, 1, 1 << 16), (0x607A, 0, 5), (0x60FF, 0, 5), (0x60C1, 1, 5)):
        pair.write(index, subindex, value)
    pair.write(0x1010, 1, SAVE)
    pair.nmt(RESET_NODE)
    assert pair.firmware.nodes[0].drive.state is State.SWITCH_ON_DISABLED
    keys = ((0x6040, 0), (0x6060, 0), (0x60FE, 1), (0x607A, 0), (0x60FF, 0), (0x60C1, 1))
    assert [pair.value(*key) for key in keys] == [0] * 6


@pytest.mark.parametrize("index", [0x6081, 0x6083, 0x6084])
def test_a_profile_keeps_its_limits(pair: BenchBoard, index: int) -> None:
    pair.write(index, 0, 12_345)
    pair.write(0x1010, 3, SAVE)
    pair.nmt(RESET_NODE)
    assert pair.value(index) == 12_345


def test_flash_is_not_written_while_any_axis_moves(pair: BenchBoard) -> None:
    """The chip halts while it writes: the other axes' steps would come late."""
    pair.enable()
    pair.record(10 * STEP, 0, 100, 0, axis=1)
    pair.start()
    assert pair.write(0x1010, 1, SAVE) == AbortCode.DEVICE_STATE
    assert pair.write(0x1011, 1, LOAD) == AbortCode.DEVICE_STATE
    pair.wait(110)
    assert pair.write(0x1010, 1, SAVE) == 0
