"""What a real board does otherwise than its twin.

What nodes say once, boot-ups, answers to requests and errors, is compared here, each in its order.
"""

from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping
from datetime import datetime
from enum import StrEnum
from typing import Any, Final, NamedTuple

from steptwin.features.replay.differences import KEYS, NOTHING, words_of
from steptwin.host.client.monitor import Decoder
from steptwin.protocol.frame import COB_EMCY, COB_HEARTBEAT, COB_SDO_RESPONSE, NODE_ID_MAX, Frame
from steptwin.protocol.sdo_frames import OBJECT, named_address
from steptwin.protocol.timer import COUNTS_PER_MS

SETTLED_COUNTS: Final = 50 * COUNTS_PER_MS
"""Time by which one side may be later than the other: a passing state is told by a PDO or not, within 20 ms."""


class DiscrepancyKind(StrEnum):
    """What differs."""

    BOOT_UP = "boot-up"
    ANSWER = "answer"
    ERROR = "error"
    STATE = "state"
    MOVING = "position on the way"
    REST = "position at rest"
    HOMING = "homing"


class Discrepancy(NamedTuple):
    """Something that the real board does otherwise.

    Attributes:
        at_s: time by the clock of the frames' stamps, in s.
        axis: name of the axis.
        kind: what differs.
        board: what the real board says.
        twin: what the twin says.
        error_steps: by how many steps of the robot's file the board is ahead of the twin; None if no position differs.
    """

    at_s: float
    axis: str
    kind: DiscrepancyKind
    board: str
    twin: str
    error_steps: float | None = None

    def __str__(self) -> str:
        return f"{time_text(self.at_s)} {self.axis} {self.kind}: board {self.board}, twin {self.twin}"

    def to_dict(self) -> dict[str, Any]:
        """Return the discrepancy under the keys of a line of JSON."""
        return {
            "at_s": self.at_s,
            "axis": self.axis,
            "kind": self.kind.value,
            "board": self.board,
            "twin": self.twin,
            "error_steps": self.error_steps,
        }


_DATED_S: Final = 100_000_000.0
"""Stamps from here on are of a clock that counts from 1970; those before count from a start of their own."""
_TOGETHER_S: Final = 0.3
"""Time within which several axes say the same for one reason."""


def time_text(at_s: float) -> str:
    """Return a time by the stamps' clock: date and local time of day, or seconds if that clock knows no date."""
    if at_s >= _DATED_S:
        try:
            return datetime.fromtimestamp(at_s).isoformat(" ", "milliseconds")
        except (ValueError, OverflowError, OSError):  # a year that no calendar has
            pass
    return f"{at_s:.3f} s"


def grouped(discrepancies: Iterable[Discrepancy]) -> list[str]:
    """Return the lines that tell discrepancies, one for what several axes say at about the same time."""
    first: list[Discrepancy] = []
    others: list[list[str]] = []
    for each in discrepancies:
        for i, began in enumerate(first):
            if _like(began) == _like(each) and abs(each.at_s - began.at_s) < _TOGETHER_S:
                others[i].append(each.axis)
                break
        else:
            first.append(each)
            others.append([])
    return [f"{each}; also {', '.join(axes)}" if axes else str(each) for each, axes in zip(first, others, strict=True)]


def _like(each: Discrepancy) -> tuple[DiscrepancyKind, list[str], list[str]]:
    """Return what a discrepancy says, without its axis."""
    board, twin = ([word for word in text.split() if word != each.axis] for text in (each.board, each.twin))
    return each.kind, board, twin


KINDS: Final[Mapping[int, DiscrepancyKind]] = {
    COB_HEARTBEAT: DiscrepancyKind.BOOT_UP,
    COB_SDO_RESPONSE: DiscrepancyKind.ANSWER,
    COB_EMCY: DiscrepancyKind.ERROR,
}
"""The services by which a node says something once."""
"""An answer's command, index and sub-index."""


class _Saying(NamedTuple):
    """Something said: its instant in counts, what of it is compared, the frame."""

    counts: int
    key: bytes | str
    frame: Frame


class Sayings:
    """What the nodes of one service and identifier say, on both sides, and has not found its like yet."""

    def __init__(self, decoder: Decoder) -> None:
        self._decoder = decoder
        self.past: Collection[int] = ()
        """Entries whose values are not compared, since they tell of a time that the twin has not heard."""
        self._board: dict[int, deque[_Saying]] = {}
        self._twin: dict[int, deque[_Saying]] = {}

    def hear(self, counts: int, frame: Frame, *, of_board: bool) -> None:
        """Take a frame of the real board or of the twin, in the order of each side."""
        base = frame.cob_id & ~NODE_ID_MAX
        if base not in KINDS:
            return
        key = KEYS[base](frame.data)
        if base == COB_SDO_RESPONSE and key is not None and _address(frame.data) in self.past:
            key = frame.data[: OBJECT.stop]
        if key is not None:
            side = self._board if of_board else self._twin
            side.setdefault(frame.cob_id, deque()).append(_Saying(counts, key, frame))

    def differing(self, now_counts: int) -> Iterator[tuple[int, int, DiscrepancyKind, str, str]]:
        """Yield instant, node id, kind, the board's and the twin's words of each saying without its like so far."""
        for cob_id in [*self._board, *(set(self._twin) - set(self._board))]:
            board, twin = (side.setdefault(cob_id, deque()) for side in (self._board, self._twin))
            while board or twin:
                if board and twin and board[0].key == twin[0].key:
                    board.popleft()
                    twin.popleft()
                    continue
                since_counts = min(side[0].counts for side in (board, twin) if side)
                if now_counts - since_counts < SETTLED_COUNTS:
                    break
                was, now = _without_like(board, twin)
                kind = KINDS[cob_id & ~NODE_ID_MAX]
                yield since_counts, cob_id & NODE_ID_MAX, kind, self._words(was), self._words(now)

    def _words(self, saying: _Saying | None) -> str:
        return NOTHING if saying is None else words_of(saying.frame, self._decoder)


def _address(data: bytes) -> int:
    """Return the address of the entry that an answer names."""
    return named_address(data) if len(data) >= OBJECT.stop else 0


def _without_like(board: deque[_Saying], twin: deque[_Saying]) -> tuple[_Saying | None, _Saying | None]:
    """Take the first saying of the side that says more, or of both sides if each says something of its own."""
    if not twin or (board and twin[0].key in {saying.key for saying in board}):
        return board.popleft(), None
    if not board or board[0].key in {saying.key for saying in twin}:
        return None, twin.popleft()
    return board.popleft(), twin.popleft()
