"""The time of day that TIME messages bring (CiA 301, section 7.2.6); it goes on by the board's clock."""

from typing import Final

from steptwin.controller.node.axis_context import AxisContext
from steptwin.protocol import od

_DAY_MS: Final = 86_400_000
_TIME_BYTES: Final = 6
_MS_MASK: Final = (1 << 28) - 1
"""The upper four bits of the time are reserved."""


class TimeOfDay:
    """The date and the time (2019h) since the last TIME; both are 0 before the first one."""

    def __init__(self, context: AxisContext) -> None:
        self._context = context
        self._zero_us: int | None = None
        """Instant of the board's clock at the beginning of 1984-01-01; None before the first TIME."""
        context.dictionary.bind(self)

    def receive(self, data: bytes) -> None:
        """Set date and time by a TIME message; ignore one of wrong length, and each if 1012h:00 does not use TIME."""
        if len(data) != _TIME_BYTES or not self._context.dictionary.get(od.TIME_COB_ID) & od.CONSUMES_TIME:
            return
        ms = int.from_bytes(data[:4], "little") & _MS_MASK
        days = int.from_bytes(data[4:], "little")
        self._zero_us = self._context.now_us - 1000 * (days * _DAY_MS + ms)

    def _passed_ms(self) -> int:
        return 0 if self._zero_us is None else (self._context.now_us - self._zero_us) // 1000

    def days(self) -> int:
        """Return the days since 1984-01-01."""
        return self._passed_ms() // _DAY_MS

    def ms(self) -> int:
        """Return the milliseconds since midnight."""
        return self._passed_ms() % _DAY_MS
