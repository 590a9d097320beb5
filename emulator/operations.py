"""What happens to a machine beside its motion, as data: now, or at instants that are fixed beforehand."""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True, slots=True)
class EmergencyStop:
    """The e-stop button is pressed or pulled out; the input is the board's, all axes see it."""

    pressed: bool


@dataclass(frozen=True, slots=True)
class DriverProtect:
    """Somebody holds a driver's Protect pin low, as a chip that is too hot does itself, or lets it go."""

    axis: int
    active: bool


@dataclass(frozen=True, slots=True)
class Supply:
    """The motor supply's voltage in 10 mV."""

    supply_10mv: int


@dataclass(frozen=True, slots=True)
class BoardTemperature:
    """In 0.1 degC."""

    temperature_decidegc: int


Operation = EmergencyStop | DriverProtect | Supply | BoardTemperature


class Scheduled(NamedTuple):
    """An operation, its instant in counts since boot, and the number of the board to which it happens."""

    counts: int
    operation: Operation
    board: int = 0


class Schedule:
    """Operations in order of time; those of one instant in the order given."""

    def __init__(self, scheduled: Iterable[Scheduled] = ()) -> None:
        self._waiting = deque(sorted(scheduled, key=lambda item: item.counts))
        self.next_counts = self._waiting[0].counts if self._waiting else None
        """When the next one is due."""

    def take_due(self, now_counts: int) -> list[Scheduled]:
        """Hand out, once, what is due by now."""
        due = []
        while self._waiting and self._waiting[0].counts <= now_counts:
            due.append(self._waiting.popleft())
        self.next_counts = self._waiting[0].counts if self._waiting else None
        return due
