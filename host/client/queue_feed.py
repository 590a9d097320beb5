"""Feed the PVT queue of one axis: credits from the board's reports, resending after losses.

Credits are the free places last reported, less the records sent since. After a gap the cursor goes back to the record
that the board expects next; a further gap counts only once the board has had time to see the resent records. Without
any progress for a while, every record that is not acknowledged is sent again.

Trajectory time passes as fast as the clock, more slowly, or faster, up to the highest speed that its stream allows. So
it lies between the start of the record executed and that record's end plus the time since the report at that speed.
"""

from collections.abc import Callable, Iterable
from itertools import accumulate
from typing import Final

import numpy as np

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.waiting import SILENCE_S, silent
from steptwin.host.common.arrays import AxisRecords
from steptwin.host.common.errors import DeviceFaultError
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.pvt import I24_MAX, I24_MIN, QUEUE_DEPTH, SEQUENCE_MODULUS, PvtFlag, PvtStatus

_BEHIND: Final = SEQUENCE_MODULUS // 2
"""A number this far ahead, modulo 256, is taken for an old one: reports come at least every 128 records."""


class TrajectoryTime:
    """Lower and upper bound of the time since the trajectory's start, in seconds."""

    def __init__(self, durations_ms: list[int], now_s: float, highest_percent: int = 100) -> None:
        self._begins_ms = [0, *accumulate(durations_ms)]
        """The beginning of every record, then the end of the last."""
        self._executing = 0
        self._reported_s = now_s
        self._gain = highest_percent / 100 - 1
        """By how much more than the clock's the trajectory's time may have passed, as a part."""

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
        ended_s = self._begins_ms[min(self._executing + 1, len(self._begins_ms) - 1)] / 1000
        return ended_s + now_s - self._reported_s + self._gain * (now_s - self._reported_s)


_I24_MASK = (1 << 24) - 1
_PAYLOAD: Final = "V8"
"""numpy's type for eight bytes that mean nothing to it."""


def payloads(records: AxisRecords, first: int) -> list[bytes]:
    """Return the bytes of each record, as `PvtRecord.encode` makes them; they are numbered from `first` on.

    Raises:
        OverflowError: a value exceeds its field.
    """
    displacements, velocities = (_within(values, I24_MIN, I24_MAX) & _I24_MASK for values in records[:2])
    durations = _within(records.durations_ms, 0, 255)
    sequences = np.arange(first, first + len(durations)) % SEQUENCE_MODULUS
    words = displacements | velocities << 24 | durations << 48 | sequences << 56
    data: list[bytes] = words.astype("<i8").view(_PAYLOAD).tolist()
    return data


def _within(values: list[int], low: int, high: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    array = np.array(values, np.int64)
    wrong = array[(array < low) | (array > high)]
    if wrong.size:
        raise OverflowError(f"a PVT record has no room for {wrong[0]}: its field holds {low} to {high}")
    return array


_GAP_HOLD_S: Final = 0.025
"""Time after a gap when a further gap does not count: two round trips, at the reports' inhibit time of 10 ms."""
_RESEND_AFTER_S: Final = 0.25


class QueueFeed:
    """The records of one axis on their way to its queue."""

    def __init__(self, axis: AxisClient, records: AxisRecords, now_s: float) -> None:
        self._axis = axis
        self._payloads = payloads(records, 0)
        self._count = len(self._payloads)
        self._later = 0
        """Number of records of the trajectory that are still to be added."""
        self._held = 0
        """Number of records without motion that were added to it."""
        self._sent = 0
        """Number of records sent, the cursor; it goes back when records are sent again."""
        self._ever_sent = 0
        """The highest `_sent` so far: the board may have taken these records although the cursor went back."""
        self._acknowledged = 0
        self._free = QUEUE_DEPTH
        self._seen: PvtStatus | None = axis.pvt_status
        self._progress_s = now_s
        self._heard_s = now_s
        self._gap_reported = False
        self._gap_handled_s = now_s - _GAP_HOLD_S

    @property
    def fraction(self) -> float:
        """The part of the records that has been sent, 0 to 1."""
        planned = self._count - self._held + self._later
        return max(0, self._sent - self._held) / max(1, planned)

    @property
    def all_acknowledged(self) -> bool:
        """True once the board has taken every record and no more are to come."""
        return self._acknowledged == self._count and not self._later

    def expect(self, later: int) -> None:
        """Say how many records of the trajectory are still to be added: until then the queue must not run dry."""
        self._later = later

    def add(self, records: AxisRecords) -> None:
        """Add expected records."""
        self._later -= len(records.durations_ms)
        self._append(records)

    def hold(self, duration_ms: int, count: int = 1) -> None:
        """Add records without motion."""
        self._held += count
        self._append(AxisRecords([0] * count, [0] * count, [duration_ms] * count))

    def _append(self, records: AxisRecords) -> None:
        self._payloads += payloads(records, self._count)
        self._count = len(self._payloads)

    def update(self, now_s: float) -> None:
        """Read the board's latest report, if it is new, and move the cursor back where records were lost.

        Raises:
            BusError: no report has come for SILENCE_S.
            DeviceFaultError: the board has refused a record.
        """
        status = self._axis.pvt_status
        if status is not None and status is not self._seen:
            self._seen = status
            self._heard_s = now_s
            self._take(status, now_s)
        elif now_s - self._heard_s > SILENCE_S:
            raise silent(self._axis.name)
        if self._gap_reported and now_s - self._gap_handled_s > _GAP_HOLD_S:
            self._gap_reported = False
            self._gap_handled_s = now_s
            self._rewind(now_s)
        if self._sent == self._acknowledged:  # the board has every record sent: the time runs from the next record
            self._progress_s = now_s
        elif now_s - self._progress_s > _RESEND_AFTER_S:
            self._rewind(now_s)

    def _take(self, status: PvtStatus, now_s: float) -> None:
        advanced = (status.next_sequence - self._acknowledged) % SEQUENCE_MODULUS
        if 0 < advanced <= self._ever_sent - self._acknowledged:
            self._acknowledged += advanced
            self._sent = max(self._sent, self._acknowledged)
            self._progress_s = now_s
        self._free = status.free
        self._gap_reported = bool(status.flags & PvtFlag.GAP)
        if status.flags & PvtFlag.REJECTED:
            raise DeviceFaultError(
                f"{self._axis.name}: the board has refused record {self._acknowledged + 1} of {self._count}"
                f" (EMCY 0x{ErrorCode.SEGMENT_REFUSED:04X})"
            ).plainly(f"{self._axis.name}: the board has refused a part of the motion")

    def check_running(self) -> None:
        """Raise DeviceFaultError if the queue ran dry while the axis rested: the board reports no fault then."""
        status = self._axis.pvt_status
        if status is not None and not status.flags & PvtFlag.RUNNING and not self.all_acknowledged:
            raise self._axis.ran_dry()

    def _rewind(self, now_s: float) -> None:
        self._sent = self._acknowledged
        self._progress_s = now_s

    def send_next(self) -> bool:
        """Send one record, unless all are sent or the queue has no free place; return whether one was sent."""
        i = self._sent
        if i == self._count or i - self._acknowledged >= self._free:
            return False
        self._axis.send_record(self._payloads[i])
        self._sent = i + 1
        self._ever_sent = self._sent if self._sent > self._ever_sent else self._ever_sent
        return True


def fill(feeds: list[QueueFeed], between: Callable[[], None] = lambda: None) -> None:
    """Send one record to each axis in turn, until no axis has both a record and a credit.

    `between` is called after each round, for what must not wait until all are sent.
    """
    sending = list(feeds)
    while sending:
        sending = [feed for feed in sending if feed.send_next()]
        between()
