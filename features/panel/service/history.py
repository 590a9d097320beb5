"""The past: events in words, the last minutes of every joint, the planned path and the tool's trace."""

import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from threading import Lock
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray

EVENTS_MAX: Final = 2000
"""Number of events that are kept; the oldest go first, so that memory is bounded."""


class Severity(StrEnum):
    """Weight of an event."""

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


TRACE_POINTS: Final = 4000
"""Number of points of the trace that are kept; the oldest go first, so that memory is bounded."""
TRACE_STEP_MM: Final = 0.5
"""Least distance of two points of the trace: less than a pixel."""
_NOTHING: Final = np.empty((0, 3))


class Drawing:
    """The planned path and the tool's trace, in mm; may be used from any thread."""

    def __init__(self) -> None:
        self._path_mm: FloatArray = _NOTHING
        self._trace_mm: deque[tuple[float, ...]] = deque(maxlen=TRACE_POINTS)
        self._paths = self._traces = 0
        self._lock = Lock()

    @property
    def version(self) -> tuple[int, int]:
        """Number of changes of the path and of clearings of the trace: pages draw anew what has another number."""
        return self._paths, self._traces

    @property
    def path_mm(self) -> FloatArray:
        """The path of the motion that was looked at or run last, shape (n, 3); empty without one."""
        return self._path_mm

    @property
    def trace_mm(self) -> FloatArray:
        """Places of the tool since the trace was cleared, shape (n, 3)."""
        with self._lock:
            return np.array(self._trace_mm) if self._trace_mm else _NOTHING

    def show_path(self, path_mm: FloatArray) -> None:
        """Show a planned path, shape (n, 3)."""
        with self._lock:
            self._path_mm = path_mm
            self._paths += 1

    def clear_path(self) -> None:
        """Show no path."""
        self.show_path(_NOTHING)

    def follow(self, pose: Mapping[str, float] | None) -> None:
        """Lengthen the trace to the tool's pose, unless this is unknown or hardly away from the trace's end."""
        if pose is None:
            return
        point = tuple(pose[key] for key in ("x_mm", "y_mm", "z_mm"))
        with self._lock:
            if not self._trace_mm or np.linalg.norm(np.subtract(point, self._trace_mm[-1])) >= TRACE_STEP_MM:
                self._trace_mm.append(point)

    def clear_trace(self) -> None:
        """Forget where the tool was."""
        with self._lock:
            self._trace_mm.clear()
            self._traces += 1


HISTORY_SAMPLES: Final = 12_000
"""Samples that are kept: five minutes at 40 a second."""


@dataclass(frozen=True, slots=True, eq=False)
class HistorySamples:
    """Samples in order of time.

    Attributes:
        t_s: shape (n,), on the clock of `time.monotonic`.
        positions: shape (n, joints), in mm and degrees.
        rates: shape (n, joints), in mm/s and deg/s; NaN where the board did not report it.
        following_errors: shape (n, joints), in mm and degrees; NaN where the board did not report it.
    """

    t_s: FloatArray
    positions: FloatArray
    rates: FloatArray
    following_errors: FloatArray


class History:
    """A ring of samples; may be used from any thread."""

    def __init__(self, joints: int, samples_max: int = HISTORY_SAMPLES) -> None:
        self._t_s = np.empty(samples_max)
        self._columns = np.empty((samples_max, 3, joints))
        """Of each sample: positions, rates, following errors."""
        self._count = 0
        self._lock = Lock()

    def add(self, t_s: float, positions: FloatArray, rates: FloatArray, following_errors: FloatArray) -> None:
        """Add a sample, later than all others; arrays are of shape (joints,)."""
        with self._lock:
            place = self._count % self._t_s.size
            self._t_s[place] = t_s
            self._columns[place] = positions, rates, following_errors
            self._count += 1

    def since(self, t_s: float = float("-inf")) -> HistorySamples:
        """Return the samples after a time, all by default; the arrays are the caller's own."""
        with self._lock:
            size = self._t_s.size
            order = np.arange(max(0, self._count - size), self._count) % size
            first = int(np.searchsorted(self._t_s[order], t_s, side="right"))
            kept = order[first:]
            times, columns = self._t_s[kept], self._columns[kept]
        return HistorySamples(times, columns[:, 0], columns[:, 1], columns[:, 2])
