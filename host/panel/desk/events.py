"""The log of what has happened, in words; it stays until a user clears it."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from threading import Lock
from typing import Final

EVENTS_MAX: Final = 2000
"""Number of events that are kept; the oldest go first, so that memory is bounded."""


class Severity(StrEnum):
    """How much an event matters."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True, slots=True)
class Event:
    """Something that has happened.

    Attributes:
        number: counts up from 1 and is never used again.
        wall_s: when it happened, in seconds since 1970.
        severity: how much it matters.
        text: what happened, in one line.
    """

    number: int
    wall_s: float
    severity: Severity
    text: str


class EventLog:
    """Events in their order; may be used from any thread."""

    def __init__(self, wall_s: Callable[[], float] = time.time) -> None:
        self._wall_s = wall_s
        self._events: deque[Event] = deque(maxlen=EVENTS_MAX)
        self._count = 0
        self._lock = Lock()

    def add(self, severity: Severity, text: str) -> None:
        """Add an event that happens now."""
        with self._lock:
            self._count += 1
            self._events.append(Event(self._count, self._wall_s(), severity, text))

    def info(self, text: str) -> None:
        """Add what was to be expected."""
        self.add(Severity.INFO, text)

    def warning(self, text: str) -> None:
        """Add what a user should look at."""
        self.add(Severity.WARNING, text)

    def error(self, text: str) -> None:
        """Add what has failed."""
        self.add(Severity.ERROR, text)

    def since(self, number: int = 0) -> tuple[Event, ...]:
        """Return the events after the one with this number."""
        with self._lock:
            return tuple(event for event in self._events if event.number > number)

    @property
    def span(self) -> tuple[int, int] | None:
        """The numbers of the first and the last event; None without any."""
        with self._lock:
            return (self._events[0].number, self._events[-1].number) if self._events else None

    def clear(self) -> None:
        """Forget all events so far."""
        with self._lock:
            self._events.clear()
