"""Hold-to-jog: a button moves the machine while its page says, again and again, that it is held.

Each press of a button has a number; the numbers of a client only count up. A press ends when the button is released,
when no beat comes for the lease, or when the desk ends it. It is then dead for ever: beats of it that were held up on
their way do not set the machine moving again.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import Final, NamedTuple

from steptwin.features.panel.desk.requests import Request
from steptwin.features.panel.desk.settings import MachineSettings
from steptwin.features.panel.desk.words import RefusedError
from steptwin.host.operate.jogging import check_jog, jog, jog_tool
from steptwin.host.operate.session import Session
from steptwin.host.planning.tool_by_hand import StepFrame, check_tool_jog

BEAT_S: Final = 0.08
"""Time after which a page repeats its beat."""
LEASE_S: Final = 0.25
"""Time from the last beat to a press' end: two beats may be lost and the third late."""
EXPIRED: Final = "the page has fallen silent: press the button again"
RELEASED: Final = "the button was released"


class JogEnd(NamedTuple):
    """The end of a jog: whether anything has moved, and whether it stands at the end of its travel."""

    moved: bool
    at_end: bool


@dataclass(frozen=True, slots=True)
class Jog(Request):
    """A motion at a speed with a sign, in mm/s or deg/s, for as long as a button is held."""

    jogs = True

    def perform(self, session: Session, released: Callable[[], bool]) -> JogEnd:
        """Jog until the button is released, or the machine can go no further."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class JointJog(Jog):
    """Move one joint, up to its limit."""

    named = "jog {0.joint}"
    joint: str
    speed: float

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        """Raise InputError unless the joint exists and takes the speed."""
        check_jog(limits.robot, self.joint, self.speed)

    def perform(self, session: Session, released: Callable[[], bool]) -> JogEnd:
        """Jog until the button is released, or the joint stands at its limit."""
        jogged = jog(session, self.joint, self.speed, None, until=released)
        return JogEnd(jogged.end != jogged.start, jogged.at_limit)


@dataclass(frozen=True, slots=True)
class ToolJog(Jog):
    """Move the tool along an axis of the world or of its own, or turn it about one or by phi."""

    named = "jog {0.coordinate}"
    needs_homed = True
    coordinate: str
    speed: float
    frame: StepFrame = StepFrame.WORLD

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        """Raise InputError unless the coordinate exists and takes the speed."""
        check_tool_jog(limits.robot, self.coordinate, self.speed)

    def perform(self, session: Session, released: Callable[[], bool]) -> JogEnd:
        """Jog until the button is released, or the tool can go no further."""
        jogged = jog_tool(session, self.coordinate, self.speed, None, frame=self.frame, until=released)
        return JogEnd(jogged.end != jogged.start, jogged.at_end)


@dataclass(slots=True, eq=False)
class Press:
    """A button that is held, or was.

    Attributes:
        client: the page.
        number: number of the press on this page.
        jog: what it moves.
        served: True once the worker jogs for it.
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
    """The one button that is held, and the presses that are over; may be used from any thread."""

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
        """The press that is held now; None without one."""
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
        """End the press that is held, if any."""
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
