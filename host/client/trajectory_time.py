"""Bound the trajectory time that a group of axes has reached, by the record that one of them reports as executing.

Trajectory time passes as fast as the clock or, while the group halts, more slowly. So it lies between the start of the
record executed and that record's end plus the time since the report.
"""

from collections.abc import Iterable
from itertools import accumulate
from typing import Final

from steptwin.protocol.pvt import SEQUENCE_MODULUS

_BEHIND: Final = SEQUENCE_MODULUS // 2
"""A number this far ahead, modulo 256, is taken for an old one: reports come at least every 128 records."""


class TrajectoryTime:
    """Lower and upper bound of the time since the trajectory's start, in seconds."""

    def __init__(self, durations_ms: list[int], now_s: float) -> None:
        self._begins_ms = [0, *accumulate(durations_ms)]
        """The beginning of every record, then the end of the last."""
        self._executing = 0
        self._reported_s = now_s

    def extend(self, durations_ms: Iterable[int]) -> None:
        """Add records behind the last one."""
        for duration_ms in durations_ms:
            self._begins_ms.append(self._begins_ms[-1] + duration_ms)

    def report(self, executing: int, now_s: float) -> None:
        """Take a report of the executing record's sequence number, which is its number modulo 256 (2012h:04)."""
        ahead = (executing - self._executing) % SEQUENCE_MODULUS
        if ahead < _BEHIND:
            self._executing = min(self._executing + ahead, len(self._begins_ms) - 2)
            self._reported_s = now_s

    def end(self) -> None:
        """Take the report that the last record has been executed."""
        self._executing = len(self._begins_ms) - 1

    @property
    def least_s(self) -> float:
        """The lower bound: the trajectory has reached at least this time."""
        return self._begins_ms[self._executing] / 1000

    def most_s(self, now_s: float) -> float:
        """Return the upper bound: the trajectory has reached at most this time."""
        return self._begins_ms[min(self._executing + 1, len(self._begins_ms) - 1)] / 1000 + now_s - self._reported_s
