"""Who may move the machine: one client at a time operates, the others watch and may stop."""

from collections.abc import Callable
from threading import Lock
from typing import NamedTuple

from steptwin.host.panel.desk.events import EventLog
from steptwin.host.panel.desk.words import RefusedError


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
        """Operate the machine, whoever does; a jog of the former operator ends."""
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
