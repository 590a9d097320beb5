"""What an operator asks of the machine, and who may ask: the one client that operates it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import ClassVar, NamedTuple

from steptwin.features.panel.desk.history import EventLog
from steptwin.features.panel.desk.results import RunResults
from steptwin.features.panel.desk.settings import MachineSettings
from steptwin.features.panel.desk.words import RefusedError
from steptwin.host.client import Progress
from steptwin.host.operate.session import Session


@dataclass(frozen=True, slots=True)
class Request:
    """A command or a jog: checked in the thread that asks for it, performed in the worker's.

    Positions and distances are in mm and degrees, parts of the highest speeds in percent.
    """

    named: ClassVar[str]
    """Its title in a few words, in which {0} is the request."""
    needs_drives: ClassVar[bool] = True
    """True if it needs the drives: none in fault, no emergency stop."""
    needs_homed: ClassVar[bool] = False
    """True if every joint must know its position."""
    jogs: ClassVar[bool] = False
    """True if it lasts as long as a button is held."""

    @property
    def title(self) -> str:
        """Its name in a few words."""
        return self.named.format(self)

    def check(self, limits: MachineSettings, standing: Sequence[float]) -> None:
        """Raise InputError for a request that is wrong, or impossible from where the joints stand."""


class Work(NamedTuple):
    """The work of carrying out a command.

    Attributes:
        session: the machine.
        limits: the robot's limits and all settings, which a command may change.
        events: what has happened.
        runs: the runs that have ended.
        progress: call it with the part that is done.
        seen_s: when the machine was as the operator saw it, on the clock of `time.monotonic`.
    """

    session: Session
    limits: MachineSettings
    events: EventLog
    runs: RunResults
    progress: Progress
    seen_s: float


@dataclass(frozen=True, slots=True)
class Command(Request):
    """A request that has an end of its own."""

    changes_settings: ClassVar[bool] = False
    """True if settings must be read again after it."""

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

    def take(self, client: str, name: str, *, over: bool = False) -> None:
        """Operate the machine; a jog of the former operator ends.

        Raise RefusedError if another client operates it, unless its place is taken over.
        """
        with self._lock:
            former = self._holder
            if former is not None and not over:
                self.require(client)
            self._holder = Operator(client, name)
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
