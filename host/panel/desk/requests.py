"""What is asked of the machine: commands, held buttons and stops; who may ask, and from which states he has seen."""

from dataclasses import dataclass
from threading import Lock
from typing import ClassVar, NamedTuple

from steptwin.host.operate.session import Session
from steptwin.host.panel.desk.jogs import Press, Presses
from steptwin.host.panel.desk.operators import Operators
from steptwin.host.panel.desk.state import DeskState
from steptwin.host.panel.desk.stops import ShownStates, StopRequests
from steptwin.host.panel.desk.words import RefusedError, busy


class Work(NamedTuple):
    """The work of carrying out a command.

    Attributes:
        session: the machine.
        state: the desk's; a command may change its limits.
        title: the command's.
        seen_s: when the machine was as the operator saw it, on the clock of `time.monotonic`.
    """

    session: Session
    state: DeskState
    title: str
    seen_s: float

    def progress(self, fraction: float) -> None:
        """Say which part is done."""
        self.state.begin(self.title, fraction)


@dataclass(frozen=True, slots=True)
class Command:
    """A command of the operator: checked in the thread that asks for it, performed in the worker's.

    Positions and distances are in mm and degrees, parts of the highest speeds in percent.
    """

    needs_drives: ClassVar[bool] = True
    """True if it needs the drives: none in fault, no emergency stop."""
    needs_homed: ClassVar[bool] = False
    """True if every joint must know its position."""
    changes_settings: ClassVar[bool] = False
    """True if settings must be read again after it."""

    @property
    def title(self) -> str:
        """Its name in a few words."""
        raise NotImplementedError

    def check(self, state: DeskState) -> None:
        """Raise InputError for a command that is wrong, or impossible from where the machine stands."""

    def perform(self, work: Work) -> str:
        """Carry the command out; return in one line what has come of it, an empty text for nothing."""
        raise NotImplementedError


class Order(NamedTuple):
    """A command, and the number of the newest state that its page had shown."""

    command: Command
    shown: int


class Requests:
    """What is asked of the machine; any thread asks, the worker takes one thing at a time.

    Attributes:
        operators: who may move the machine.
        shown: the states from which commands may be asked for.
        presses: the jog button that is held.
        stops: the stop that is asked for.
    """

    def __init__(self, state: DeskState) -> None:
        self.operators = Operators(state.events, self._change_operator)
        self.shown = ShownStates()
        self.presses = Presses()
        self.stops = StopRequests()
        self._state = state
        self._order: Order | None = None
        self._lock = Lock()

    def _change_operator(self) -> None:
        self.shown.void("the operator changed")
        self.presses.end("another client operates the machine")

    def ask(self, order: Order) -> None:
        """Let a command wait for the worker; raise RefusedError if the worker is busy."""
        title = order.command.title
        with self._lock:
            if self._state.activity is not None:
                raise RefusedError(busy(title, self._state.activity.name))
            self._order = order
            self._state.begin(title, 0.0)

    def take(self) -> Order | Press | None:
        """Return the command that waits, else the press that is held, else None."""
        with self._lock:
            order, self._order = self._order, None
            if order is not None:
                return order
            press = self.presses.serve()
            if press is not None:
                self._state.begin(press.jog.title, None)
            return press

    def drop(self) -> None:
        """Drop a command that waits; one that is carried out goes on."""
        with self._lock:
            if self._order is not None:
                self._order = None
                self._state.end()
