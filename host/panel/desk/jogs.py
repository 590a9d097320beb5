"""Hold-to-jog: a button moves the machine while its page says, again and again, that it is held.

Each press of a button has a number; the numbers of a client only count up. A press ends when the button is released,
when no beat comes for the lease, or when the desk ends it. It is then dead for ever: beats of it that were held up on
their way do not set the machine moving again.
"""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import ClassVar, Final, NamedTuple

from steptwin.host.operate.jogging import check_jog, jog, jog_tool
from steptwin.host.operate.session import Session
from steptwin.host.panel.desk.words import RefusedError
from steptwin.host.planning.tool_by_hand import check_tool_jog
from steptwin.host.robots.robot import Robot

BEAT_S: Final = 0.08
"""Time after which a page repeats its beat."""
LEASE_S: Final = 0.25
"""Time from the last beat to a press' end: two beats may be lost and the third late."""
EXPIRED: Final = "the page has fallen silent: press the button again"
RELEASED: Final = "the button was released"
_MISSED_MAX: Final = 16


class JogEnd(NamedTuple):
    """The end of a jog: whether anything has moved, and whether it stands at the end of its travel."""

    moved: bool
    at_end: bool


@dataclass(frozen=True, slots=True)
class JointJog:
    """Move one joint at a speed with a sign, in mm/s or deg/s, for as long as the button is held."""

    needs_homed: ClassVar[bool] = False
    joint: str
    speed: float

    @property
    def title(self) -> str:
        """Its name, with the joint."""
        return f"jog {self.joint}"

    def check(self, robot: Robot) -> None:
        """Raise InputError unless the joint exists and takes the speed."""
        check_jog(robot, self.joint, self.speed)

    def perform(self, session: Session, released: Callable[[], bool]) -> JogEnd:
        """Jog until the button is released, or the joint stands at its limit."""
        jogged = jog(session, self.joint, self.speed, None, until=released)
        return JogEnd(jogged.end != jogged.start, jogged.at_limit)


@dataclass(frozen=True, slots=True)
class ToolJog:
    """Move the tool along x, y or z of the world, or turn it by phi, for as long as the button is held."""

    needs_homed: ClassVar[bool] = True
    coordinate: str
    speed: float
    """In mm/s or deg/s, with a sign."""

    @property
    def title(self) -> str:
        """Its name, with the coordinate."""
        return f"jog {self.coordinate}"

    def check(self, robot: Robot) -> None:
        """Raise InputError unless the coordinate exists and takes the speed."""
        check_tool_jog(robot, self.coordinate, self.speed)

    def perform(self, session: Session, released: Callable[[], bool]) -> JogEnd:
        """Jog until the button is released, or the tool can go no further."""
        jogged = jog_tool(session, self.coordinate, self.speed, released)
        return JogEnd(jogged.end != jogged.start, jogged.at_end)


Jog = JointJog | ToolJog


@dataclass(frozen=True, slots=True)
class Press:
    """A button that is held.

    Attributes:
        client: the page.
        number: number of the press on this page.
        jog: what it moves.
    """

    client: str
    number: int
    jog: Jog


class Presses:
    """The one button that is held, and the presses that are over; may be used from any thread."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._present: Press | None = None
        self._until_s = 0.0
        self._over: dict[str, tuple[int, str]] = {}
        """Number of the last press of each client that is over, and why it is."""
        self._served: Press | None = None
        self._missed: deque[tuple[Press, str]] = deque(maxlen=_MISSED_MAX)
        """Presses that ended before the machine came to serve them, and why they did."""
        self._lock = Lock()

    @property
    def present(self) -> Press | None:
        """The press that is held now; None without one."""
        with self._lock:
            self._expire()
            return self._present

    def serve(self) -> Press | None:
        """Return the press that is held now, which is served from now on; None without one."""
        self._served = self.present
        return self._served

    def missed(self) -> list[tuple[Press, str]]:
        """Return, once, the presses that ended before they were served, and why they did."""
        with self._lock:
            missed = list(self._missed)
            self._missed.clear()
            return missed

    def why_over(self, press: Press) -> str:
        """Return why a press is over, as far as that is known; empty while it is held."""
        with self._lock:
            self._expire()
            if self._present is press:
                return ""
            number, why = self._over.get(press.client, (-1, RELEASED))
            return why if number == press.number else RELEASED

    def holds(self, press: Press) -> bool:
        """Return whether a press is still held."""
        return self.present is press

    def is_present(self, client: str, number: int) -> bool:
        """Return whether this press is held now."""
        held = self.present
        return held is not None and (held.client, held.number) == (client, number)

    def require_new(self, client: str, number: int) -> None:
        """Raise RefusedError, with why, if a press of this number is over."""
        with self._lock:
            self._require_new(client, number)

    def _require_new(self, client: str, number: int) -> None:
        last, why = self._over.get(client, (-1, ""))
        if number <= last:
            raise RefusedError(why if number == last else RELEASED)

    def beat(self, client: str, number: int, jog: Jog) -> None:
        """Begin a press, or hold it for another lease; raise RefusedError, with why, if it is over."""
        with self._lock:
            self._expire()
            self._require_new(client, number)
            held = self._present
            if held is None or (held.client, held.number) != (client, number):
                self._end(RELEASED)
                self._present = Press(client, number, jog)
            self._until_s = self._now_s() + LEASE_S

    def release(self, client: str, number: int) -> str | None:
        """End a press; one that has not come yet, too. Return why it was over before, None if it was not."""
        with self._lock:
            self._expire()
            held = self._present
            if held is not None and held.client == client and held.number <= number:
                self._end(RELEASED)
            last, why = self._over.get(client, (-1, ""))
            if number > last:
                self._over[client] = number, RELEASED
            return why if number == last and why != RELEASED else None

    def end(self, why: str) -> None:
        """End the press that is held, if any."""
        with self._lock:
            self._end(why)

    def forget(self, client: str) -> None:
        """Forget a client that is gone for ever; its press ends."""
        with self._lock:
            if self._present is not None and self._present.client == client:
                self._end(RELEASED)
            self._over.pop(client, None)

    def _expire(self) -> None:
        if self._now_s() > self._until_s:
            self._end(EXPIRED)

    def _end(self, why: str) -> None:
        held, self._present = self._present, None
        if held is not None:
            self._over[held.client] = held.number, why
            if held is not self._served:
                self._missed.append((held, why))
