"""What the desk, its worker and each connection share."""

from dataclasses import dataclass
from threading import Lock

from steptwin.host.panel.desk.actions import ACTIONS
from steptwin.host.panel.desk.commands import Order
from steptwin.host.panel.desk.events import EventLog
from steptwin.host.panel.desk.presses import Press, Presses
from steptwin.host.panel.desk.publisher import Publisher
from steptwin.host.panel.desk.results import RunResults
from steptwin.host.panel.desk.settings import MachineSettings
from steptwin.host.panel.desk.snapshot import Activity
from steptwin.host.panel.desk.stops import ShownStates, StopRequests
from steptwin.host.panel.desk.words import RefusedError, busy


@dataclass(frozen=True, slots=True)
class Parts:
    """The desk's parts that outlive a connection."""

    publisher: Publisher
    shown: ShownStates
    presses: Presses
    stops: StopRequests
    events: EventLog
    results: RunResults
    limits: MachineSettings


class Asked:
    """The one command that waits or is carried out, or the press that is served; any thread asks, the worker takes."""

    def __init__(self, publisher: Publisher, presses: Presses) -> None:
        self._known = publisher.known
        self._presses = presses
        self._order: Order | None = None
        self._lock = Lock()

    def ask(self, order: Order) -> None:
        """Let a command wait for the worker; raise RefusedError if the worker is busy."""
        name = ACTIONS[type(order.command)].title(order.command)
        with self._lock:
            if self._known.activity is not None:
                raise RefusedError(busy(name, self._known.activity.name))
            self._order = order
            self.begin(name, 0.0)

    def take(self) -> Order | Press | None:
        """Return the command that waits, else the press that is held, else None."""
        with self._lock:
            order, self._order = self._order, None
            if order is not None:
                return order
            press = self._presses.serve()
            if press is not None:
                self.begin(f"jog {press.jog.name}", None)
            return press

    def begin(self, name: str, fraction: float | None) -> None:
        """Say what the worker does, and which part is done; None for a jog, which has no end."""
        self._known.activity = Activity(name, fraction, paused=False, pausable=False)

    def end(self) -> None:
        """Say that the worker does nothing any more."""
        self._known.activity = None

    def drop(self) -> None:
        """Drop a command that waits; one that is carried out goes on."""
        with self._lock:
            if self._order is not None:
                self._order = None
                self.end()
