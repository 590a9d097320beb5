"""Tell whose the frames of a recorded bus are: the board's, its hosts', or those of other nodes.

Identifiers tell it (CiA 301, section 7.3.5). Hosts may move the identifiers of a board's PDOs and EMCY: what they write
by SDO is followed. Of identifiers that belong to no service the direction tells it, if the recording program was one of
both sides.
"""

from collections.abc import Collection, Iterable, Sequence
from enum import Enum
from typing import Final

from steptwin.host.record.recorded_bus.reading import RecordedFrame
from steptwin.protocol.frame import (
    COB_HEARTBEAT,
    COB_ID_INVALID,
    COB_ID_MASK,
    COB_NMT,
    COB_SDO_REQUEST,
    COB_SYNC,
    COB_TPDO,
    FROM_NODE,
    NODE_ID_MAX,
    TO_NODE,
    Frame,
)

_COB_TIME: Final = 0x100
_MOVABLE: Final = {(0x1014, 0), *((0x1800 + i, 1) for i in range(len(COB_TPDO)))}
"""Objects that hold the identifiers of a node's own frames."""
_SDO_BYTES: Final = 8
_EXPEDITED_DOWNLOAD: Final = 0x22
_SPECIFIER_AND_EXPEDITED: Final = 0xE2


class Sender(Enum):
    """The side of the bus that has sent a frame."""

    BOARD = "board"
    HOST = "host"
    """A host, or another station to which a board may listen, such as one whose heartbeat it watches."""
    OTHER = "other"
    """A node that is not the board's, or a host that talks to one."""


def senders_of(frames: Sequence[RecordedFrame], node_ids: Collection[int]) -> list[Sender]:
    """Return who has sent each frame of a recording, for a board with these nodes."""
    by_identifier = list(_by_identifier(frames, node_ids))
    host_sent = _host_was_recording(frames, by_identifier)
    return [
        sender or (Sender.OTHER if host_sent is not None and frame.sent != host_sent else Sender.HOST)
        for frame, sender in zip(frames, by_identifier, strict=True)
    ]


def _by_identifier(frames: Sequence[RecordedFrame], node_ids: Collection[int]) -> Iterable[Sender | None]:
    """Yield who has sent each frame; None if its identifier belongs to no service."""
    boards = {base + node for base in FROM_NODE for node in node_ids}
    known: dict[int, Sender | None] = {}
    for _, frame, _ in frames:
        cob_id = frame.cob_id
        if cob_id not in known:
            known[cob_id] = Sender.BOARD if cob_id in boards else _of_no_board(cob_id, node_ids)
        yield known[cob_id]
        moved = _moved_identifier(frame, node_ids)
        if moved is not None:
            known[moved] = Sender.BOARD


def _of_no_board(cob_id: int, node_ids: Collection[int]) -> Sender | None:
    if cob_id in (COB_NMT, COB_SYNC, _COB_TIME):
        return Sender.HOST
    base, node_id = cob_id & ~NODE_ID_MAX, cob_id & NODE_ID_MAX
    if not node_id:
        return None
    if base == COB_HEARTBEAT:
        return Sender.HOST
    if base in TO_NODE:
        return Sender.HOST if node_id in node_ids else Sender.OTHER
    return Sender.OTHER if base in FROM_NODE else None


def _moved_identifier(frame: Frame, node_ids: Collection[int]) -> int | None:
    """Return the identifier that an SDO request gives to a board's PDO or EMCY; None for any other frame."""
    data = frame.data
    if frame.cob_id - COB_SDO_REQUEST not in node_ids or len(data) != _SDO_BYTES:
        return None
    if data[0] & _SPECIFIER_AND_EXPEDITED != _EXPEDITED_DOWNLOAD:
        return None
    if (int.from_bytes(data[1:3], "little"), data[3]) not in _MOVABLE:
        return None
    value = int.from_bytes(data[4:], "little")
    return None if value & COB_ID_INVALID else value & COB_ID_MASK


def _host_was_recording(frames: Sequence[RecordedFrame], senders: Sequence[Sender | None]) -> bool | None:
    """Return whether the hosts' frames are those that the recording program sent; None if directions do not tell."""
    sides = {
        side: {frame.sent for frame, sender in zip(frames, senders, strict=True) if sender is side}
        for side in (Sender.HOST, Sender.BOARD)
    }
    hosts, boards = sides[Sender.HOST], sides[Sender.BOARD]
    return hosts.pop() if len(hosts) == len(boards) == 1 and hosts != boards else None
