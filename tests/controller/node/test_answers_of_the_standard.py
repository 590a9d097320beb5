"""Answers that CiA 301 and 402 prescribe: error history, SYNC before OPERATIONAL, COB-IDs, homing method 0."""

import pytest

from steptwin.protocol import od
from steptwin.protocol.cia402 import Mode, Status
from steptwin.protocol.frame import COB_ID_INVALID
from steptwin.protocol.sdo_frames import AbortCode
from tests.controller.bench_board import BenchBoard
from tests.controller.units import STEP

NO_DATA = 0x0800_0024


def upload(board: BenchBoard, address: int) -> bytes:
    board.send(
        0x610, bytes((0x40, *od.index_and_subindex(address)[0].to_bytes(2, "little"), address & 0xFF, 0, 0, 0, 0))
    )
    return board.last(0x590)


def test_the_error_history_ends_where_its_number_says(board: BenchBoard) -> None:
    """CiA 301, section 7.5.2.4: an entry beyond the number of errors has no data."""
    for subindex in range(1, 9):
        assert upload(board, 0x1003_00 | subindex)[4:] == NO_DATA.to_bytes(4, "little")
    board.send(0x080, b"\1")  # a SYNC of the wrong length
    assert board.read(0x1003_00) == 1
    assert board.read(0x1003_01) == 0x8240
    assert upload(board, 0x1003_02)[4:] == NO_DATA.to_bytes(4, "little")
    assert board.write(0x1003_00, 0) == 0
    assert upload(board, 0x1003_01)[4:] == NO_DATA.to_bytes(4, "little")


def test_a_sync_of_the_wrong_length_is_an_error_before_operational_too(board: BenchBoard) -> None:
    """And one of the right length ends it; in STOPPED there is no SYNC."""
    board.send(0x080, b"\1")
    assert board.emergencies() == [0x8240]
    board.send(0x080, b"")
    assert board.emergencies() == [0x8240, 0]
    board.nmt(2)
    board.send(0x080, b"\1")
    board.nmt(128)
    assert board.emergencies() == [0x8240, 0]


def test_pdos_of_sync_wait_for_operational(board: BenchBoard) -> None:
    board.send(0x310, b"\x06\0")
    board.send(0x080, b"")
    board.nmt(1)
    board.send(0x080, b"")
    assert board.value(od.CONTROLWORD) == 0


@pytest.mark.parametrize("percent", [100, 80])
def test_the_wanted_rate_can_be_written_back(board: BenchBoard, percent: int) -> None:
    """Without a motion no other can be written; in one, that which is wanted is."""
    assert board.write(od.GROUP_RATE_Q16, board.read(od.GROUP_RATE_Q16)) == 0
    assert board.write(od.GROUP_RATE_Q16, 60_000) == AbortCode.DEVICE_STATE
    board.enable()
    for sequence in range(20):
        board.record(STEP, 64 * STEP // 10, 10, sequence)
    board.start()
    board.wait(20)
    assert board.write(od.GROUP_RATE_Q16, percent * 65_536 // 100) == 0
    assert board.write(od.GROUP_RATE_Q16, board.read(od.GROUP_RATE_Q16)) == 0


@pytest.mark.parametrize("identifier", [0x080, 0x700])
def test_an_rpdo_may_have_an_identifier_that_is_not_restricted(board: BenchBoard, identifier: int) -> None:
    """CiA 301, table 40. SYNC goes on to be heard beside an RPDO of its identifier."""
    assert board.write(0x1400_01, 0x210 | COB_ID_INVALID) == 0
    assert board.write(0x1400_01, identifier) == 0
    board.nmt(1)
    board.send(identifier, b"\x06\0\1")
    assert board.value(od.CONTROLWORD) == 6
    board.send(0x310, b"\x07\0")
    board.send(0x080, b"")
    assert board.value(od.CONTROLWORD) == 7


@pytest.mark.parametrize("identifier", [0x080, 0x100, 0x700])
def test_emcys_too(board: BenchBoard, identifier: int) -> None:
    assert board.write(od.EMCY_COB_ID, 0x090 | COB_ID_INVALID) == 0
    assert board.write(od.EMCY_COB_ID, identifier) == 0


@pytest.mark.parametrize("known", [False, True])
def test_homing_method_0_needs_no_homing(board: BenchBoard, *, known: bool) -> None:
    """It is attained at once; the position, and whether it is known, stay as they are."""
    board.enable(Mode.HOMING)
    if known:
        board.write(od.HOME_OFFSET, 3 * STEP)
        board.write(od.CONTROLWORD, 0x1F)
        board.write(od.CONTROLWORD, 0x0F)
    before = board.value(od.POSITION_DEMAND)
    board.write(od.HOME_OFFSET, 9 * STEP)
    assert board.write(od.HOMING_METHOD, 0) == 0
    board.write(od.CONTROLWORD, 0x1F)
    assert board.has(Status.HOMING_ATTAINED)
    assert board.has(Status.TARGET_REACHED)
    assert not board.has(Status.HOMING_ERROR)
    assert (board.value(od.POSITION_DEMAND), board.has(Status.POSITION_KNOWN)) == (before, known)
