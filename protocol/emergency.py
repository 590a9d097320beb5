"""Produce emergencies: EMCY frames, error register and error history (CiA 301, section 7.2.7).

An error is a code with a detail. It is reported once, when it occurs, and stays active until it is resolved. The error
register holds the bits of all active errors. Each time errors are resolved, "no error" is sent with the register's
remaining bits (CiA 301 figure 51, transitions 3 and 4), so that a listener sees the bits fall one by one.
"""

from collections import deque
from collections.abc import Callable

from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.objects import HISTORY_DEPTH

_UNIT_US = 100
"""Unit of the inhibit time EMCY (1015h)."""


class EmergencyProducer:
    """Queues EMCY payloads, spaced by the inhibit time, and keeps the register and the history of the node."""

    def __init__(self) -> None:
        self.history: deque[int] = deque(maxlen=HISTORY_DEPTH)
        """Error codes of the last errors, the newest first."""
        self.inhibit = 0
        self.register = 0
        """Error register (1001h): the bits of all active errors."""
        self._active: set[tuple[ErrorCode, int]] = set()
        self._waiting: deque[bytes] = deque()
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
        self._waiting.append(self._payload(code, detail))

    def resolve(self, gone: Callable[[ErrorCode, int], bool]) -> None:
        """Clear the active errors for which `gone` is true; queue one frame if there are any."""
        left = {(code, detail) for code, detail in self._active if not gone(code, detail)}
        if left != self._active:
            self._set_active(left)
            self._waiting.append(self._payload(ErrorCode.NONE, 0))

    def forget(self) -> None:
        """Clear errors, history and queue, as at power-up."""
        self._set_active(set())
        self.history.clear()
        self._waiting.clear()

    def reset_communication(self) -> None:
        """Clear the communication errors and drop the frames that wait."""
        self._set_active({(code, detail) for code, detail in self._active if not code.communication})
        self._waiting.clear()

    def _set_active(self, active: set[tuple[ErrorCode, int]]) -> None:
        self._active = active
        self.register = 0
        for code, _ in active:
            self.register |= code.register

    def _payload(self, code: ErrorCode, detail: int) -> bytes:
        return code.to_bytes(2, "little") + bytes((self.register,)) + detail.to_bytes(5, "little")

    @property
    def due_us(self) -> int | None:
        """Instant from which the next frame may be sent; None if none waits."""
        return self._not_before_us if self._waiting else None

    def poll(self, now_us: int) -> bytes | None:
        """Return the payload to send now; None if none is due."""
        if not self._waiting or now_us < self._not_before_us:
            return None
        self._not_before_us = now_us + self.inhibit * _UNIT_US
        return self._waiting.popleft()
