"""What the desk, its worker and each connection share."""

from dataclasses import dataclass
from threading import Lock

from steptwin.host.panel.desk.actions import ACTIONS
from steptwin.host.panel.desk.commands import Command
from steptwin.host.panel.desk.events import EventLog
from steptwin.host.panel.desk.presses import Press, Presses
from steptwin.host.panel.desk.publisher import Publisher
from steptwin.host.panel.desk.refused import RefusedError
from steptwin.host.panel.desk.results import Results
from steptwin.host.panel.desk.settings import Limits
from steptwin.host.panel.desk.snapshot import Activity
from steptwin.host.panel.desk.stops import StopRequests


@dataclass(frozen=True, slots=True)
class Parts:
    """The desk's parts that outlive a connection."""

    publisher: Publisher
    presses: Presses
    stops: StopRequests
    events: EventLog
    results: Results
    limits: Limits


class Asked:
    """The one command that waits or is carried out, or the press that is served; any thread asks, the worker takes."""

    def __init__(self, publisher: Publisher, presses: Presses) -> None:
        self._known = publisher.known
        self._presses = presses
        self._command: Command | None = None
        self._lock = Lock()

    def ask(self, command: Command) -> None:
        """Let a command wait for the worker; raise RefusedError if the worker is busy."""
        name = ACTIONS[type(command)].title(command)
        with self._lock:
            if self._known.activity is not None:
                raise RefusedError(f"{name}: busy: {self._known.activity.name}")
            self._command = command
            self.begin(name, 0.0)

    def take(self) -> Command | Press | None:
        """Return the command that waits, else the press that is held, else None."""
        with self._lock:
            command, self._command = self._command, None
            if command is not None:
                return command
            press = self._presses.present
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
            if self._command is not None:
                self._command = None
                self.end()
