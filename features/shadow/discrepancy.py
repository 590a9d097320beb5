"""Differences between a real board and its twin.

Messages that nodes send once, boot-ups, answers to requests and errors, are compared here, each in order.
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
"""Largest delay of one side: a PDO reports a short state or not, within 20 ms."""


class DiscrepancyKind(StrEnum):
    """Kind of a difference."""

    BOOT_UP = "boot-up"
    ANSWER = "answer"
    ERROR = "error"
    STATE = "state"
    MOVING = "position on the way"
    REST = "position at rest"
    HOMING = "homing"


class Discrepancy(NamedTuple):
    """A difference between the real board and its twin.

    Attributes:
        at_s: time by the clock of the frames' stamps, in s.
        axis: name of the axis.
        kind: kind of the difference.
        board: message or value of the real board.
        twin: message or value of the twin.
        error_steps: board's position minus the twin's, in steps of the robot's file; None if no position differs.
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
"""Least stamp of a clock that counts from 1970; others count from a start of their own."""
_TOGETHER_S: Final = 0.3
"""Time span of equal discrepancies of several axes with one cause."""


def time_text(at_s: float) -> str:
    """Return a time by the stamps' clock as text: date and local time, or seconds if that clock has no date."""
    if at_s >= _DATED_S:
        try:
            return datetime.fromtimestamp(at_s).isoformat(" ", "milliseconds")
        except (ValueError, OverflowError, OSError):  # a year beyond the calendar
            pass
    return f"{at_s:.3f} s"


def grouped(discrepancies: Iterable[Discrepancy]) -> list[str]:
    """Return the lines for discrepancies, one for equal ones of several axes at about the same time."""
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
    """Return the content of a discrepancy without its axis."""
    board, twin = ([word for word in text.split() if word != each.axis] for text in (each.board, each.twin))
    return each.kind, board, twin


KINDS: Final[Mapping[int, DiscrepancyKind]] = {
    COB_HEARTBEAT: DiscrepancyKind.BOOT_UP,
    COB_SDO_RESPONSE: DiscrepancyKind.ANSWER,
    COB_EMCY: DiscrepancyKind.ERROR,
}
"""Services with messages that nodes send once."""
"""An answer's command, index and sub-index."""


class _Saying(NamedTuple):
    """A message: its instant in counts, the content to compare, the frame."""

    counts: int
    key: bytes | str
    frame: Frame


class Sayings:
    """Messages of one service and identifier on both sides that have no counterpart yet."""

    def __init__(self, decoder: Decoder) -> None:
        self._decoder = decoder
        self.past: Collection[int] = ()
        """Entries that are not compared, since their values come from before the twin's start."""
        self._board: dict[int, deque[_Saying]] = {}
        self._twin: dict[int, deque[_Saying]] = {}

    def hear(self, counts: int, frame: Frame, *, of_board: bool) -> None:
        """Add a message of the real board or of the twin, in the order of each side."""
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
        """Yield instant, node id, kind, and the texts of board and twin for each message without a counterpart."""
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
    """Return the address of an answer's entry."""
    return named_address(data) if len(data) >= OBJECT.stop else 0


def _without_like(board: deque[_Saying], twin: deque[_Saying]) -> tuple[_Saying | None, _Saying | None]:
    """Return the first message of the side with more messages, or of both sides if each has one of its own."""
    if not twin or (board and twin[0].key in {saying.key for saying in board}):
        return board.popleft(), None
    if not board or board[0].key in {saying.key for saying in twin}:
        return None, twin.popleft()
    return board.popleft(), twin.popleft()
