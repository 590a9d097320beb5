"""Whose a frame is: by its identifier, by the identifiers that hosts have moved, by its direction."""

import pytest

from steptwin.host.record.recorded_bus import RecordedFrame, Sender, senders_of
from steptwin.protocol.frame import Frame

NODES = range(0x10, 0x14)
MOVE_TPDO_3 = Frame(0x610, bytes.fromhex("2302180155010000"))
"""Write 0x155 to 1802:01."""


def senders(*frames: Frame, sent: bool = False) -> list[Sender]:
    return senders_of([RecordedFrame(i, frame, sent) for i, frame in enumerate(frames)], NODES)


@pytest.mark.parametrize(
    ("cob_id", "sender"),
    [
        *((each, Sender.HOST) for each in (0x000, 0x080, 0x100, 0x210, 0x313, 0x412, 0x511, 0x610, 0x613)),
        *((each, Sender.BOARD) for each in (0x090, 0x193, 0x290, 0x390, 0x490, 0x590, 0x593, 0x710, 0x713)),
        *((each, Sender.OTHER) for each in (0x094, 0x194, 0x214, 0x594, 0x614, 0x620)),
        (0x77F, Sender.HOST),
        (0x714, Sender.HOST),
        (0x7E5, Sender.HOST),
    ],
)
def test_by_identifier(cob_id: int, sender: Sender) -> None:
    """Another station's heartbeat may be one that the board watches."""
    assert senders(Frame(cob_id, b"")) == [sender]


def test_an_identifier_that_a_host_has_moved() -> None:
    frame = Frame(0x155, b"")
    assert senders(frame, MOVE_TPDO_3, frame) == [Sender.HOST, Sender.HOST, Sender.BOARD]


@pytest.mark.parametrize(
    "data",
    ["4302180155010000", "2302180255010000", "2303140155010000", "2302180155010080", "230218015501", "21021801"],
    ids=["an answer", "another entry", "a receive PDO", "made invalid", "too short", "in segments"],
)
def test_a_request_that_moves_nothing(data: str) -> None:
    assert senders(Frame(0x610, bytes.fromhex(data)), Frame(0x155, b"")) == [Sender.HOST, Sender.HOST]


@pytest.mark.parametrize("host_sent", [True, False])
def test_by_direction_where_both_sides_are_told_apart(host_sent: bool) -> None:
    """A frame without a service is the host's if it goes the hosts' way."""
    frames = [
        RecordedFrame(0, Frame(0x000, b"\x01\x00"), host_sent),
        RecordedFrame(1, Frame(0x190, b""), not host_sent),
        RecordedFrame(2, Frame(0x155, b""), host_sent),
        RecordedFrame(3, Frame(0x156, b""), not host_sent),
    ]
    assert senders_of(frames, NODES) == [Sender.HOST, Sender.BOARD, Sender.HOST, Sender.OTHER]
