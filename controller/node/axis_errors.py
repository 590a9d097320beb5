"""The errors of one axis: EMCY frames, error register and error history, connected to the object dictionary."""

from collections.abc import Callable
from typing import Final

from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.dictionary import ObjectDictionary, check_cob_id
from steptwin.protocol.emergency import EmergencyProducer
from steptwin.protocol.frame import COB_ID_INVALID, Frame
from steptwin.protocol.heartbeat_consumer import HeartbeatConsumer

_PDO_LENGTH_ERRORS: Final = (ErrorCode.PDO_TOO_SHORT, ErrorCode.PDO_TOO_LONG)
_PDO_ERRORS: Final = (*_PDO_LENGTH_ERRORS, ErrorCode.RPDO_TIMEOUT)


class AxisErrors(EmergencyProducer):
    """Reports errors when they occur and resolves them when their cause is gone."""

    def __init__(self, dictionary: ObjectDictionary, heartbeats: HeartbeatConsumer, touch: Callable[[], None]) -> None:
        super().__init__()
        self._dictionary = dictionary
        self._heartbeats = heartbeats
        self._touch = touch
        dictionary.bind(self)

    def check_new_cob_id(self, cob_id: int) -> None:
        """Refuse a COB-ID that an EMCY may not have, and a new identifier while the present one is valid."""
        check_cob_id(self._dictionary.get(od.EMCY_COB_ID), cob_id)

    def report(self, code: ErrorCode, detail: int) -> None:
        """Send an EMCY, unless the error is already active."""
        self._touch()
        self.raise_error(code, detail)

    def resolved(self, code: ErrorCode, detail: int | None = None) -> None:
        """Resolve an error with one detail, or with all its details."""
        self._resolve(lambda active, of: active is code and detail in (None, of))

    def pdo_received(self, number: int, *, in_fault: bool) -> None:
        """Resolve the errors of an RPDO after a frame of correct length; its time-out stays active in fault."""
        ended = _PDO_LENGTH_ERRORS if in_fault else _PDO_ERRORS
        self._resolve(lambda code, detail: code in ended and detail == number + 1)

    def acknowledge_faults(self) -> None:
        """Resolve the drive's errors, those of a lost connection, and the lost heartbeats whose producer is back.

        Other communication errors are resolved by frames that prove that communication works again.
        """
        self._resolve(self._is_over)

    def _is_over(self, code: ErrorCode, detail: int) -> bool:
        if code is ErrorCode.HEARTBEAT_LOST:
            return detail not in self._heartbeats.lost
        return code.lost_connection or not code.communication  # the frame of a fault reset ends the others

    def _resolve(self, gone: Callable[[ErrorCode, int], bool]) -> None:
        self._touch()
        self.resolve(gone)

    def next_frame(self, now_us: int) -> Frame | None:
        """Return the EMCY to send now, if one is due and the EMCY COB-ID (1014h) is valid."""
        payload = self.poll(now_us, self._dictionary.get(od.EMCY_INHIBIT_TIME))
        cob_id = self._dictionary.get(od.EMCY_COB_ID)
        return Frame(cob_id, payload) if payload and not cob_id & COB_ID_INVALID else None
