"""Operations on a machine beside its motion, as data, and the schedule of those at fixed instants."""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from steptwin.protocol.cia402 import GENERAL_INPUTS, DigitalInput


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


@dataclass(frozen=True, slots=True)
class SetInput:
    """A sensor at one of an axis' general inputs (`GENERAL_INPUTS`) closes or opens; closed is active."""

    axis: int
    input: DigitalInput
    on: bool

    def __post_init__(self) -> None:
        if self.input not in GENERAL_INPUTS:
            raise ValueError(f"a general input is one of {', '.join(map(str, GENERAL_INPUTS))}, not {self.input!r}")


Operation = EmergencyStop | DriverProtect | Supply | BoardTemperature | SetInput


class Scheduled(NamedTuple):
    """An operation, its instant in counts since boot, and the number of its board."""

    counts: int
    operation: Operation
    board: int = 0


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

    def take_due(self, now_counts: int) -> list[Scheduled]:
        """Return the operations that are due by now, and remove them."""
        due = []
        while self._waiting and self._waiting[0].counts <= now_counts:
            due.append(self._waiting.popleft())
        self.next_counts = self._waiting[0].counts if self._waiting else None
        return due
