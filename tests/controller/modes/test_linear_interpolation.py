"""Interpolated position with the sub mode "linear" (60C0h = 0): one set-point at each SYNC, while bit 4 is set."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import LINEAR_SUBMODE, PVT_SUBMODE, Mode, Status
from steptwin.protocol.nmt import NmtCommand
from tests.controller.bench_board import BenchBoard

PERIOD_MS = 10
ENABLED, INTERPOLATE = 0x0F, 0x1F
STEP_UNITS = 4_000


@pytest.fixture
def board(fast_kernel: Kernel) -> BenchBoard:
    """An axis whose RPDO3 carries controlword and set-point, as those of masters do, with SYNC."""
    board = BenchBoard(fast_kernel)
    place = od.address_of(0x1602)
    cob_id = od.address_of(0x1402, od.PDO_COB_ID)
    for address, value in (
        (cob_id, 0x8000_0410),
        (place, 0),
        (place + 1, od.CONTROLWORD << 8 | 16),
        (place + 2, od.INTERPOLATION_SET_POINT << 8 | 32),
        (place, 2),
        (cob_id, 0x410),
        (od.INTERPOLATION_SUBMODE, LINEAR_SUBMODE),
        (od.MODE_OF_OPERATION, Mode.INTERPOLATED_POSITION),
        (od.CONTROLWORD, 0x06),
        (od.CONTROLWORD, ENABLED),
    ):
        assert board.write(address, value) == 0
    board.nmt(NmtCommand.START)
    return board


def cycle(board: BenchBoard, controlword: int, set_point_units: int) -> None:
    """A master's cycle: one frame with both, SYNC, then its period."""
    board.send(0x410, controlword.to_bytes(2, "little") + set_point_units.to_bytes(4, "little", signed=True))
    board.send(0x080, b"")
    board.wait(PERIOD_MS)


def test_the_first_set_point_comes_with_the_enable_bit(board: BenchBoard) -> None:
    for i in range(1, 21):
        cycle(board, INTERPOLATE, STEP_UNITS * i)
    assert board.has(Status.IP_ACTIVE)
    for _ in range(3):
        cycle(board, INTERPOLATE, STEP_UNITS * 20)
    assert board.value(od.POSITION_DEMAND) == STEP_UNITS * 20
    cycle(board, ENABLED, STEP_UNITS * 20)
    assert not board.has(Status.IP_ACTIVE)
    assert board.errors() == []


def test_without_the_enable_bit_nothing_moves(board: BenchBoard) -> None:
    for i in range(1, 6):
        cycle(board, ENABLED, STEP_UNITS * i)
    assert board.value(od.POSITION_DEMAND) == 0


def test_the_falling_bit_stops_by_a_ramp(board: BenchBoard) -> None:
    for i in range(1, 21):
        cycle(board, INTERPOLATE, STEP_UNITS * i)
    cycle(board, ENABLED, STEP_UNITS * 21)
    board.wait(200)
    stopped = board.value(od.POSITION_DEMAND)
    assert STEP_UNITS * 19 < stopped < STEP_UNITS * 25
    assert board.errors() == []


def test_the_sub_mode_is_refused_while_it_is_in_use(board: BenchBoard) -> None:
    assert board.write(od.INTERPOLATION_SUBMODE, PVT_SUBMODE) == 0x0800_0022
    assert board.write(od.INTERPOLATION_SUBMODE, LINEAR_SUBMODE) == 0
    board.write(od.CONTROLWORD, 0x06)
    assert board.write(od.INTERPOLATION_SUBMODE, PVT_SUBMODE) == 0


def test_a_reset_of_the_node_brings_the_stored_sub_mode(board: BenchBoard) -> None:
    board.write(od.CONTROLWORD, 0)
    board.write(od.STORE_ALL, int.from_bytes(b"save", "little"))
    board.nmt(NmtCommand.RESET_NODE)
    board.wait(1)
    assert board.value(od.INTERPOLATION_SUBMODE) == LINEAR_SUBMODE
    board.nmt(NmtCommand.START)
    board.write(od.MODE_OF_OPERATION, Mode.INTERPOLATED_POSITION)
    for word in (0x06, ENABLED):
        board.write(od.CONTROLWORD, word)
    board.write(od.INTERPOLATION_SET_POINT, STEP_UNITS)
    board.write(od.CONTROLWORD, INTERPOLATE)
    for _ in range(4):
        board.send(0x080, b"")
        board.wait(PERIOD_MS)
    assert board.value(od.POSITION_DEMAND) == 0, "a set-point from before the bit does not count"
