"""The emergency producer: EMCY frames, error register and error history (CiA 301, section 7.2.7)."""

from collections import deque

from protocol.cia402 import ErrorCode
from protocol.objects import HISTORY_DEPTH

_UNIT_US = 100
"""Object 0x1015 counts in 100 us."""


class EmergencyProducer:
    """Queues EMCY payloads, spaced by the inhibit time, and keeps the register and the history of the node."""

    def __init__(self) -> None:
        self.register = 0
        self.history: deque[int] = deque(maxlen=HISTORY_DEPTH)
        """Error codes, the newest first."""
        self.inhibit = 0
        self._waiting: deque[bytes] = deque()
        self._not_before_us = 0

    def raise_error(self, code: ErrorCode, detail: int = 0) -> None:
        """Report an error; `detail` goes into the manufacturer's five bytes."""
        self.register |= code.register
        self.history.appendleft(code)
        self._waiting.append(self._payload(code, detail))

    def clear(self) -> None:
        """All errors are gone: report "no error" if there was one."""
        if self.register:
            self.register = 0
            self._waiting.append(self._payload(ErrorCode.NONE, 0))

    def forget(self) -> None:
        """Be as after power-up: there has been no error."""
        self.register = 0
        self.history.clear()
        self.drop_waiting()

    def drop_waiting(self) -> None:
        """Send nothing of what is still waiting, as after a communication reset."""
        self._waiting.clear()

    def _payload(self, code: ErrorCode, detail: int) -> bytes:
        return code.to_bytes(2, "little") + bytes((self.register,)) + detail.to_bytes(5, "little")

    @property
    def due_us(self) -> int | None:
        """When the next frame may go; None if none waits."""
        return self._not_before_us if self._waiting else None

    def poll(self, now_us: int) -> bytes | None:
        """The payload to send now, if any."""
        if not self._waiting or now_us < self._not_before_us:
            return None
        self._not_before_us = now_us + self.inhibit * _UNIT_US
        return self._waiting.popleft()
