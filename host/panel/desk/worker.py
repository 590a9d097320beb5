"""The one thread that owns the link: it connects, watches, does one thing at a time, and connects again."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event as Flag
from threading import Thread
from typing import Final

from steptwin.host.client.bus_link import Connection, open_bus
from steptwin.host.common.errors import BusError, InputError, StepTwinError
from steptwin.host.operate.session import Session
from steptwin.host.panel.desk.events import EventLog
from steptwin.host.panel.desk.link import DeskLink
from steptwin.host.panel.desk.publisher import Publisher
from steptwin.host.panel.desk.reports import Reports, set_up_reports
from steptwin.host.panel.desk.stops import StopRequests
from steptwin.host.panel.desk.words import error_words
from steptwin.host.robots.robot import Robot

_TURN_S: Final = 0.02
"""Longest time until an idle worker looks round."""
_RETRY_S: Final = 0.5
"""Time between two attempts to connect."""


class Worker:
    """Connects to the machine and serves the desk until it is closed."""

    def __init__(
        self, connection: Connection, robot: Robot, publisher: Publisher, stops: StopRequests, events: EventLog
    ) -> None:
        self.session: Session | None = None
        """The session while the machine is connected."""
        self._connection = connection
        self._robot = robot
        self._publisher = publisher
        self._stops = stops
        self._events = events
        self._closing = Flag()
        self._wake = Flag()
        self._thread = Thread(target=self._run, name="desk", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """End the thread and the connection."""
        self._closing.set()
        self._wake.set()
        self._thread.join()

    def _run(self) -> None:
        told = ""
        while not self._closing.is_set():
            why = "closed"
            try:
                with self._connected() as reports:
                    told = ""
                    self._serve(reports)
            except StepTwinError as error:
                why = str(error)
            self._publisher.disconnected(why)
            if why != told and not self._closing.is_set():
                self._events.error(f"not connected: {why}")
                told = why
            self._closing.wait(_RETRY_S)

    @contextmanager
    def _connected(self) -> Iterator[Reports]:
        bus = open_bus(self._connection)
        with DeskLink(bus, self._connection.title, self._stops, self._publisher.publish) as link:
            session = Session(link, self._robot)
            reports = Reports(link.network, session.machine.axes, self._tell_emergency)
            session.require_present()
            foreign = None if session.streaming else session.foreign_board()
            if foreign:
                raise InputError(foreign)
            self._set_up = set_up_reports(session)
            self._publisher.connected(session, reports)
            self.session = session
            self._events.info(f"connected: {self._connection.title}")
            try:
                yield reports
            finally:
                self.session = None

    def _tell_emergency(self, axis: int, code: int) -> None:
        if code:
            self._events.warning(f"{self._robot.joint_names[axis]}: {error_words(code)}")

    def _serve(self, reports: Reports) -> None:
        assert self.session is not None
        began_s = time.monotonic()
        while not self._closing.is_set():
            self.session.link.wait(_TURN_S)
            if reports.silent and time.monotonic() - began_s > _RETRY_S:
                raise BusError("the machine has fallen silent")
