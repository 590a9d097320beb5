"""The SYNC consumer: what a SYNC frame must look like and the count that it carries (CiA 301, section 7.2.5).

Object 0x1019 says whether SYNC carries a counter, and up to where it counts. The cycle period 0x1006 is what a SYNC
producer keeps; CiA 301 asks nothing of a consumer by it, so it is stored and, while it is not 0, holds 0x1019 fixed.
"""

from steptwin.protocol import od
from steptwin.protocol.abort import AbortCode, SdoAbortError
from steptwin.protocol.dictionary import ObjectDictionary


class SyncConsumer:
    """Reads SYNC frames as 0x1019 prescribes."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        self._dictionary = dictionary
        dictionary.write_hooks[od.SYNC_COUNTER_OVERFLOW] = self._write_overflow

    def counter_of(self, data: bytes) -> int | None:
        """The counter that a SYNC frame carries, 0 if none is agreed on; None if the frame's length is wrong."""
        counted = self._dictionary.get(od.SYNC_COUNTER_OVERFLOW) != 0
        if len(data) != counted:
            return None
        return data[0] if counted else 0

    def _write_overflow(self, value: int) -> None:
        """0, or 2 to 240 (the table bounds it above); fixed while a cycle period is set (CiA 301, 7.5.2.19)."""
        if value == 1:
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        if self._dictionary.get(od.COMMUNICATION_CYCLE_PERIOD):
            raise SdoAbortError(AbortCode.DEVICE_STATE)
