"""The one thread that owns the link: it connects, serves the machine, and connects again."""

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Event as Flag
from threading import Thread, get_ident
from typing import Final

import can

from steptwin.host.client.links.bus_link import BusLink, Connection, open_bus
from steptwin.host.client.links.bus_network import BusNetwork
from steptwin.host.common.errors import BusError, StepTwinError
from steptwin.host.operate.session import Session
from steptwin.host.panel.desk.connected import Connected
from steptwin.host.panel.desk.parts import Asked, Parts
from steptwin.host.panel.desk.reports import Reports
from steptwin.host.panel.desk.stops import Stop, StopAskedError, StopRequests
from steptwin.host.panel.desk.words import told


class StoppableNetwork(BusNetwork):
    """A network on which the thread that has opened it sends no frame after a stop was asked for; others may."""

    def __init__(self, bus: can.BusABC, title: str, stops: StopRequests) -> None:
        super().__init__(bus, title)
        self._stops = stops
        self._worker = get_ident()

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame; raise StopAskedError in the worker's thread if it must stop, BusError if the bus fails."""
        if get_ident() != self._worker:
            super().send_message(can_id, data, remote)
            return
        with self._stops.sending():
            super().send_message(can_id, data, remote)


class DeskLink(BusLink):
    """A BusLink on which any function of `host/operate` publishes telemetry and ends when a stop is asked for."""

    def __init__(self, bus: can.BusABC, title: str, stops: StopRequests, publish: Callable[[], None]) -> None:
        """Open the link in the worker's thread; `publish` is called in every wait."""
        super().__init__(bus, title, network=lambda: StoppableNetwork(bus, title, stops))
        self._stops = stops
        self._publish = publish

    def wait(self, dt_s: float) -> None:
        """Sleep and publish; raise StopAskedError if the worker must stop, BusError if the bus has failed."""
        super().wait(dt_s)
        self._publish()
        self._stops.check()


_RETRY_S: Final = 0.3
"""Time between two attempts to connect."""
_LOST_S: Final = 1.0
"""Silence after which the worker connects anew."""

_LOGGER: Final = logging.getLogger(__name__)


class Worker:
    """Connects to the machine and serves it until it is closed; everything that waits for the bus happens here."""

    def __init__(self, connection: Connection, parts: Parts, asked: Asked, *, force: bool) -> None:
        self.session: Session | None = None
        """The session while the machine is connected; may be read by any thread."""
        self._connection = connection
        self._parts = parts
        self._asked = asked
        self._force = force
        self._closing = Flag()
        self._thread = Thread(target=self._run, name="desk", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """Stop what the worker makes the machine do, and end the thread and the connection."""
        self._closing.set()
        if self._parts.publisher.known.activity is not None:
            self._parts.stops.ask(Stop.STOP)
        self._thread.join()

    def _run(self) -> None:
        last = ""
        while not self._closing.is_set():
            why = "closed"
            try:
                with self._connected() as connected:
                    last = ""
                    self._serve(connected)
            except StepTwinError as error:
                why = told(error)
            except StopAskedError:
                continue  # while connecting: stop first
            except Exception as error:  # a fault of this program: nobody may be left without a desk
                _LOGGER.exception("the desk's worker has failed")
                why = f"internal error: {error}"
            self._parts.publisher.disconnected(why)
            if why != last and not self._closing.is_set():
                self._parts.events.error(f"not connected: {why}")
                last = why
            self._closing.wait(_RETRY_S)

    @contextmanager
    def _connected(self) -> Iterator[Connected]:
        """Open the bus while the block runs; an emergency stop that waits is made before anything else."""
        title, parts = self._connection.title, self._parts
        bus = open_bus(self._connection)
        with DeskLink(bus, title, parts.stops, parts.publisher.publish) as link:
            session = Session(link, parts.limits.robot)
            reports = Reports(link.network, session.machine.axes, parts.publisher.emergency)
            parts.results.reports.listen(link.network, [axis.node_id for axis in session.machine.axes])
            connected = Connected(session, reports, parts, self._asked)
            connected.make_stop()
            session.require_present()
            if not (self._force or session.streaming):
                connected.require_own()
            parts.publisher.connected(session, reports)
            self.session = session
            parts.events.info(f"connected: {title}")
            try:
                yield connected
            finally:
                self.session = None
                parts.presses.end("the connection is lost")
                self._asked.drop()

    def _serve(self, connected: Connected) -> None:
        """Serve the machine until the worker is closed; raise BusError when the connection is lost."""
        began_s = time.monotonic()
        while not self._closing.is_set():
            with suppress(StopAskedError):  # which the next turn makes
                connected.turn()
            if time.monotonic() - max(connected.reports.heard_s, began_s) > _LOST_S:
                raise BusError(f"{self._connection.title}: the machine has fallen silent")
