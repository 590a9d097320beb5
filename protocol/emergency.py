"""Produce emergencies: EMCY frames, error register and error history (CiA 301, section 7.2.7).

An error is a code with a detail. It is reported once, when it occurs, and stays active until it is resolved. The error
register holds the bits of all active errors. Each time errors are resolved, "no error" is sent with the register's
remaining bits (CiA 301 figure 51, transitions 3 and 4), so that a listener sees the bits fall one by one.

The inhibit time makes frames wait, in a queue that has a place for each code. A further frame displaces the oldest that
a later one of the same code makes out of date. So the last frame of each code is always sent, and so is the register as
it is now; that frames were lost is an error of its own until the queue is empty.
"""

from collections import deque
from collections.abc import Callable
from typing import Final

from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, Overrun
from steptwin.protocol.od import HISTORY_DEPTH
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

PLACES: Final = len(ErrorCode)
"""Frames that may wait. One more, and two of them have the same code; "no error" is a code, too."""
_QUEUE_OVERRUN = (ErrorCode.CAN_OVERRUN, Overrun.EMCY_QUEUE)
_UNIT_US = 100
"""Unit of the inhibit time EMCY (1015h)."""


class EmergencyProducer:
    """Queues EMCY payloads, spaced by the inhibit time, and keeps the register and the history of the node."""

    def __init__(self) -> None:
        self.history: deque[int] = deque(maxlen=HISTORY_DEPTH)
        """Error codes of the last errors, the newest first."""
        self.register: int = 0
        """Error register (1001h): the bits of all active errors."""
        self.lost: int = 0
        """Number of frames that were displaced from the queue."""
        self._active: set[tuple[ErrorCode, int]] = set()
        self._waiting: deque[tuple[ErrorCode, bytes]] = deque()
        self._not_before_us = 0

    def is_active(self, code: ErrorCode) -> bool:
        """Return True if an error with this code is active, whatever its detail."""
        return any(active == code for active, _ in self._active)

    def raise_error(self, code: ErrorCode, detail: int = 0) -> None:
        """Report an error unless it is active already; `detail` fills the five manufacturer-specific bytes."""
        if (code, detail) in self._active:
            return
        self._set_active(self._active | {(code, detail)})
        self.history.appendleft(code)
        self._queue(code, detail)

    def resolve(self, gone: Callable[[ErrorCode, int], bool]) -> None:
        """Clear the active errors that `gone` is true for; queue one frame if there are any."""
        left = {(code, detail) for code, detail in self._active if not gone(code, detail)}
        if left != self._active:
            self._set_active(left)
            self._queue(ErrorCode.NONE, 0)

    @property
    def history_length(self) -> int:
        """Number of errors in the history."""
        return len(self.history)

    def history_at(self, address: int) -> int:
        """Return the error in an entry of the history (1003h).

        Raises:
            SdoAbortError: there is none (CiA 301, section 7.5.2.4).
        """
        i = od.ERROR_HISTORY.index(address)
        if i >= len(self.history):
            raise SdoAbortError(AbortCode.NO_DATA)
        return self.history[i]

    def clear_history(self, _value: int = 0) -> None:
        """Forget the last errors."""
        self.history.clear()

    def forget(self) -> None:
        """Clear errors, history, queue and counter, as at power-up."""
        self._set_active(set())
        self.clear_history()
        self._waiting.clear()
        self.lost = 0

    def reset_communication(self) -> None:
        """Clear the communication errors and drop the frames that wait."""
        self._set_active({(code, detail) for code, detail in self._active if not code.communication})
        self._waiting.clear()

    def _set_active(self, active: set[tuple[ErrorCode, int]]) -> None:
        self._active = active
        self.register = 0
        for code, _ in active:
            self.register |= code.register

    def _queue(self, code: ErrorCode, detail: int) -> None:
        payload = code.to_bytes(2, "little") + bytes((self.register,)) + detail.to_bytes(5, "little")
        self._waiting.append((code, payload))
        if len(self._waiting) > PLACES:
            self._displace()
            self.raise_error(*_QUEUE_OVERRUN)

    def _displace(self) -> None:
        """Drop the oldest frame that a later one of the same code makes out of date."""
        codes = [code for code, _ in self._waiting]
        oldest = next(i for i, code in enumerate(codes) if code in codes[i + 1 :])
        del self._waiting[oldest]
        self.lost += 1

    @property
    def due_us(self) -> int | None:
        """Earliest instant of the next frame; None if none waits."""
        return self._not_before_us if self._waiting else None

    def poll(self, now_us: int, inhibit_100us: int = 0) -> bytes | None:
        """Return the payload to send now; None if none is due. Once the queue is empty, no loss is active."""
        if not self._waiting or now_us < self._not_before_us:
            return None
        self._not_before_us = now_us + inhibit_100us * _UNIT_US
        _, payload = self._waiting.popleft()
        if not self._waiting:
            self.resolve(lambda code, detail: (code, detail) == _QUEUE_OVERRUN)
        return payload

    def postpone(self, until_us: int) -> None:
        """Send no frame before an instant, because the CAN driver has no place for it."""
        self._not_before_us = max(self._not_before_us, until_us)
