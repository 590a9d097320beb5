"""Feed the PVT queue of one axis: credits from the board's reports, resending after losses.

Credits are the last reported free places minus the records sent since. After a gap the cursor returns to the record
that the board expects next; further gap reports are ignored until the board can have received the resent records. After
a time without progress, all records that are not acknowledged are sent again.

Trajectory time may run slower or faster than the clock, up to the highest speed of its stream. So it is between the
start of the executed record and the end of that record plus the time since the report at the highest speed.
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
"""A number this far ahead, modulo 256, is an old one: there is a report at least every 128 records."""


class TrajectoryTime:
    """Lower and upper bound of the trajectory time, in seconds."""

    def __init__(self, durations_ms: list[int], now_s: float, highest_percent: int = 100) -> None:
        self._begins_ms = [0, *accumulate(durations_ms)]
        """Begin of every record, and end of the last."""
        self._executing = 0
        self._reported_s = now_s
        self._gain = highest_percent / 100 - 1
        """Fraction by which trajectory time may run faster than the clock."""

    def extend(self, durations_ms: Iterable[int]) -> None:
        """Append records."""
        for duration_ms in durations_ms:
            self._begins_ms.append(self._begins_ms[-1] + duration_ms)

    def report(self, executing: int, now_s: float) -> None:
        """Process a report of the executing sequence number (2012h:04), the record's number modulo 256."""
        ahead = (executing - self._executing) % SEQUENCE_MODULUS
        if ahead < _BEHIND:
            self._executing = min(self._executing + ahead, len(self._begins_ms) - 2)
            self._reported_s = now_s

    def end(self) -> None:
        """Process the report that the last record has been executed."""
        self._executing = len(self._begins_ms) - 1

    @property
    def least_s(self) -> float:
        """Lower bound of the trajectory time."""
        return self._begins_ms[self._executing] / 1000

    def most_s(self, now_s: float) -> float:
        """Return the upper bound of the trajectory time."""
        ended_s = self._begins_ms[min(self._executing + 1, len(self._begins_ms) - 1)] / 1000
        return ended_s + now_s - self._reported_s + self._gain * (now_s - self._reported_s)


_I24_MASK = (1 << 24) - 1
_PAYLOAD: Final = "V8"
"""numpy type of eight opaque bytes."""


def payloads(records: AxisRecords, first: int) -> list[bytes]:
    """Encode records like `PvtRecord.encode`, numbered from `first` on.

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
"""Time after a gap in which further gap reports are ignored: two round trips at the inhibit time of 10 ms."""
_RESEND_AFTER_S: Final = 0.25


class QueueFeed:
    """Sends the records of one axis to its queue."""

    def __init__(self, axis: AxisClient, records: AxisRecords, now_s: float) -> None:
        self._axis = axis
        self._payloads = payloads(records, 0)
        self._count = len(self._payloads)
        self._later = 0
        """Number of records of the trajectory that will be added later."""
        self._held = 0
        """Number of added records without motion."""
        self._sent = 0
        """Cursor: number of records sent; it decreases when records are sent again."""
        self._ever_sent = 0
        """Highest `_sent` so far: the board may have accepted these records although the cursor was moved back."""
        self._acknowledged = 0
        self._free = QUEUE_DEPTH
        self._seen: PvtStatus | None = axis.pvt_status
        self._progress_s = now_s
        self._heard_s = now_s
        self._gap_reported = False
        self._gap_handled_s = now_s - _GAP_HOLD_S

    @property
    def fraction(self) -> float:
        """Fraction of the records that has been sent, 0 to 1."""
        planned = self._count - self._held + self._later
        return max(0, self._sent - self._held) / max(1, planned)

    @property
    def all_acknowledged(self) -> bool:
        """True if the board has accepted every record and no more will be added."""
        return self._acknowledged == self._count and not self._later

    def expect(self, later: int) -> None:
        """Set the number of records that will be added later; until then the queue must not run empty."""
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
        """Process the board's last report, if it is new, and move the cursor back after a loss.

        Raises:
            BusError: there was no report for SILENCE_S.
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
        if self._sent == self._acknowledged:  # the board has all sent records: measure the time from the next record on
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
        """Raise DeviceFaultError if the queue ran empty at standstill, for which the board reports no fault."""
        status = self._axis.pvt_status
        if status is not None and not status.flags & PvtFlag.RUNNING and not self.all_acknowledged:
            raise self._axis.ran_dry()

    def _rewind(self, now_s: float) -> None:
        self._sent = self._acknowledged
        self._progress_s = now_s

    def send_next(self) -> bool:
        """Send one record, if there is one and the queue has a free place; return whether one was sent."""
        i = self._sent
        if i == self._count or i - self._acknowledged >= self._free:
            return False
        self._axis.send_record(self._payloads[i])
        self._sent = i + 1
        self._ever_sent = self._sent if self._sent > self._ever_sent else self._ever_sent
        return True


def fill(feeds: list[QueueFeed], between: Callable[[], None] = lambda: None) -> None:
    """Send one record to each axis in turn, until no axis has both a record and a credit.

    `between` is called after each round, for work that must not wait until all records are sent.
    """
    sending = list(feeds)
    while sending:
        sending = [feed for feed in sending if feed.send_next()]
        between()
