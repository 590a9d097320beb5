"""The emergency producer: EMCY frames, error register and error history (CiA 301, section 7.2.7).

An error is a code with a detail. It is reported once, when it occurs, and stays active until it is resolved: the
register is what the active errors have in common. Each time errors go, "no error" is sent with the register that is
left (CiA 301 figure 51, transitions 3 and 4), so that a listener sees the bits fall one by one.
"""

from collections import deque
from collections.abc import Callable

from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.objects import HISTORY_DEPTH

_UNIT_US = 100
"""Object 0x1015 counts in 100 us."""


class EmergencyProducer:
    """Queues EMCY payloads, spaced by the inhibit time, and keeps the register and the history of the node."""

    def __init__(self) -> None:
        self.history: deque[int] = deque(maxlen=HISTORY_DEPTH)
        """Error codes, the newest first."""
        self.inhibit = 0
        self.register = 0
        """Object 0x1001: the bits of all errors that are active."""
        self._active: set[tuple[ErrorCode, int]] = set()
        self._waiting: deque[bytes] = deque()
        self._not_before_us = 0

    def is_active(self, code: ErrorCode) -> bool:
        """Whether an error with this code, whatever its detail, has occurred and is not resolved."""
        return any(active == code for active, _ in self._active)

    def raise_error(self, code: ErrorCode, detail: int = 0) -> None:
        """Report an error unless it is active already; `detail` goes into the manufacturer's five bytes."""
        if (code, detail) in self._active:
            return
        self._set_active(self._active | {(code, detail)})
        self.history.appendleft(code)
        self._waiting.append(self._payload(code, detail))

    def resolve(self, gone: Callable[[ErrorCode, int], bool]) -> None:
        """The active errors of which `gone` is true are no more: say so once, if there are any."""
        left = {(code, detail) for code, detail in self._active if not gone(code, detail)}
        if left != self._active:
            self._set_active(left)
            self._waiting.append(self._payload(ErrorCode.NONE, 0))

    def forget(self) -> None:
        """Be as after power-up: there has been no error."""
        self._set_active(set())
        self.history.clear()
        self._waiting.clear()

    def reset_communication(self) -> None:
        """The bus begins anew: its errors are no more, and what is still waiting is not sent."""
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
        """When the next frame may go; None if none waits."""
        return self._not_before_us if self._waiting else None

    def poll(self, now_us: int) -> bytes | None:
        """The payload to send now, if any."""
        if not self._waiting or now_us < self._not_before_us:
            return None
        self._not_before_us = now_us + self.inhibit * _UNIT_US
        return self._waiting.popleft()
