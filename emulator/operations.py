"""Describe what is done to machines beside their bus: operations, and the instants when they are due.

Features have operations of their own: each is a subclass that says how it is done.
"""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

from steptwin.protocol.cia402 import GENERAL_INPUTS, DigitalInput

if TYPE_CHECKING:
    from steptwin.emulator.board.board import Board
    from steptwin.emulator.simulation import Simulation


@dataclass(frozen=True, slots=True)
class Operation:
    """Something that is done to the boards of a simulation, or to their bus, at an instant."""

    once: ClassVar[bool] = False
    """True if it is done once for the whole machine, else on every board, or on that of its axis."""

    @property
    def place(self) -> int | None:
        """Number of the axis that it names; None if it names none."""
        axis: int | None = getattr(self, "axis", None)
        return axis

    def at(self, axis: int) -> Self:
        """Return the same at another axis."""
        moved: Any = self
        same: Self = replace(moved, axis=axis)
        return same

    def check(self, simulation: "Simulation", number: int) -> None:
        """Raise an error unless the machine has what it concerns; by default it always has."""

    def apply(self, simulation: "Simulation", number: int) -> None:
        """Do it now; `number` is that of the board, for one that is done to a board."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class BoardOperation(Operation):
    """An operation on the machine of one board."""

    def apply(self, simulation: "Simulation", number: int) -> None:
        """Do it now, on the board of this number."""
        simulation.boards[number].operate(self, simulation.now_counts)

    def apply_to(self, board: "Board", now_counts: int) -> None:
        """Do it to a board; the firmware sees inputs with the next tick, measured values at once."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class AxisOperation(BoardOperation):
    """An operation at the connector of one axis."""

    axis: int


@dataclass(frozen=True, slots=True)
class InputOperation(AxisOperation):
    """A sensor at one of an axis' general inputs (`GENERAL_INPUTS`) closes or opens; closed is active."""

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
    """A board that is down starts again, unless it is to stay so; nothing happens to one that runs."""

    def apply(self, simulation: "Simulation", number: int) -> None:
        """Let the firmware begin."""
        simulation.start(number)


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
        self._find_next()

    def cancel(self, which: Callable[[Operation], bool]) -> None:
        """Forget the consequences whose operation is one of these."""
        self._waiting = deque(
            item for item in self._waiting if not (isinstance(item, Consequence) and which(item.operation))
        )
        self._find_next()

    def take_due(self, now_counts: int) -> list[Scheduled]:
        """Return the operations that are due by now, and remove them."""
        due = []
        while self._waiting and self._waiting[0].counts <= now_counts:
            due.append(self._waiting.popleft())
        self._find_next()
        return due

    def _find_next(self) -> None:
        self.next_counts = self._waiting[0].counts if self._waiting else None
