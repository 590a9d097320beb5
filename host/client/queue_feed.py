"""Feed the PVT queue of one axis: credits from the board's reports, resending after losses.

Credits are the free places last reported, less the records sent since. After a gap the cursor goes back to the record
that the board expects next; a further gap counts only once the board has had time to see the resent records. Without
any progress for a while, every record that is not acknowledged is sent again.
"""

from typing import Final

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.plain_words import error_words
from steptwin.host.client.record_payloads import payloads
from steptwin.host.client.waiting import SILENCE_S, silent
from steptwin.host.common.axis_records import AxisRecords
from steptwin.host.common.errors import DeviceFaultError
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.pvt import QUEUE_DEPTH, SEQUENCE_MODULUS, PvtFlag, PvtStatus

_GAP_HOLD_S: Final = 0.025
"""Time after a gap in which a further gap does not count: two round trips, at the reports' inhibit time of 10 ms."""
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
        """Raise DeviceFaultError if the queue ran dry while the axis rested, for which the board reports no fault."""
        status = self._axis.pvt_status
        if status is not None and not status.flags & PvtFlag.RUNNING and not self.all_acknowledged:
            raise DeviceFaultError(
                f"{self._axis.name}: ran out of records at rest before the end of its stream"
            ).plainly(f"{self._axis.name}: {error_words(ErrorCode.PVT_UNDERRUN)}")

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
        self._ever_sent = max(self._ever_sent, self._sent)
        return True


def fill(feeds: list[QueueFeed]) -> None:
    """Send one record to each axis in turn, until no axis has both a record and a credit."""
    sending = list(feeds)
    while sending:
        sending = [feed for feed in sending if feed.send_next()]
