"""Layer setting services (CiA 305): frames and states by hand; `tests/host/client` has canopen's own master."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.node.firmware import Firmware
from steptwin.protocol import od
from steptwin.protocol.dictionary import FlashPage
from steptwin.protocol.frame import Frame
from steptwin.protocol.nmt import NmtCommand, NmtState
from tests.controller.bench_board import BenchBoard

IDENTITY = (0, 0x6560, 0x0001_0000, 0x10)
"""Of the first axis."""


def ask(board: BenchBoard, *data: int) -> list[str]:
    """Send a request; return the answers."""
    before = len(board.sent)
    board.send(0x7E5, bytes(data).ljust(8, b"\0"))
    return [frame.data.hex() for _, frame in board.sent[before:] if frame.cob_id == 0x7E4]


def number(command: int, value: int) -> tuple[int, ...]:
    return command, *value.to_bytes(4, "little")


def select(board: BenchBoard, serial: int) -> list[str]:
    for command, part in zip((0x40, 0x41, 0x42), IDENTITY, strict=False):
        assert ask(board, *number(command, part)) == []
    return ask(board, *number(0x43, serial))


def configure(board: BenchBoard, serial: int, node_id: int) -> None:
    assert select(board, serial) == ["4400000000000000"]
    assert ask(board, 0x11, node_id) == ["1100000000000000"]
    ask(board, 0x04, 0)


def test_selection_takes_all_four_parts_of_one_axis_in_order(pair: BenchBoard) -> None:
    assert ask(pair, *number(0x43, 0x10)) == []
    assert select(pair, 0x12) == []
    assert select(pair, 0x11) == ["4400000000000000"]
    assert ask(pair, 0x5E) == ["5e11000000000000"]
    assert ask(pair, 0x5A) == ["5a00000000000000"]
    assert ask(pair, 0x5B) == ["5b60650000000000"]
    assert ask(pair, 0x5C) == ["5c00000100000000"]
    assert ask(pair, 0x5D) == ["5d11000000000000"]
    assert ask(pair, 0x04, 0) == []
    assert ask(pair, 0x5E) == []


def test_a_switch_of_all_needs_no_identity(pair: BenchBoard) -> None:
    assert ask(pair, 0x04, 1) == []
    assert ask(pair, 0x5E) == ["5e10000000000000", "5e11000000000000"]
    assert ask(pair, 0x04, 2) == []
    assert len(ask(pair, 0x5E)) == 2
    assert select(pair, 0x10) == []  # a node in configuration is not selected again


def test_a_node_id_is_in_force_from_the_reset_of_communication_and_leaves_the_serial_number(pair: BenchBoard) -> None:
    configure(pair, 0x11, 0x22)
    assert pair.firmware.nodes[1].node_id == 0x11
    assert pair.firmware.hears(0x611)
    pair.nmt(NmtCommand.RESET_COMMUNICATION, 0x11)
    assert [node.node_id for node in pair.firmware.nodes] == [0x10, 0x22]
    assert pair.last(0x722) == b"\0"
    assert (pair.firmware.hears(0x611), pair.firmware.hears(0x622)) == (False, True)
    assert pair.value(od.SERIAL_NUMBER, 1) == 0x11
    assert pair.value(od.EMCY_COB_ID, 1) == 0xA2
    assert pair.write(od.HOMING_SWITCH_NODE, 0x22, 0) == 0
    assert pair.write(od.HOMING_SWITCH_NODE, 0x11, 0) == 0x0609_0030
    assert pair.write(od.CONTROLWORD, 0x06, 1) == 0


@pytest.mark.parametrize(("node_id", "error"), [(0, 1), (1, 0), (0x7F, 0), (0x80, 1), (0xFE, 1), (0xFF, 0)])
def test_bounds_of_node_ids(board: BenchBoard, node_id: int, error: int) -> None:
    ask(board, 0x04, 1)
    assert ask(board, 0x11, node_id) == [f"110{error}000000000000"]


@pytest.mark.parametrize(
    ("table", "index", "error"),
    [(0, 0, 0), (0, 1, 1), (0, 2, 0), (0, 3, 0), (0, 4, 0), (0, 5, 1), (0, 9, 1), (1, 0, 1), (0x80, 2, 1)],
)
def test_bounds_of_bit_timings(board: BenchBoard, table: int, index: int, error: int) -> None:
    """CiA 305's table has 800, 50, 20 and 10 kbit/s as well, which the board has not."""
    assert ask(board, 0x13, table, index) == []
    ask(board, 0x04, 1)
    assert ask(board, 0x13, table, index) == [f"130{error}000000000000"]


def test_a_bit_rate_is_in_force_between_two_delays_of_silence(pair: BenchBoard) -> None:
    """All axes of the board share the controller; a second request within the delays does not begin them again."""
    timing, seen = pair.firmware.bit_timing, []
    timing.on_change = lambda: seen.append((pair.now, timing.silent, timing.bitrate))
    select(pair, 0x11)
    assert ask(pair, 0x13, 0, 3) == ["1300000000000000"]
    pair.wait(5)
    assert seen == []
    begin = pair.now
    assert ask(pair, 0x15, 0x2C, 0x01) == []
    pair.wait(100)
    assert ask(pair, 0x15, 1) == []
    pair.wait(900)
    ms = [(counts - begin) / 72_000 for counts, _, _ in seen]
    assert ms == [0, 300, 600]
    assert [told for _, *told in seen] == [[True, None], [True, 250_000], [False, 250_000]]
    assert ask(pair, 0x15, 0, 0) == []
    pair.wait(1)
    assert [told for _, *told in seen[3:]] == [[True, 250_000], [True, 250_000], [False, 250_000]]


@pytest.mark.parametrize(("stored", "after"), [(True, 125_000), (False, None)])
def test_a_stored_bit_rate_holds_for_all_axes_after_the_power(
    fast_kernel: Kernel, stored: bool, after: int | None
) -> None:
    pages = [FlashPage(), FlashPage()]
    first = Firmware(fast_kernel, 2, pages)
    first.boot(0)
    serial = [bytes(number(0x40 + i, part)) for i, part in enumerate((*IDENTITY[:3], 0x11))]
    for data in (*serial, b"\x13\x00\x04", *([b"\x17"] if stored else [])):
        first.receive(Frame(0x7E5, data.ljust(8, b"\0")), 0)
    assert first.bit_timing.bitrate is None
    again = Firmware(fast_kernel, 2, pages)
    assert again.bit_timing.bitrate == after
    assert [page.bitrate for page in pages] == [after, after]


@pytest.mark.parametrize(("stored", "after"), [(True, 0x22), (False, 0x10)])
def test_a_stored_node_id_outlives_the_power(fast_kernel: Kernel, stored: bool, after: int) -> None:
    page = FlashPage()
    first = Firmware(fast_kernel, 1, [page])
    first.boot(0)
    for data in (b"\x04\x01", b"\x11\x22", *([b"\x17"] if stored else [])):
        first.receive(Frame(0x7E5, data.ljust(8, b"\0")), 0)
    again = Firmware(fast_kernel, 1, [page])
    again.boot(0)
    assert again.nodes[0].node_id == after
    assert again.transmit.take((), 0, 0) == Frame(0x700 + after, b"\0")


def test_a_moving_board_does_not_write_its_flash(board: BenchBoard) -> None:
    board.enable()
    for i in range(5):
        board.record(16_384, 0, 100, i)
    board.start()
    board.wait(20)
    ask(board, 0x04, 1)
    assert ask(board, 0x17) == ["1702000000000000"]
    board.wait(1000)
    assert ask(board, 0x17) == ["1700000000000000"]


def test_a_node_without_node_id_is_silent_until_a_master_gives_it_one(pair: BenchBoard) -> None:
    pair.write(od.PRODUCER_HEARTBEAT_TIME, 10, 0)
    configure(pair, 0x10, 0xFF)
    pair.nmt(NmtCommand.RESET_COMMUNICATION, 0x10)
    before = len(pair.sent)
    pair.nmt(NmtCommand.START)
    pair.send(0x610, bytes.fromhex("4000100000000000"))
    pair.wait(100)
    assert {frame.cob_id & 0x7F for _, frame in pair.sent[before:]} == {0x11}
    assert [node.nmt_state for node in pair.firmware.nodes] == [NmtState.INITIALISING, NmtState.OPERATIONAL]
    assert ask(pair, 0x4C) == ["5000000000000000"]
    assert select(pair, 0x10) == ["4400000000000000"]
    assert ask(pair, 0x5E) == ["5eff000000000000"]
    assert ask(pair, 0x11, 0x30) == ["1100000000000000"]
    ask(pair, 0x04, 0)
    assert pair.last(0x730) == b"\0"
    assert [node.nmt_state for node in pair.firmware.nodes] == [NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL]
    assert ask(pair, 0x4C) == []


@pytest.mark.parametrize(("low", "high", "found"), [(0x10, 0x10, 1), (0x10, 0x11, 2), (0x11, 0x20, 1), (0x12, 0x20, 0)])
def test_nodes_within_a_range_of_serial_numbers(pair: BenchBoard, low: int, high: int, found: int) -> None:
    parts = zip((0x46, 0x47, 0x48, 0x49, 0x4A), (0, 0x6560, 0x0001_0000, 0x0001_0000, low), strict=True)
    for command, value in parts:
        assert ask(pair, *number(command, value)) == []
    assert ask(pair, *number(0x4B, high)) == ["4f00000000000000"] * found


def test_a_fast_scan_finds_only_nodes_without_node_id(pair: BenchBoard) -> None:
    start = (0x51, 0, 0, 0, 0, 0x80)
    assert ask(pair, *start) == []
    configure(pair, 0x11, 0xFF)
    pair.nmt(NmtCommand.RESET_COMMUNICATION, 0x11)
    assert ask(pair, *start) == ["4f00000000000000"]
    found = []
    for part in range(4):
        value = 0
        for bit in range(31, -1, -1):
            if not ask(pair, *struct.pack("<BIBBB", 0x51, value, bit, part, part)):
                value |= 1 << bit
        assert ask(pair, *struct.pack("<BIBBB", 0x51, value, 0, part, (part + 1) % 4)) == ["4f00000000000000"]
        found.append(value)
    assert found == [0, 0x6560, 0x0001_0000, 0x11]
    assert ask(pair, 0x5E) == ["5eff000000000000"]


@pytest.mark.slow
@given(frames=st.lists(st.binary(max_size=8) | st.tuples(st.integers(0, 0x60)).map(lambda c: bytes(c).ljust(8, b"\0"))))
def test_no_frame_is_answered_wrongly_or_raises(fast_kernel: Kernel, frames: list[bytes]) -> None:
    board = BenchBoard(fast_kernel)
    for data in frames:
        before = len(board.sent)
        board.send(0x7E5, data)
        for _, frame in board.sent[before:]:
            assert len(frame.data) == 8 or frame.cob_id != 0x7E4
        if len(data) != 8:
            assert len(board.sent) == before
