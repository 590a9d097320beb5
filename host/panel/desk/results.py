"""What runs have come to, and what their pictures show."""

import time
from collections import deque
from dataclasses import dataclass
from itertools import count
from threading import Lock
from typing import Final

from steptwin.host.operate.running import LiveOutcome
from steptwin.host.panel.desk.history import History, Samples

RESULTS_MAX: Final = 20
"""Number of runs that are kept."""


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """A run that has ended.

    Attributes:
        number: counts up from 1.
        wall_s: when it ended, in seconds since 1970.
        name: name of the motion.
        passed: True if every axis ended at the planned step; None if the run was stopped or failed.
        why: why it was stopped or failed, in one line; None otherwise.
        outcome: plan, end of each axis and waits; None if the run was stopped or failed.
        started_s: when the last repetition began, on the clock of `time.monotonic`; None if it never did.
        samples: what the board reported during the run.
    """

    number: int
    wall_s: float
    name: str
    passed: bool | None
    why: str | None
    outcome: LiveOutcome | None
    started_s: float | None
    samples: Samples


@dataclass(slots=True)
class Run:
    """A run that goes on.

    Attributes:
        name: name of the motion.
        asked_s: when it was begun, with its approach.
        started_s: when the last repetition began; None before the first.
    """

    name: str
    asked_s: float
    started_s: float | None = None

    def begin_repetition(self) -> None:
        """Note that the axes have set off now."""
        self.started_s = time.monotonic()


class Results:
    """The last runs that have ended; the worker adds them, any thread reads them."""

    def __init__(self, history: History) -> None:
        self._history = history
        self._numbers = count(1)
        self._results: deque[Result] = deque(maxlen=RESULTS_MAX)
        self._lock = Lock()

    def begin(self, name: str) -> Run:
        """Begin a run."""
        return Run(name, time.monotonic())

    def end(self, run: Run, outcome: LiveOutcome | None, why: str | None) -> None:
        """Keep a run that has ended, with its outcome or with the reason why it has none."""
        result = Result(
            number=next(self._numbers),
            wall_s=time.time(),
            name=run.name,
            passed=outcome.passed if outcome else None,
            why=why,
            outcome=outcome,
            started_s=run.started_s,
            samples=self._history.since(run.asked_s),
        )
        with self._lock:
            self._results.append(result)

    def all(self) -> tuple[Result, ...]:
        """Return the results, the newest last."""
        with self._lock:
            return tuple(self._results)
