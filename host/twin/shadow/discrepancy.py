"""What a real board does otherwise than its twin."""

from enum import StrEnum
from typing import Any, Final, NamedTuple

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
        return f"{self.at_s:.3f} {self.axis} {self.kind}: board {self.board}, twin {self.twin}"

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
