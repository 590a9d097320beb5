"""Stops that any thread may ask for, and that end whatever the worker does at its next frame or wait."""

from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum
from threading import Lock


class Stop(IntEnum):
    """How to stop; the greater one prevails."""

    NONE = 0
    STOP = 1
    """Stop by the quick stop ramp and hold the position."""
    EMERGENCY = 2
    """Stop, switch the power off and hold the drives until a reset."""


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
        self._lock = Lock()

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
            raise StopAskedError("stopped" if self._asked is Stop.STOP else "emergency stop")

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
