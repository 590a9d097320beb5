"""How far a group has come on its trajectory, by the record that one of its axes says it executes.

Trajectory time goes with the clock or, halted, slower. So it lies between the begin of the record executed and that
record's end plus the time since the report.
"""

from itertools import accumulate
from typing import Final

from steptwin.protocol.pvt import SEQUENCE_MODULUS

_BEHIND: Final = SEQUENCE_MODULUS // 2


class TrajectoryTime:
    """Bounds of the time since the trajectory's start, in seconds."""

    def __init__(self, durations_ms: list[int], now_s: float) -> None:
        self._begins_ms = [0, *accumulate(durations_ms)]
        """Of every record, and the end of the last."""
        self._executing = 0
        self._reported_s = now_s

    def report(self, executing: int, now_s: float) -> None:
        """Take in object 0x2012:04, the number of a record modulo 256.

        Reports come more often than every 128 records: a number further ahead is an old one.
        """
        ahead = (executing - self._executing) % SEQUENCE_MODULUS
        if ahead < _BEHIND:
            self._executing = min(self._executing + ahead, len(self._begins_ms) - 2)
            self._reported_s = now_s

    def end(self) -> None:
        """The last record has been executed."""
        self._executing = len(self._begins_ms) - 1

    @property
    def least_s(self) -> float:
        """The trajectory has come at least so far."""
        return self._begins_ms[self._executing] / 1000

    def most_s(self, now_s: float) -> float:
        """It has come no further."""
        return self._begins_ms[min(self._executing + 1, len(self._begins_ms) - 1)] / 1000 + now_s - self._reported_s
