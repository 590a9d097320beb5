"""The guards of the service: who operates, how old a click may be, how long a button is held, what a stop ends.

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
    """The place of the one client that operates; another one takes it once that client gives up or is gone."""

    def __init__(self, events: EventLog, changed: Callable[[], None]) -> None:
        """Begin without an operator; `changed` is called when another client has the place, or none."""
        self._events = events
        self._changed = changed
        self._holder: Operator | None = None
        self._lock = Lock()

    @property
    def holder(self) -> Operator | None:
        """The operator; None if there is none."""
        return self._holder

    def is_operator(self, client: str) -> bool:
        holder = self._holder
        return holder is not None and holder.client == client

    def require(self, client: str) -> None:
        """Raise RefusedError unless a client operates the machine."""
        holder = self._holder
        if holder is None:
            raise RefusedError("nobody operates the machine: take the operator's place first")
        if holder.client != client:
            raise RefusedError(f"{holder.name} operates the machine until it gives up or its page is gone")

    def take(self, client: str, name: str) -> None:
        """Operate the machine; raise RefusedError while another client does."""
        with self._lock:
            if self._holder is not None:
                self.require(client)
                return
            self._holder = Operator(client, name)
        self._changed()
        self._events.info(f"{name} operates the machine")

    def give_up(self, client: str) -> None:
        """Stop operating the machine, as when a page is closed; a jog ends. Nothing happens to another's place."""
        with self._lock:
            former = self._holder
            if former is None or former.client != client:
                return
            self._holder = None
        self._changed()
        self._events.info(f"{former.name} no longer operates the machine")


# --- how old a click may be

AGE_MAX_S: Final = 1.0
"""Age of the state that a page had shown beyond which its requests are refused: its operator saw another machine."""
_KEPT_STATES: Final = 4096  # a minute, at 66 a second


class ShownStates:
    """The states that were published, by their numbers.

    A request names the newest state that its page had shown when the operator asked for it. However long the network
    holds the request up, its age is known by that, and whether the machine was stopped, or changed hands, after it.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._times_s: deque[float] = deque(maxlen=_KEPT_STATES)
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
        """Let whatever is requested from the states until now be void; `why` says what has happened."""
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


# --- how long a button is held

BEAT_S: Final = 0.08  # period at which a page repeats its beat
LEASE_S: Final = 0.25
"""Time from the last beat to a press' end: two beats may be lost and the third late."""
EXPIRED: Final = "the page has fallen silent: press the button again"
RELEASED: Final = "the button was released"


@dataclass(slots=True, eq=False)
class Press:
    """A button that is held, or was.

    Attributes:
        client: the page.
        number: number of the press on this page.
        jog: what it moves.
        served: True once the service's thread jogs for it.
        over: why it is over; empty while it is held.
    """

    client: str
    number: int
    jog: Jog
    served: bool = False
    over: str = ""

    @property
    def in_vain(self) -> str:
        """That nothing has moved, and why; empty if a stop or the like has ended the press, which says so itself."""
        if self.over == EXPIRED:
            return f"{self.jog.title}: nothing has moved: {EXPIRED}"
        if self.over in ("", RELEASED):
            return f"{self.jog.title}: nothing has moved: {RELEASED} before the drives were ready: hold it longer"
        return ""


class Presses:
    """The one button that is held, and the presses that are over.

    A button moves the machine while its page says, again and again, that it is held. Each press has a number; the
    numbers of a client only count up. A press ends when the button is released, when no beat comes for the lease, or
    when the service ends it. It is then dead for ever: beats that were held up on their way move nothing.
    """

    def __init__(self, tell: Callable[[str], None], now_s: Callable[[], float] = time.monotonic) -> None:
        """Begin without a press; `tell` gets the reason why a press was dropped before the machine moved."""
        self._tell = tell
        self._now_s = now_s
        self._present: Press | None = None
        self._until_s = 0.0
        self._over: dict[str, tuple[int, str]] = {}
        """Number of the last press of each client that is over, and why it is."""
        self._lock = Lock()

    @property
    def present(self) -> Press | None:
        with self._lock:
            return self._held()

    def serve(self) -> Press | None:
        """Return the press that is held now, which is served from now on; None without one."""
        with self._lock:
            held = self._held()
            if held is not None:
                held.served = True
            return held

    def is_present(self, client: str, number: int) -> bool:
        """Return whether this press is held now."""
        held = self.present
        return held is not None and (held.client, held.number) == (client, number)

    def require_new(self, client: str, number: int) -> None:
        """Raise RefusedError, with why, if a press of this number is over."""
        last, why = self._over.get(client, (-1, ""))
        if number <= last:
            raise RefusedError(why if number == last else RELEASED)

    def beat(self, client: str, number: int, jog: Jog) -> None:
        """Begin a press, or hold it for another lease; raise RefusedError, with why, if it is over."""
        with self._lock:
            held = self._held()
            self.require_new(client, number)
            if held is None or (held.client, held.number) != (client, number):
                self._end(RELEASED)
                self._present = Press(client, number, jog)
            self._until_s = self._now_s() + LEASE_S

    def release(self, client: str, number: int) -> str | None:
        """End a press; one that has not come yet, too. Return why it was over before, None if it was not."""
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
        """Forget a client that is gone for ever; its press ends."""
        with self._lock:
            if self._present is not None and self._present.client == client:
                self._end(RELEASED)
            self._over.pop(client, None)

    def _held(self) -> Press | None:
        """Return the press that is held, once a lease that is over has ended it."""
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


# --- what a stop ends

_KEPT_PRESSES: Final = 1000  # presses of stop buttons that are known again when they come once more


class Stop(IntEnum):
    """Way to stop; the greater one prevails."""

    NONE = 0
    VOID = 1
    """Leave what is done: the machine was stopped already, by another program or its own button."""
    STOP = 2
    """Stop by the quick stop ramp and hold the position."""
    EMERGENCY = 3
    """Stop, switch the power off and hold the drives until a reset."""


class StopAskedError(Exception):
    """A stop was asked for: the service's thread must leave what it does.

    It is no StepTwinError, since nobody may suppress it.
    """


class StopRequests:
    """The stop that is asked for; it ends whatever the service's thread does, at its next frame or wait.

    The thread that hears of it by StopAskedError may send frames again, since it stops; only a greater stop raises once
    more.
    """

    def __init__(self) -> None:
        self._asked = Stop.NONE
        self._answered = Stop.NONE  # the stop that the service's thread knows of
        self._presses: deque[str] = deque(maxlen=_KEPT_PRESSES)
        self._lock = Lock()

    def is_new(self, press: str) -> bool:
        """Note the press of a button; return whether it was not known yet."""
        with self._lock:
            if press in self._presses:
                return False
            self._presses.append(press)
            return True

    def ask(self, stop: Stop) -> None:
        """Ask for a stop; when this returns, no frame that the service's thread began before is still to be sent."""
        with self._lock:
            self._asked = max(self._asked, stop)

    @property
    def asked(self) -> Stop:
        """The stop that is asked for and not yet done."""
        return self._asked

    @contextmanager
    def sending(self) -> Iterator[None]:
        """Let the service's thread send a frame; raise StopAskedError for a stop that it does not know of."""
        with self._lock:
            if self._asked > self._answered:
                self._answered = self._asked
                raise StopAskedError("stopped" if self._asked is Stop.STOP else "emergency stop")
            yield

    def check(self) -> None:
        """Raise StopAskedError as `sending` does."""
        with self.sending():
            pass

    def answer(self) -> Stop:
        """Return the stop that is asked for, which the service's thread is going to make now."""
        with self._lock:
            self._answered = self._asked
            return self._asked

    def done(self, stop: Stop) -> None:
        """Say that a stop has been made; a greater one that was asked for meanwhile is still to be made."""
        with self._lock:
            if self._asked <= stop:
                self._asked = self._answered = Stop.NONE
