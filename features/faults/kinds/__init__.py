"""What may go wrong with an emulated machine, its bus and its host: one dataclass a harm, one module a family.

Harms are operations, and a schedule does operations at fixed instants.
"""

from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

from steptwin.features.faults.kinds.bus import BUS, Babble
from steptwin.features.faults.kinds.drivers import DRIVERS
from steptwin.features.faults.kinds.harm import Harm, Operation
from steptwin.features.faults.kinds.host import HOST
from steptwin.features.faults.kinds.limit_switches import SWITCHES
from steptwin.features.faults.kinds.machine import MACHINE
from steptwin.features.faults.kinds.wiring import WIRES
from steptwin.protocol.frame import Frame

HARMS: tuple[type[Harm], ...] = (*MACHINE, *SWITCHES, *DRIVERS, *WIRES, *BUS, *HOST)
"""Every harm for which a request asks, in the order of help and docs."""


class Scheduled(NamedTuple):
    """An operation, its instant in counts since boot, and the number of its board."""

    counts: int
    operation: Operation
    board: int = 0


class Consequence(Scheduled):
    """An operation that follows from an earlier one, not from a request."""


class Schedule:
    """Operations in order of time; those of one instant keep the order given."""

    def __init__(self, scheduled: Iterable[Scheduled] = ()) -> None:
        self._waiting: deque[Scheduled] = deque()
        self.next_counts: int | None = None
        """Instant of the next operation; None if there is none."""
        self.add(scheduled)

    def add(self, scheduled: Iterable[Scheduled]) -> None:
        """Add operations; one whose instant has passed is due at once."""
        self._waiting = deque(sorted((*self._waiting, *scheduled), key=lambda item: item.counts))
        self.next_counts = self._waiting[0].counts if self._waiting else None

    def end_babble(self, frame: Frame | None = None) -> None:
        """Forget the next times of babbles that have begun: those of one frame, or all."""

        def ends(item: Scheduled) -> bool:
            babble = item.operation
            return isinstance(item, Consequence) and isinstance(babble, Babble) and frame in (None, babble.frame)

        self._waiting = deque(item for item in self._waiting if not ends(item))
        self.next_counts = self._waiting[0].counts if self._waiting else None

    def take_due(self, now_counts: int) -> list[Scheduled]:
        """Return the operations that are due by now, and remove them."""
        due = []
        while self._waiting and self._waiting[0].counts <= now_counts:
            due.append(self._waiting.popleft())
        self.next_counts = self._waiting[0].counts if self._waiting else None
        return due
