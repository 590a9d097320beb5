"""Guards of the service: operator, age of a click, duration of a held button, effect of a stop.

All of them may be used from any thread. A client is any text that names a page.
"""

import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum
from threading import Lock
from typing import Final, NamedTuple

from steptwin.features.panel.service.commands import Jog
from steptwin.features.panel.service.history import EventLog
from steptwin.features.panel.service.messages import RefusedError


class Operator(NamedTuple):
    """The client that operates the machine, and its user's name."""

    client: str
    name: str


class OperatorPlace:
    """Place of the operator, for one client at a time; it becomes free when that client gives up or is gone."""

    def __init__(self, events: EventLog, changed: Callable[[], None]) -> None:
        """Start without an operator; `changed` is called when the operator changes."""
        self._events = events
        self._changed = changed
        self._holder: Operator | None = None
        self._lock = Lock()

    @property
    def holder(self) -> Operator | None:
        """The operator; None without one."""
        return self._holder

    def is_operator(self, client: str) -> bool:
        holder = self._holder
        return holder is not None and holder.client == client

    def require(self, client: str) -> None:
        """Raise RefusedError if a client does not operate the machine."""
        holder = self._holder
        if holder is None:
            raise RefusedError("nobody operates the machine: take the operator's place first")
        if holder.client != client:
            raise RefusedError(f"{holder.name} operates the machine until it gives up or its page is gone")

    def take(self, client: str, name: str) -> None:
        """Become the operator; raise RefusedError while there is another one."""
        with self._lock:
            if self._holder is not None:
                self.require(client)
                return
            self._holder = Operator(client, name)
        self._changed()
        self._events.info(f"{name} operates the machine")

    def give_up(self, client: str) -> None:
        """Give up a client's place, as when a page is closed; its jog ends. Another client's place is not affected."""
        with self._lock:
            former = self._holder
            if former is None or former.client != client:
                return
            self._holder = None
        self._changed()
        self._events.info(f"{former.name} no longer operates the machine")


# --- age of a click

AGE_MAX_S: Final = 1.0
"""Largest age of the state that a page had shown with a request; older pages showed another machine."""
_KEPT_STATES: Final = 4096  # a minute, at 66 states a second


class ShownStates:
    """Published states by number.

    A request has the number of the newest state that its page had shown then. So its age is known, however long the
    network delays it. So is any stop, or change of the operator, after it.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._times_s: deque[float] = deque(maxlen=_KEPT_STATES)
        self._next = 0
        self._valid_from = 0
        self._why_void = ""
        self._lock = Lock()

    def add(self) -> int:
        """Return the number of a state published now."""
        with self._lock:
            self._times_s.append(self._now_s())
            self._next += 1
            return self._next - 1

    def void(self, why: str) -> None:
        """Void requests from the states so far; `why` is the reason."""
        with self._lock:
            self._valid_from, self._why_void = self._next, why

    def require(self, number: int | None) -> float:
        """Return the time of a state's publication, on the clock of `time.monotonic`.

        Raises:
            RefusedError: as `require_young`, or since then there was a stop, a reset, another operator or connection.
        """
        time_s = self.require_young(number)
        with self._lock:
            if number is not None and number < self._valid_from:
                raise RefusedError(f"void, since {self._why_void} after it was asked for: look, and ask again")
        return time_s

    def require_young(self, number: int | None) -> float:
        """Return the time of a state's publication; raise RefusedError for none, or for one older than AGE_MAX_S."""
        with self._lock:
            first = self._next - len(self._times_s)
            if number is None or not 0 <= number < self._next:
                raise RefusedError("the page had not shown the machine yet: look, and ask again")
            time_s = self._times_s[max(0, number - first)]  # for a dropped one, the time of the oldest kept one
        age_s = self._now_s() - time_s
        if age_s > AGE_MAX_S:
            raise RefusedError(
                f"too late: the page had shown the machine of {age_s:.1f} s ago, more than {AGE_MAX_S:g} s: ask again"
            )
        return time_s


# --- duration of a held button

BEAT_S: Final = 0.08  # period of a page's beats
LEASE_S: Final = 0.25
"""Time from the last beat to the end of a press: two beats may be lost and the third late."""
EXPIRED: Final = "the page has fallen silent: press the button again"
RELEASED: Final = "the button was released"


@dataclass(slots=True, eq=False)
class Press:
    """A press of a button, held or ended.

    Attributes:
        client: page of the button.
        number: number of the press on this page.
        jog: motion of the press.
        served: True once the service's thread jogs for it.
        over: why it has ended; empty while it is held.
    """

    client: str
    number: int
    jog: Jog
    served: bool = False
    over: str = ""

    @property
    def in_vain(self) -> str:
        """Message that nothing has moved, with the reason; empty after a stop or the like, which is reported."""
        if self.over == EXPIRED:
            return f"{self.jog.title}: nothing has moved: {EXPIRED}"
        if self.over in ("", RELEASED):
            return f"{self.jog.title}: nothing has moved: {RELEASED} before the drives were ready: hold it longer"
        return ""


class Presses:
    """The held button, and ended presses.

    A button moves the machine while its page repeats that it is held. Each press has a number, which only increases for
    a client. A press ends when the button is released, when no beat comes within the lease, or when the service ends
    it. Its later beats, delayed on their way, move nothing.
    """

    def __init__(self, tell: Callable[[str], None], now_s: Callable[[], float] = time.monotonic) -> None:
        """Start without a press; `tell` gets the reason for a press dropped before the machine moved."""
        self._tell = tell
        self._now_s = now_s
        self._present: Press | None = None
        self._until_s = 0.0
        self._over: dict[str, tuple[int, str]] = {}
        """Number of each client's last ended press, and the reason."""
        self._lock = Lock()

    @property
    def present(self) -> Press | None:
        with self._lock:
            return self._held()

    def serve(self) -> Press | None:
        """Return the held press, now served; None without one."""
        with self._lock:
            held = self._held()
            if held is not None:
                held.served = True
            return held

    def is_present(self, client: str, number: int) -> bool:
        """Return whether this press is held."""
        held = self.present
        return held is not None and (held.client, held.number) == (client, number)

    def require_new(self, client: str, number: int) -> None:
        """Raise RefusedError, with the reason, if a press of this number has ended."""
        last, why = self._over.get(client, (-1, ""))
        if number <= last:
            raise RefusedError(why if number == last else RELEASED)

    def beat(self, client: str, number: int, jog: Jog) -> None:
        """Begin a press, or extend its lease; raise RefusedError, with the reason, if it has ended."""
        with self._lock:
            held = self._held()
            self.require_new(client, number)
            if held is None or (held.client, held.number) != (client, number):
                self._end(RELEASED)
                self._present = Press(client, number, jog)
            self._until_s = self._now_s() + LEASE_S

    def release(self, client: str, number: int) -> str | None:
        """End a press, even before its first beat; return why it had ended before, None if it had not."""
        with self._lock:
            held = self._held()
            if held is not None and held.client == client and held.number <= number:
                self._end(RELEASED)
            last, why = self._over.get(client, (-1, ""))
            if number > last:
                self._over[client] = number, RELEASED
            return why if number == last and why != RELEASED else None

    def end(self, why: str) -> None:
        with self._lock:
            self._end(why)

    def forget(self, client: str) -> None:
        """Remove a client that is gone forever; its press ends."""
        with self._lock:
            if self._present is not None and self._present.client == client:
                self._end(RELEASED)
            self._over.pop(client, None)

    def _held(self) -> Press | None:
        """Return the held press, unless its lease has run out."""
        if self._now_s() > self._until_s:
            self._end(EXPIRED)
        return self._present

    def _end(self, why: str) -> None:
        held, self._present = self._present, None
        if held is None:
            return
        held.over = why
        self._over[held.client] = held.number, why
        if not held.served and held.in_vain:
            self._tell(held.in_vain)


# --- effect of a stop

_KEPT_PRESSES: Final = 1000  # recent presses of stop buttons, to recognise copies


class Stop(IntEnum):
    """Kinds of stop; the greater one prevails."""

    NONE = 0
    VOID = 1
    """Give up present work: another program, or the machine's own button, has stopped the machine."""
    STOP = 2
    """Stop by the quick stop ramp and hold the position."""
    EMERGENCY = 3
    """Stop, switch the power off and hold the drives until a reset."""


class StopRequestedError(Exception):
    """A stop was requested: the service's thread must give up its work.

    It is not a StepTwinError, so that no handler suppresses it.
    """


class StopRequests:
    """The requested stop; it ends the work of the service's thread at its next frame or wait.

    After StopRequestedError the thread may send frames again to stop; only a greater stop raises once more.
    """

    def __init__(self) -> None:
        self._asked = Stop.NONE
        self._answered = Stop.NONE  # stop that the service's thread knows of
        self._presses: deque[str] = deque(maxlen=_KEPT_PRESSES)
        self._lock = Lock()

    def is_new(self, press: str) -> bool:
        """Register the press of a button; return True if it is new."""
        with self._lock:
            if press in self._presses:
                return False
            self._presses.append(press)
            return True

    def ask(self, stop: Stop) -> None:
        """Request a stop; when this returns, the service's thread has sent any frame that it had begun."""
        with self._lock:
            self._asked = max(self._asked, stop)

    @property
    def asked(self) -> Stop:
        """The requested stop that has not been made."""
        return self._asked

    @contextmanager
    def sending(self) -> Iterator[None]:
        """Allow the service's thread to send a frame; raise StopRequestedError for a stop that it does not know of."""
        with self._lock:
            if self._asked > self._answered:
                self._answered = self._asked
                raise StopRequestedError("stopped" if self._asked is Stop.STOP else "emergency stop")
            yield

    def check(self) -> None:
        """Raise StopRequestedError as `sending` does."""
        with self.sending():
            pass

    def answer(self) -> Stop:
        """Return the requested stop, which the service's thread is going to make."""
        with self._lock:
            self._answered = self._asked
            return self._asked

    def done(self, stop: Stop) -> None:
        """Register a stop as made; a greater one requested meanwhile remains."""
        with self._lock:
            if self._asked <= stop:
                self._asked = self._answered = Stop.NONE
