"""Operations on a machine beside its motion, as data, and the schedule of those at fixed instants."""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True, slots=True)
class EmergencyStop:
    """The emergency stop button is pressed or pulled out; all axes of the board see it."""

    pressed: bool


@dataclass(frozen=True, slots=True)
class DriverProtect:
    """A driver's Protect pin is held low from outside, as a chip in thermal shutdown does itself, or released."""

    axis: int
    active: bool


@dataclass(frozen=True, slots=True)
class Supply:
    """The motor supply gets this voltage, in 10 mV."""

    supply_10mv: int


@dataclass(frozen=True, slots=True)
class BoardTemperature:
    """The board gets this temperature, in 0.1 degC."""

    temperature_decidegc: int


Operation = EmergencyStop | DriverProtect | Supply | BoardTemperature


class Scheduled(NamedTuple):
    """An operation, its instant in counts since boot, and the number of its board."""

    counts: int
    operation: Operation
    board: int = 0


class Schedule:
    """Operations in order of time; those of one instant keep the order given."""

    def __init__(self, scheduled: Iterable[Scheduled] = ()) -> None:
        self._waiting = deque(sorted(scheduled, key=lambda item: item.counts))
        self.next_counts = self._waiting[0].counts if self._waiting else None
        """Instant of the next operation; None if there is none."""

    def take_due(self, now_counts: int) -> list[Scheduled]:
        """Return the operations that are due by now, and remove them."""
        due = []
        while self._waiting and self._waiting[0].counts <= now_counts:
            due.append(self._waiting.popleft())
        self.next_counts = self._waiting[0].counts if self._waiting else None
        return due
