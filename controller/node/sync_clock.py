"""Divide time into slots, one for each SYNC: from half a period before its due time to half a period after.

A set-point is used when the slot of its SYNC closes. So a SYNC may arrive at any time within its slot; a slot that
closes without SYNC counts as lost. The first SYNC defines the middle of the slots. Later the slots move only if the
mean of many SYNCs is outside of a dead band around the middle. So jitter has no effect, but the slots follow the drift
between the clocks of host and board. To move, each slot becomes slightly longer or shorter until they are in place.
"""

from typing import Final, NamedTuple

from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.protocol.timer import COUNTS_PER_US

TICK_US: Final = TICK_COUNTS // COUNTS_PER_US
WINDOW: Final = 128
"""Number of SYNCs in a mean. With uniform jitter of +-1/2 period, the mean has 1/40 period rms."""
_DEAD_BAND: Final = 8
"""Dead band of the mean: the slots stay while it is within 1/8 of a period from the middle."""
_SHIFT: Final = 512
"""A slot changes its length by 1/512 of a period, at least 1 us: enough for a drift of 500 ppm."""


class Slot(NamedTuple):
    """One cycle of the host, on the board's clock."""

    end_us: int
    phase_us: int
    """Time from the end of the first slot to its closing tick. Later set-points keep this delay exactly."""

    @property
    def close_tick(self) -> int:
        """Servo tick in which the slot closes: the first one that begins at or after its end."""
        return -(-self.end_us // TICK_US)

    @property
    def excess_us(self) -> int:
        """Delay of the closing: less than one tick in either direction; 0 until the slots move."""
        return self.close_tick * TICK_US - self.end_us - self.phase_us


class SyncClock:
    """The slots of one board. All axes that follow SYNC share them, so the axes stay synchronous."""

    def __init__(self) -> None:
        self.slot: Slot = Slot(0, 0)
        """The open slot."""
        self._period_us = 0
        self._users: set[int] = set()
        self._heard_us = 0
        self._offsets_us = 0
        self._heard = 0
        self._shift_us = 0
        """Remaining time by which the slots must move."""

    def join(self, axis: int, period_us: int, now_us: int) -> bool:
        """Let an axis follow from the present SYNC on; return False if other axes use another period."""
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
        """Remove an axis. When the last has left, the next one to join defines new slots."""
        self._users.discard(axis)

    def hear(self, now_us: int) -> int:
        """Process a SYNC, once for all axes; return 0 if it belongs to the open slot, 1 if to the next."""
        ahead = int(now_us >= self.slot.end_us)
        if now_us != self._heard_us:
            self._heard_us = now_us
            self._measure(now_us - self.slot.end_us + self._period_us // 2 - ahead * self._period_us)
        return ahead

    def after(self, slot: Slot) -> Slot:
        """Return the slot after a closing one. The first axis that calls opens it."""
        if slot == self.slot:
            step_us = max(1, self._period_us // _SHIFT)
            shift_us = min(max(self._shift_us, -step_us), step_us)
            self._shift_us -= shift_us
            self.slot = slot._replace(end_us=slot.end_us + self._period_us + shift_us)
        return self.slot

    def _measure(self, offset_us: int) -> None:
        """Add a SYNC's offset from the middle of its slot to the mean, unless the slots are moving."""
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
