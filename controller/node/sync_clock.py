"""Divide time into slots, one for each SYNC: from half a period before the SYNC is due to half a period after.

A set-point is used when the slot of its SYNC has closed. So the SYNC may come at any time within its slot, and a slot
that closes without a SYNC has lost it. The first SYNC sets the middle of the slots. After that only the mean of many
SYNCs moves them, and only if it is far from the middle: so jitter has no effect, while the drift of one clock against
the other is followed. To move, the slots grow or shrink by a little each until they are in place.
"""

from typing import Final, NamedTuple

from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.protocol.timer import COUNTS_PER_US

TICK_US: Final = TICK_COUNTS // COUNTS_PER_US
WINDOW: Final = 128
"""Number of SYNCs in a mean. Jitter uniform over half a period either way gives a mean of 1/40 period (rms)."""
_DEAD_BAND: Final = 8
"""The slots stay while the mean is within 1/8 of a period from the middle."""
_SHIFT: Final = 512
"""A slot grows or shrinks by 1/512 of a period, and by at least 1 us: so drift of 500 ppm is followed."""


class Slot(NamedTuple):
    """One cycle of the host, on the board's clock."""

    end_us: int
    phase_us: int
    """Time from the end of the very first slot to its closing. Set-points keep that delay, to the microsecond."""

    @property
    def close_tick(self) -> int:
        """The first servo tick that begins at or after the end: the slot closes then."""
        return -(-self.end_us // TICK_US)

    @property
    def excess_us(self) -> int:
        """Delay of the closing: less than a tick either way, 0 until slots are moved."""
        return self.close_tick * TICK_US - self.end_us - self.phase_us


class SyncClock:
    """The slots of one board. All axes that follow SYNC share them, which keeps the axes in step."""

    def __init__(self) -> None:
        self.slot: Slot = Slot(0, 0)
        """The open slot."""
        self._period_us = 0
        self._users: set[int] = set()
        self._heard_us = 0
        self._offsets_us = 0
        self._heard = 0
        self._shift_us = 0
        """Time that the slots must still be moved by."""

    def join(self, axis: int, period_us: int, now_us: int) -> bool:
        """Let an axis follow from the SYNC received now; return False if other axes follow with another period."""
        if not self._users:
            self._period_us = period_us
            end_us = now_us + period_us // 2
            self.slot = Slot(end_us, -end_us % TICK_US)
            self._shift_us = 0
            self._restart_mean()
        if period_us == self._period_us:
            self._users.add(axis)
        return axis in self._users

    def leave(self, axis: int) -> None:
        """Let an axis follow no more. After the last has left, the next to join sets new slots."""
        self._users.discard(axis)

    def hear(self, now_us: int) -> int:
        """Note a SYNC, once for all axes; return 0 if it belongs to the open slot, 1 if to the next."""
        ahead = int(now_us >= self.slot.end_us)
        if now_us != self._heard_us:
            self._heard_us = now_us
            self._measure(now_us - self.slot.end_us + self._period_us // 2 - ahead * self._period_us)
        return ahead

    def after(self, slot: Slot) -> Slot:
        """Return the slot that follows one that closes. The first axis to call opens it."""
        if slot == self.slot:
            step_us = max(1, self._period_us // _SHIFT)
            shift_us = min(max(self._shift_us, -step_us), step_us)
            self._shift_us -= shift_us
            self.slot = slot._replace(end_us=slot.end_us + self._period_us + shift_us)
        return self.slot

    def _measure(self, offset_us: int) -> None:
        """Add a SYNC's offset from the middle of its slot to the mean, unless the slots are being moved."""
        if self._shift_us:
            return
        self._offsets_us += offset_us
        self._heard += 1
        if self._heard == WINDOW:
            if abs(self._offsets_us) * _DEAD_BAND > self._period_us * WINDOW:
                self._shift_us = self._offsets_us // WINDOW
            self._restart_mean()

    def _restart_mean(self) -> None:
        self._offsets_us = self._heard = 0
