"""Requests to the machine: commands, held buttons and stops, and the one client that may ask for them."""

from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import ClassVar, NamedTuple

from steptwin.host.operate.session import Session
from steptwin.host.panel.desk.history import EventLog
from steptwin.host.panel.desk.jogs import Press, Presses
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


class Operator(NamedTuple):
    """The client that operates the machine, and its user's name."""

    client: str
    name: str


class Operators:
    """The lease of the operator; may be used from any thread. A client is any text that names a page."""

    def __init__(self, events: EventLog, changed: Callable[[], None]) -> None:
        """Begin without an operator; `changed` is called when another client has the lease, or none."""
        self._events = events
        self._changed = changed
        self._holder: Operator | None = None
        self._lock = Lock()

    @property
    def holder(self) -> Operator | None:
        """The operator; None if there is none."""
        return self._holder

    def is_operator(self, client: str) -> bool:
        """Return whether a client operates the machine."""
        holder = self._holder
        return holder is not None and holder.client == client

    def require(self, client: str) -> None:
        """Raise RefusedError unless a client operates the machine."""
        holder = self._holder
        if holder is None:
            raise RefusedError("nobody operates the machine: take the operator's place first")
        if holder.client != client:
            raise RefusedError(f"{holder.name} operates the machine: ask, or take over")

    def take(self, client: str, name: str) -> None:
        """Operate the machine; raise RefusedError if another client does."""
        with self._lock:
            holder = self._holder
            if holder is not None and holder.client != client:
                raise RefusedError(f"{holder.name} operates the machine: ask, or take over")
            self._holder = Operator(client, name)
        if holder is None:
            self._changed()
            self._events.info(f"{name} operates the machine")

    def take_over(self, client: str, name: str) -> None:
        """Operate the machine, even if another client does; a jog of the former operator ends."""
        with self._lock:
            former, self._holder = self._holder, Operator(client, name)
        if former is None:
            self._changed()
            self._events.info(f"{name} operates the machine")
        elif former.client != client:
            self._changed()
            self._events.warning(f"{name} takes over from {former.name}")

    def give_up(self, client: str) -> None:
        """Stop operating the machine, as when a page is closed; a jog ends. Nothing happens to another's lease."""
        with self._lock:
            former = self._holder
            if former is None or former.client != client:
                return
            self._holder = None
        self._changed()
        self._events.info(f"{former.name} no longer operates the machine")


class Requests:
    """Everything that is asked of the machine; any thread asks, the worker takes one thing at a time.

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
