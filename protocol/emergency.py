"""Produce emergencies: EMCY frames, error register and error history (CiA 301, section 7.2.7).

An error is a code with a detail. It is reported once, when it occurs, and stays active until it is resolved. The error
register holds the bits of all active errors. Each time errors are resolved, "no error" is sent with the register's
remaining bits (CiA 301 figure 51, transitions 3 and 4).

The inhibit time makes frames wait in a queue, which has one place for each code. If it is full, the oldest frame that
has a later one of the same code is dropped. So the last frame of each code, with the present register, is always sent.
The loss of frames is an error of its own until the queue is empty.
"""

from collections import deque
from collections.abc import Callable
from typing import Final

from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, Overrun
from steptwin.protocol.od import HISTORY_DEPTH
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

PLACES: Final = len(ErrorCode)
"""Length of the queue: one place for each code, "no error" included. With more frames, two have the same code."""
_QUEUE_OVERRUN = (ErrorCode.CAN_OVERRUN, Overrun.EMCY_QUEUE)
_UNIT_US = 100
"""Unit of the inhibit time EMCY (1015h)."""


class EmergencyProducer:
    """Queues EMCY payloads, spaced by the inhibit time, and holds the node's error register and history."""

    def __init__(self) -> None:
        self.history: deque[int] = deque(maxlen=HISTORY_DEPTH)
        """Codes of the last errors, newest first."""
        self.register: int = 0
        """Error register (1001h): the bits of all active errors."""
        self.lost: int = 0
        """Number of frames dropped from the full queue."""
        self._active: set[tuple[ErrorCode, int]] = set()
        self._waiting: deque[tuple[ErrorCode, bytes]] = deque()
        self._not_before_us = 0

    def is_active(self, code: ErrorCode) -> bool:
        """Return whether an error with this code is active, with any detail."""
        return any(active == code for active, _ in self._active)

    def raise_error(self, code: ErrorCode, detail: int = 0) -> None:
        """Report an error unless it is active; `detail` fills the five manufacturer-specific bytes."""
        if (code, detail) in self._active:
            return
        self._set_active(self._active | {(code, detail)})
        self.history.appendleft(code)
        self._queue(code, detail)

    def resolve(self, gone: Callable[[ErrorCode, int], bool]) -> None:
        """Clear the active errors for which `gone` is true; queue one frame if there are any."""
        left = {(code, detail) for code, detail in self._active if not gone(code, detail)}
        if left != self._active:
            self._set_active(left)
            self._queue(ErrorCode.NONE, 0)

    @property
    def history_length(self) -> int:
        """Number of errors in the history."""
        return len(self.history)

    def history_at(self, address: int) -> int:
        """Return the error code in an entry of the history (1003h).

        Raises:
            SdoAbortError: the entry is empty (CiA 301, section 7.5.2.4).
        """
        i = od.ERROR_HISTORY.index(address)
        if i >= len(self.history):
            raise SdoAbortError(AbortCode.NO_DATA)
        return self.history[i]

    def clear_history(self, _value: int = 0) -> None:
        """Empty the error history."""
        self.history.clear()

    def forget(self) -> None:
        """Clear active errors, history, queue and counter, as at power-up."""
        self._set_active(set())
        self.clear_history()
        self._waiting.clear()
        self.lost = 0

    def reset_communication(self) -> None:
        """Clear the communication errors and the queue."""
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
            codes = [waiting for waiting, _ in self._waiting]
            out_of_date = next(i for i, each in enumerate(codes) if each in codes[i + 1 :])
            del self._waiting[out_of_date]
            self.lost += 1
            self.raise_error(*_QUEUE_OVERRUN)

    @property
    def due_us(self) -> int | None:
        """Earliest instant of the next frame; None if none waits."""
        return self._not_before_us if self._waiting else None

    def poll(self, now_us: int, inhibit_100us: int = 0) -> bytes | None:
        """Return the payload to send now; None if none is due. An empty queue resolves the error "EMCY lost"."""
        if not self._waiting or now_us < self._not_before_us:
            return None
        self._not_before_us = now_us + inhibit_100us * _UNIT_US
        _, payload = self._waiting.popleft()
        if not self._waiting:
            self.resolve(lambda code, detail: (code, detail) == _QUEUE_OVERRUN)
        return payload

    def postpone(self, until_us: int) -> None:
        """Send no frame before `until_us`, because the CAN driver's queue is full."""
        self._not_before_us = max(self._not_before_us, until_us)
