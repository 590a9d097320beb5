"""Stops that any thread may ask for, and that end whatever the worker does at its next frame or wait.

A command names the newest state that its page had shown when the operator asked for it. However long the network holds
the command up, its age is known by that, and whether the machine was stopped, or changed hands, after it.
"""

import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import IntEnum
from threading import Lock
from typing import Final

from steptwin.features.panel.desk.words import RefusedError

AGE_MAX_S: Final = 1.0
"""Age of the state that a page had shown beyond which its commands are refused: its operator saw another machine."""
_KEPT: Final = 4096
"""Number of states whose time is kept: a minute, at 66 a second."""


class ShownStates:
    """The states that were published, by their numbers; may be used from any thread."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._times_s: deque[float] = deque(maxlen=_KEPT)
        self._next = 0
        self._valid_from = 0
        self._why_void = ""
        self._lock = Lock()

    def add(self) -> int:
        """Return the number of a state that is published now."""
        with self._lock:
            self._times_s.append(self._now_s())
            self._next += 1
            return self._next - 1

    def void(self, why: str) -> None:
        """Let whatever is asked for from the states until now be void; `why` says what has happened."""
        with self._lock:
            self._valid_from, self._why_void = self._next, why

    def require(self, number: int | None) -> float:
        """Return when a state was published, on the clock of `time.monotonic`.

        Raises:
            RefusedError: as `require_young`, or a stop, a reset, another operator or another connection came since.
        """
        time_s = self.require_young(number)
        with self._lock:
            if number is not None and number < self._valid_from:
                raise RefusedError(f"void, since {self._why_void} after it was asked for: look, and ask again")
        return time_s

    def require_young(self, number: int | None) -> float:
        """Return when a state was published; raise RefusedError for none, or for one more than AGE_MAX_S old."""
        with self._lock:
            first = self._next - len(self._times_s)
            if number is None or not 0 <= number < self._next:
                raise RefusedError("the page had not shown the machine yet: look, and ask again")
            time_s = self._times_s[max(0, number - first)]  # of one that is not kept: the oldest that is
        age_s = self._now_s() - time_s
        if age_s > AGE_MAX_S:
            raise RefusedError(
                f"too late: the page had shown the machine of {age_s:.1f} s ago, more than {AGE_MAX_S:g} s: ask again"
            )
        return time_s


_PRESSES: Final = 1000
"""Number of presses of the emergency stop's buttons that are known again when they come once more."""


class Stop(IntEnum):
    """Way to stop; the greater one prevails."""

    NONE = 0
    VOID = 1
    """Leave what is done: the machine was stopped already, by another program or its own button."""
    STOP = 2
    """Stop by the quick stop ramp and hold the position."""
    EMERGENCY = 3
    """Stop, switch the power off and hold the drives until a reset."""

    @property
    def words(self) -> str:
        """The words for what ends by it."""
        return "stopped" if self is Stop.STOP else "emergency stop"


class StopAskedError(Exception):
    """A stop was asked for: the worker must leave what it does. No StepTwinError, since nobody may suppress it."""


class StopRequests:
    """The stop that is asked for and not yet done.

    Once a stop is asked for, the worker's next frame is not sent: `sending` raises. From then on the worker may send
    frames again, since it stops; only a greater stop raises once more.
    """

    def __init__(self) -> None:
        self._asked = Stop.NONE
        self._answered = Stop.NONE
        """The stop that the worker knows of."""
        self._presses: deque[str] = deque(maxlen=_PRESSES)
        self._lock = Lock()

    def is_new(self, press: str) -> bool:
        """Note the press of a button; return whether it was not known yet."""
        with self._lock:
            if press in self._presses:
                return False
            self._presses.append(press)
            return True

    def ask(self, stop: Stop) -> None:
        """Ask for a stop; when this returns, no frame that the worker began before is still to be sent."""
        with self._lock:
            self._asked = max(self._asked, stop)

    @property
    def asked(self) -> Stop:
        """The stop that is asked for and not yet done."""
        return self._asked

    @contextmanager
    def sending(self) -> Iterator[None]:
        """Let the worker send a frame; raise StopAskedError if a stop is asked for that it does not know of."""
        with self._lock:
            self._check()
            yield

    def check(self) -> None:
        """Raise StopAskedError as `sending` does."""
        with self._lock:
            self._check()

    def _check(self) -> None:
        if self._asked > self._answered:
            self._answered = self._asked
            raise StopAskedError(self._asked.words)

    def answer(self) -> Stop:
        """Return the stop that is asked for, which the worker is going to make now."""
        with self._lock:
            self._answered = self._asked
            return self._asked

    def done(self, stop: Stop) -> None:
        """Say that a stop has been made; a greater one that was asked for meanwhile is still to be made."""
        with self._lock:
            if self._asked <= stop:
                self._asked = self._answered = Stop.NONE
