"""One program in charge of an axis (2017h): who gets the axis, and when the board forgets a program."""

import pytest

from steptwin.protocol import od
from steptwin.protocol.od import CHARGE_FREE, CHARGE_UNWATCHED_MS
from steptwin.protocol.sdo_frames import AbortCode
from tests.controller.bench_board import BenchBoard

ALICE, BOB = 0x1234_5678, 0xFFFF_FFFF
HOST, WATCH_MS = 0x7F, 350
RESET_NODE, RESET_COMMUNICATION = 0x81, 0x82


def claim(board: BenchBoard, token: int, axis: int = 0) -> int:
    return board.write(od.CHARGE_TOKEN, token, axis)


def release(board: BenchBoard, token: int) -> int:
    return board.write(od.CHARGE_RELEASE, token)


def beat(board: BenchBoard) -> None:
    board.send(0x700 + HOST, b"\x05")


def watch(board: BenchBoard) -> None:
    assert board.write(od.CONSUMER_HEARTBEATS[0], HOST << 16 | WATCH_MS) == 0
    beat(board)


def in_charge(board: BenchBoard, axis: int = 0) -> int:
    return board.value(od.CHARGE_TOKEN, axis)


def test_only_one_program_gets_the_axis(pair: BenchBoard) -> None:
    assert in_charge(pair) == CHARGE_FREE
    assert claim(pair, ALICE) == 0
    assert claim(pair, BOB) == AbortCode.DEVICE_STATE
    assert claim(pair, ALICE) == 0
    assert (in_charge(pair), in_charge(pair, 1)) == (ALICE, CHARGE_FREE)
    assert claim(pair, BOB, 1) == 0


def test_only_its_owner_gives_it_back(pair: BenchBoard) -> None:
    claim(pair, ALICE)
    assert release(pair, BOB) == AbortCode.DEVICE_STATE
    assert in_charge(pair) == ALICE
    assert release(pair, ALICE) == 0
    assert in_charge(pair) == CHARGE_FREE
    assert release(pair, ALICE) == AbortCode.DEVICE_STATE
    assert claim(pair, BOB) == 0


@pytest.mark.parametrize("again", [False, True])
def test_a_program_without_a_heartbeat_is_forgotten(pair: BenchBoard, again: bool) -> None:
    claim(pair, ALICE)
    if again:
        pair.wait(CHARGE_UNWATCHED_MS - 1)
        claim(pair, ALICE)
    pair.wait(CHARGE_UNWATCHED_MS - 1)
    assert in_charge(pair) == ALICE
    pair.wait(2)
    assert in_charge(pair) == CHARGE_FREE


def test_a_heartbeat_keeps_it(pair: BenchBoard) -> None:
    claim(pair, ALICE)
    watch(pair)
    for _ in range(100):
        pair.wait(WATCH_MS - 1)
        beat(pair)
        assert in_charge(pair) == ALICE


def test_a_killed_program_is_forgotten_with_its_heartbeat(pair: BenchBoard) -> None:
    claim(pair, ALICE)
    watch(pair)
    pair.wait(WATCH_MS - 1)
    assert claim(pair, BOB) == AbortCode.DEVICE_STATE
    pair.wait(2)
    assert in_charge(pair) == CHARGE_FREE
    assert claim(pair, BOB) == 0


@pytest.mark.parametrize("beats", [0, 4, 9])
def test_a_program_that_ends_its_monitoring_and_dies_is_forgotten(pair: BenchBoard, beats: int) -> None:
    """Also after it has been in charge for longer than the time without a heartbeat."""
    claim(pair, ALICE)
    watch(pair)
    for _ in range(beats):
        pair.wait(WATCH_MS - 1)
        beat(pair)
    pair.wait(WATCH_MS - 1)
    pair.write(od.CONSUMER_HEARTBEATS[0], 0)
    pair.wait(CHARGE_UNWATCHED_MS + 1)
    assert in_charge(pair) == CHARGE_FREE


@pytest.mark.parametrize("held_ms", [CHARGE_UNWATCHED_MS - 2, CHARGE_UNWATCHED_MS - 1, 2 * CHARGE_UNWATCHED_MS - 1])
def test_a_program_that_ends_its_monitoring_keeps_the_axis_until_it_gives_it_back(
    pair: BenchBoard, held_ms: int
) -> None:
    """Whenever it does: the axis looks each second from the claim on whether it monitors a heartbeat."""
    claim(pair, ALICE)
    watch(pair)
    for waited_ms in range(held_ms):
        if waited_ms % 100 == 0:
            beat(pair)
        pair.wait(1)
    pair.write(od.CONSUMER_HEARTBEATS[0], 0)
    pair.wait(CHARGE_UNWATCHED_MS - 2)
    assert in_charge(pair) == ALICE
    assert release(pair, ALICE) == 0


@pytest.mark.parametrize("command", [RESET_NODE, RESET_COMMUNICATION])
def test_a_reset_frees_the_axis(pair: BenchBoard, command: int) -> None:
    claim(pair, ALICE)
    pair.nmt(command)
    assert in_charge(pair) == CHARGE_FREE
    assert claim(pair, BOB) == 0


def test_it_is_not_stored(pair: BenchBoard) -> None:
    claim(pair, ALICE)
    assert pair.write(od.STORE_ALL, int.from_bytes(b"save", "little")) == 0
    pair.nmt(RESET_NODE)
    assert in_charge(pair) == CHARGE_FREE


def test_programs_that_know_nothing_of_it_drive_the_axis(pair: BenchBoard) -> None:
    claim(pair, ALICE)
    pair.enable()
