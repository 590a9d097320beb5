"""Operations on machines and the bus, and the schedule of their execution.

Features define further operations as subclasses.
"""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

from steptwin.protocol.cia402 import GENERAL_INPUTS, DigitalInput

if TYPE_CHECKING:
    from steptwin.emulator.board.board import Board
    from steptwin.emulator.simulation import Simulation


@dataclass(frozen=True, slots=True)
class Operation(ABC):
    """An operation on the boards of a simulation, or on their bus, at an instant."""

    once: ClassVar[bool] = False
    """True if it is executed once for the whole machine; False if on every board, or on the board of its axis."""

    @property
    def place(self) -> int | None:
        """Number of the axis on which it acts; None if it acts on no single axis."""
        axis: int | None = getattr(self, "axis", None)
        return axis

    def at(self, axis: int) -> Self:
        """Return the same operation for another axis."""
        moved: Any = self
        same: Self = replace(moved, axis=axis)
        return same

    def check(self, simulation: "Simulation", number: int) -> None:
        """Raise an error if the machine lacks the operation's target; the default accepts every machine."""

    @abstractmethod
    def apply(self, simulation: "Simulation", number: int) -> None:
        """Execute it now; `number` is the number of the board, if it acts on a board."""


@dataclass(frozen=True, slots=True)
class BoardOperation(Operation):
    """An operation on one board."""

    def apply(self, simulation: "Simulation", number: int) -> None:
        """Execute it now, on the board of this number."""
        simulation.boards[number].operate(self, simulation.now_counts)

    @abstractmethod
    def apply_to(self, board: "Board", now_counts: int) -> None:
        """Execute it on a board; the firmware reads inputs with the next tick, measured values at once."""


@dataclass(frozen=True, slots=True)
class AxisOperation(BoardOperation):
    """An operation at the connector of one axis."""

    axis: int


@dataclass(frozen=True, slots=True)
class InputOperation(AxisOperation):
    """Close or open a sensor at one of an axis' general inputs (`GENERAL_INPUTS`); closed is active."""

    input: DigitalInput
    on: bool

    def __post_init__(self) -> None:
        if self.input not in GENERAL_INPUTS:
            raise ValueError(f"a general input is one of {', '.join(map(str, GENERAL_INPUTS))}, not {self.input!r}")

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        """Close or open the sensor."""
        board.inputs.set_general(self.axis, self.input, on=self.on)


@dataclass(frozen=True, slots=True)
class BoardStart(Operation):
    """Start a board that is down, unless it must stay down longer; a running board is not changed."""

    def apply(self, simulation: "Simulation", number: int) -> None:
        """Start the firmware."""
        simulation.start(number)


class Scheduled(NamedTuple):
    """A scheduled operation: instant in counts since boot, operation, number of its board."""

    counts: int
    operation: Operation
    board: int = 0


class Consequence(Scheduled):
    """A scheduled operation that an earlier operation has caused."""


class Schedule:
    """Operations in order of time; those of one instant keep their order."""

    def __init__(self, scheduled: Iterable[Scheduled] = ()) -> None:
        self._waiting: deque[Scheduled] = deque()
        self.next_counts: int | None = None
        """Instant of the next operation; None if there is none."""
        self.add(scheduled)

    def add(self, scheduled: Iterable[Scheduled]) -> None:
        """Add operations; one whose instant is in the past is due at once."""
        self._waiting = deque(sorted((*self._waiting, *scheduled), key=lambda item: item.counts))
        self._find_next()

    def cancel(self, which: Callable[[Operation], bool]) -> None:
        """Remove the consequences for whose operation `which` is true."""
        self._waiting = deque(
            item for item in self._waiting if not (isinstance(item, Consequence) and which(item.operation))
        )
        self._find_next()

    def take_due(self, now_counts: int) -> list[Scheduled]:
        """Remove and return the operations that are due."""
        due = []
        while self._waiting and self._waiting[0].counts <= now_counts:
            due.append(self._waiting.popleft())
        self._find_next()
        return due

    def _find_next(self) -> None:
        self.next_counts = self._waiting[0].counts if self._waiting else None
