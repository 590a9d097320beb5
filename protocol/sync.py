"""Check SYNC frames and read the counter that they may carry (CiA 301, section 7.2.5).

The synchronous counter overflow value (1019h) says whether SYNC carries a counter, and up to which value it counts. The
communication cycle period (1006h) concerns SYNC producers only: it is stored and, while it is not 0, makes 1019h
read-only.
"""

from steptwin.protocol import od
from steptwin.protocol.abort import AbortCode, SdoAbortError
from steptwin.protocol.dictionary import ObjectDictionary


class SyncConsumer:
    """Reads SYNC frames as the synchronous counter overflow value (1019h) prescribes."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        self._dictionary = dictionary
        dictionary.bind(self)

    def counter_of(self, data: bytes) -> int | None:
        """Return the counter of a SYNC frame, 0 if SYNC carries none; None if the frame's length is wrong."""
        counted = self._dictionary.get(od.SYNC_COUNTER_OVERFLOW) != 0
        if len(data) != counted:
            return None
        return data[0] if counted else 0

    def check_overflow(self, value: int) -> None:
        """Refuse 1 (the object table bounds the value to 0..240), and any value while a cycle period is set.

        Source: CiA 301, section 7.5.2.19.
        """
        if value == 1:
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        if self._dictionary.get(od.COMMUNICATION_CYCLE_PERIOD):
            raise SdoAbortError(AbortCode.DEVICE_STATE)
