"""Interpolated position with PVT records: the start with SYNC, flow control, refusals, the sequence's wrap."""

from steptwin.protocol import od
from steptwin.protocol.cia402 import State
from steptwin.protocol.pvt import PvtFlag
from steptwin.protocol.sdo_frames import AbortCode
from tests.controller.bench_board import BenchBoard
from tests.controller.units import STEP


def test_a_stream_starts_with_sync_and_ends_at_rest(pair: BenchBoard) -> None:
    pair.enable()
    for axis in (0, 1):
        pair.record(10 * STEP, 0, 20, 0, axis)
        pair.record(-3 * STEP, 0, 20, 1, axis)
        assert pair.flags(axis) == PvtFlag.ARMED
    pair.wait(5.1)
    pair.start()
    assert pair.flags() & PvtFlag.RUNNING
    assert pair.value(od.STATUSWORD) & 1 << 12
    pair.wait(100)
    assert [pair.value(od.POSITION_ACTUAL, axis) for axis in (0, 1)] == [7 * STEP, 7 * STEP]
    assert pair.flags() == PvtFlag.EMPTY
    assert not pair.value(od.STATUSWORD) & 1 << 12
    assert pair.value(od.STATUSWORD) & 1 << 10
    first, second = (edges.clk_counts for edges in pair.firmware.motion.take_edges())
    assert list(first) == list(second)
    assert len(first) == 2 * 13


def test_all_axes_start_in_the_tick_after_sync(board: BenchBoard) -> None:
    board.enable()
    board.record(0, 0, 1, 0)
    board.wait(1.1)  # in tick 4, which lasts from 1.00 to 1.25 ms
    board.start()
    board.wait(1.14)  # a record of 1 ms that began with tick 5 ends with tick 8, at 2.25 ms
    assert board.flags() & PvtFlag.RUNNING
    board.wait(0.02)
    assert not board.flags() & PvtFlag.RUNNING


def test_flow_control(board: BenchBoard) -> None:
    board.enable()
    board.record(1, 0, 10, 1)  # record 0 is missing
    assert board.flags() & PvtFlag.GAP
    assert (board.value(od.PVT_NEXT_SEQUENCE), board.value(od.PVT_FREE_RECORDS), board.value(od.PVT_GAPS)) == (
        0,
        64,
        1,
    )
    for sequence in range(65):
        board.record(1, 0, 10, sequence)
    assert board.flags() & PvtFlag.OVERFLOW
    assert not board.flags() & PvtFlag.GAP
    assert (board.value(od.PVT_NEXT_SEQUENCE), board.value(od.PVT_FREE_RECORDS), board.value(od.PVT_OVERFLOWS)) == (
        64,
        0,
        1,
    )
    board.record(1, 0, 10, 5)  # an old record: ignored without a flag
    assert board.value(od.PVT_ACCEPTED) == 64


def test_a_record_that_is_taken_ends_gap_and_overflow(board: BenchBoard) -> None:
    board.enable()
    for sequence in range(65):
        board.record(1, 0, 10, sequence)
    assert board.flags() & PvtFlag.OVERFLOW
    board.start()
    board.wait(15)
    board.record(1, 0, 10, 66)
    assert board.flags() & (PvtFlag.GAP | PvtFlag.OVERFLOW) == PvtFlag.GAP | PvtFlag.OVERFLOW
    board.record(1, 0, 10, 64)
    assert not board.flags() & (PvtFlag.GAP | PvtFlag.OVERFLOW)
    assert board.value(od.PVT_NEXT_SEQUENCE) == 65


def test_each_flag_is_one_event_only(board: BenchBoard) -> None:
    board.enable()
    board.wait(50)
    before = len(board.frames(0x390))
    for _ in range(5):
        board.record(1, 0, 10, 7)
        board.wait(5)
    assert len(board.frames(0x390)) == before + 1
    assert board.value(od.PVT_GAPS) == 5


def test_clearing_begins_again_at_zero(board: BenchBoard) -> None:
    board.enable()
    board.record(100, 0, 10, 0)
    assert board.write(od.BUFFER_CLEAR, 0) == 0
    assert (board.value(od.PVT_NEXT_SEQUENCE), board.value(od.PVT_FREE_RECORDS), board.flags()) == (
        0,
        64,
        PvtFlag.EMPTY,
    )
    board.record(50, 0, 10, 0)
    board.start()
    assert board.write(od.BUFFER_CLEAR, 0) == AbortCode.DEVICE_STATE
    board.wait(20)
    assert board.value(od.POSITION_DEMAND) == 50


def test_a_refused_record_is_flagged_and_reported(board: BenchBoard) -> None:
    board.enable()
    board.record(1000 * STEP, 0, 10, 0)
    assert board.flags() & PvtFlag.REJECTED
    assert board.frames(0x090) == [bytes.fromhex("03ff 81 0004000000")]  # refusal 4, sequence 0
    assert board.value(od.PVT_NEXT_SEQUENCE) == 0
    assert board.state() is State.OPERATION_ENABLED
    board.record(1000 * STEP, 0, 10, 0)
    assert board.emergencies() == [0xFF03], "sent again, it is the same error"
    board.write(od.BUFFER_CLEAR, 0)
    assert (board.emergencies(), board.value(od.ERROR_REGISTER)) == ([0xFF03, 0], 0)


def test_sequence_numbers_wrap(board: BenchBoard) -> None:
    board.enable()
    sent = 0
    for sent in range(40):
        board.record(10, 0, 5, sent)
    board.start()
    for sent in range(40, 700):
        board.record(10, 0, 5, sent % 256)
        board.wait(5)
    board.wait(300)
    assert board.flags() == PvtFlag.EMPTY
    assert board.value(od.POSITION_DEMAND) == 7000
    assert board.value(od.PVT_NEXT_SEQUENCE) == 700 % 256
    assert board.value(od.PVT_LEAST_FILL) >= 38
