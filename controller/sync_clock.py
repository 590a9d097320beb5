"""The host's cycle as the board sees it: a slot for each SYNC, from half a period before it is due to half one after.

What came with a SYNC is used when its slot has closed. So it does not matter when it came in its slot, and a slot that
closes without one has lost its SYNC. The first SYNC sets the middle of the slots. After that only the mean of many
SYNCs moves them, and only if that is far from the middle: jitter does nothing, the drift of one clock against the other
is followed. The slots then grow or shrink by a little each until they are in place.
"""

from typing import NamedTuple

from steptwin.controller.kernel import TICK_COUNTS
from steptwin.protocol.timer import COUNTS_PER_US

TICK_US = TICK_COUNTS // COUNTS_PER_US
WINDOW = 128
"""So many SYNCs make a mean. Jitter that is uniform in half a period either way has one of 1/40 period (rms)."""
_DEAD_BAND = 8
"""The mean is in place within so many parts of a period either way."""
_SHIFT = 512
"""A slot grows or shrinks by one of so many parts of a period, and by 1 us at least: drift of 500 ppm is followed."""


class Slot(NamedTuple):
    """One cycle of the host, on the board's clock."""

    end_us: int
    phase_us: int
    """How long after its end the first of all slots closed: set-points keep that delay, to the microsecond."""

    @property
    def close_tick(self) -> int:
        """The first servo tick that does not begin before the end: from then on the slot's SYNC may be used."""
        return -(-self.end_us // TICK_US)

    @property
    def excess_us(self) -> int:
        """By how much later it closes than it should: less than a tick either way, 0 before slots are moved."""
        return self.close_tick * TICK_US - self.end_us - self.phase_us


class SyncClock:
    """The slots of one board, which all axes that follow SYNC have in common: that keeps them in step."""

    def __init__(self) -> None:
        self.slot = Slot(0, 0)
        """The one that is open."""
        self._period_us = 0
        self._users: set[int] = set()
        self._heard_us = 0
        self._offsets_us = 0
        self._heard = 0
        self._shift_us = 0
        """By how much the slots are still to be moved."""

    def join(self, axis: int, period_us: int, now_us: int) -> bool:
        """An axis follows the SYNCs from the one on that has come now; False if others do with another period."""
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
        """An axis does not follow any more. Without any the next one to join begins anew."""
        self._users.discard(axis)

    def hear(self, now_us: int) -> int:
        """A SYNC has come: 0 if it belongs to the open slot, 1 if it is the next one's. Each axis may tell of it."""
        ahead = int(now_us >= self.slot.end_us)
        if now_us != self._heard_us:
            self._heard_us = now_us
            self._measure(now_us - self.slot.end_us + self._period_us // 2 - ahead * self._period_us)
        return ahead

    def after(self, slot: Slot) -> Slot:
        """The slot that follows on one which closes; the first axis that asks for it opens it."""
        if slot == self.slot:
            step_us = max(1, self._period_us // _SHIFT)
            shift_us = min(max(self._shift_us, -step_us), step_us)
            self._shift_us -= shift_us
            self.slot = slot._replace(end_us=slot.end_us + self._period_us + shift_us)
        return self.slot

    def _measure(self, offset_us: int) -> None:
        """Take in by how much a SYNC came after the middle of its slot; while the slots are moved it says little."""
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
