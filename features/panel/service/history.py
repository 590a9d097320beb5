"""The past: a log of events, the last minutes of every joint, the planned path and the tool's trace.

All of it is thread-safe. Memory is bounded: the oldest entries are dropped first.
"""

import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from threading import Lock
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray

EVENTS_MAX: Final = 2000  # number of kept events


class Severity(StrEnum):
    """Severity of an event: expected, notable, or failed."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True, slots=True)
class Event:
    """An event in one line; its number counts up from 1 and is never used again."""

    number: int
    wall_s: float
    severity: Severity
    text: str


class EventLog:
    """Events in order."""

    def __init__(self, wall_s: Callable[[], float] = time.time) -> None:
        self._wall_s = wall_s
        self._events: deque[Event] = deque(maxlen=EVENTS_MAX)
        self._count = 0
        self._lock = Lock()
        self.info = partial(self.add, Severity.INFO)
        self.warning = partial(self.add, Severity.WARNING)
        self.error = partial(self.add, Severity.ERROR)

    def add(self, severity: Severity, text: str) -> None:
        """Add an event with the present time."""
        with self._lock:
            self._count += 1
            self._events.append(Event(self._count, self._wall_s(), severity, text))

    def since(self, number: int = 0) -> tuple[Event, ...]:
        with self._lock:
            return tuple(event for event in self._events if event.number > number)

    @property
    def span(self) -> tuple[int, int] | None:
        """Numbers of the first and the last event; None without any."""
        with self._lock:
            return (self._events[0].number, self._events[-1].number) if self._events else None

    def clear(self) -> None:
        with self._lock:
            self._events.clear()


TRACE_POINTS: Final = 4000  # number of kept points of the trace
TRACE_STEP_MM: Final = 0.5  # least distance of two points of the trace, below a pixel
_NOTHING: Final = np.empty((0, 3))


class Drawing:
    """The planned path and the tool's trace, in mm.

    Attributes:
        path_mm: path of the motion last previewed or run, shape (n, 3); empty without one.
        version: number of changes of the path and of clearings of the trace; pages redraw when it changes.
    """

    def __init__(self) -> None:
        self.path_mm: FloatArray = _NOTHING
        self.version: tuple[int, int] = 0, 0
        self._trace_mm: deque[tuple[float, ...]] = deque(maxlen=TRACE_POINTS)
        self._lock = Lock()

    @property
    def trace_mm(self) -> FloatArray:
        """Positions of the tool since the trace was cleared, shape (n, 3)."""
        with self._lock:
            return np.array(self._trace_mm) if self._trace_mm else _NOTHING

    def show_path(self, path_mm: FloatArray) -> None:
        """Set the planned path, shape (n, 3)."""
        with self._lock:
            self.path_mm = path_mm
            self.version = self.version[0] + 1, self.version[1]

    def clear_path(self) -> None:
        self.show_path(_NOTHING)

    def follow(self, pose: Mapping[str, float] | None) -> None:
        """Extend the trace to the tool's pose, unless it is unknown or close to the trace's end."""
        if pose is None:
            return
        point = tuple(pose[key] for key in ("x_mm", "y_mm", "z_mm"))
        with self._lock:
            if not self._trace_mm or np.linalg.norm(np.subtract(point, self._trace_mm[-1])) >= TRACE_STEP_MM:
                self._trace_mm.append(point)

    def clear_trace(self) -> None:
        """Clear the trace."""
        with self._lock:
            self._trace_mm.clear()
            self.version = self.version[0], self.version[1] + 1


HISTORY_SAMPLES: Final = 12_000  # number of kept samples: five minutes at 40 a second


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
    """The last samples of every joint."""

    def __init__(self, joints: int, samples_max: int = HISTORY_SAMPLES) -> None:
        self._joints = joints
        self._samples: deque[tuple[float, FloatArray]] = deque(maxlen=samples_max)
        self._lock = Lock()

    def add(self, t_s: float, positions: FloatArray, rates: FloatArray, following_errors: FloatArray) -> None:
        """Add a sample, later than all others; arrays are of shape (joints,)."""
        with self._lock:
            self._samples.append((t_s, np.stack((positions, rates, following_errors))))

    def since(self, t_s: float = float("-inf")) -> HistorySamples:
        """Return the samples after a time; by default all."""
        with self._lock:
            kept = [sample for sample in self._samples if sample[0] > t_s]
        times = np.array([time_s for time_s, _ in kept])
        columns = np.array([column for _, column in kept]).reshape(-1, 3, self._joints)
        return HistorySamples(times, columns[:, 0], columns[:, 1], columns[:, 2])
