"""The connected machine: all work that waits for the bus, in the service's thread."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import get_ident
from typing import TYPE_CHECKING, Final, NamedTuple

import can

from steptwin.features.panel.service.commands import Work
from steptwin.features.panel.service.guards import EXPIRED, Press, Stop, StopRequestedError, StopRequests
from steptwin.features.panel.service.messages import operator_message
from steptwin.features.panel.service.snapshots import Publisher
from steptwin.features.panel.service.telemetry import set_up_reports
from steptwin.host.client import Machine, stopping
from steptwin.host.client.links.bus_link import BusLink, BusNetwork
from steptwin.host.client.pausing import change_speed, present_speed_percent
from steptwin.host.client.waiting import wait_until
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError
from steptwin.host.operate.inputs_outputs import read_outputs
from steptwin.host.operate.recovering import stop
from steptwin.host.operate.session import Session
from steptwin.protocol import od

if TYPE_CHECKING:
    from steptwin.features.panel.service.service import MachineService, Order


class StoppableNetwork(BusNetwork):
    """A network on which the thread that opened it sends no frame after a request to stop; other threads may."""

    def __init__(self, bus: can.BusABC, title: str, stops: StopRequests) -> None:
        super().__init__(bus, title)
        self._stops = stops
        self._thread = get_ident()

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame; raise StopRequestedError in the service's thread if it must stop, BusError if the bus fails."""
        if get_ident() != self._thread:
            super().send_message(can_id, data, remote)
            return
        with self._stops.sending():
            super().send_message(can_id, data, remote)


class ServiceLink(BusLink):
    """A BusLink that publishes telemetry during any function of `host/operate`, and ends it on a request to stop.

    Attributes:
        publish: called in each wait.
    """

    def __init__(self, bus: can.BusABC, title: str, stops: StopRequests) -> None:  # in the service's thread
        super().__init__(bus, title, network=lambda: StoppableNetwork(bus, title, stops))
        self._stops = stops
        self.publish: Callable[[], None] = lambda: None

    def wait(self, dt_s: float) -> None:
        """Sleep and publish; raise StopRequestedError if the thread must stop, BusError if the bus has failed."""
        super().wait(dt_s)
        self.publish()
        self._stops.check()


_SPEED_PERIOD_S: Final = 0.3
"""Period of queries of the present speed while a trajectory runs."""
_PLANNED_PERCENT: Final = 100


class _WantedSpeed(NamedTuple):
    """A requested speed, and the number of the newest state that its page had shown."""

    percent: int
    shown: int


class RunSpeed:
    """Speed override in percent of the planned speed; any thread may request or read it.

    Attributes:
        percent: last speed read, 0 in a pause; None without a trajectory.
    """

    def __init__(self, service: "MachineService") -> None:
        self.percent: float | None = None
        self._service = service
        self._wanted: _WantedSpeed | None = None
        self._tending = False
        self._read_s = float("-inf")

    def ask(self, percent: int, shown: int) -> None:
        """Request a percentage of the planned speed; the service's thread sets it in its next wait."""
        self._wanted = _WantedSpeed(percent, shown)

    def drop(self) -> None:
        self._wanted = None

    def tend(self, machine: Machine) -> None:
        """Set a requested speed, and read the speed from time to time, in the service's thread.

        A request that comes too late, or after a stop, is refused like a command, with a line in the events.
        """
        if self._tending:  # a query waits itself
            return
        if not any(axis.interpolating for axis in machine.axes):
            self.percent = self._wanted = None
            return
        wanted, self._wanted = self._wanted, None
        if wanted is None and time.monotonic() - self._read_s < _SPEED_PERIOD_S:
            return
        service = self._service
        self._tending = True
        try:
            if wanted is not None:
                service.shown.require(wanted.shown)
                change_speed(machine, wanted.percent)
                service.events.info(f"speed: {wanted.percent} % of the planned one")
            self.percent = present_speed_percent(machine.axes)
        except (InputError, DeviceFaultError, BusError) as error:
            service.events.error(f"speed: {operator_message(error)}")
        finally:
            self._tending, self._read_s = False, time.monotonic()
        if max(self.percent or 0, wanted.percent if wanted else 0) > _PLANNED_PERCENT:
            service.runs.note_faster()


_TURN_S: Final = 0.01
"""Longest wait of an idle thread."""
_SLOWLY_S: Final = 1.0
"""Period of queries for values that no node reports by itself."""
_HELD_S: Final = 0.5
"""Longest wait for reports that drives are held, once they are."""
_SIMULATED: Final = "SIMULATED"
"""Text in an emulated board's device name (1008h)."""


class ConnectedMachine:
    """A connected machine; it does one thing at a time."""

    def __init__(self, link: ServiceLink, service: "MachineService") -> None:
        self._link = link
        self._service = service
        self.session: Session = Session(link, service.robot)
        self.publisher: Publisher = Publisher(self.session, service)
        service.runs.listen(self.session)
        self._slow_questions_s = float("-inf")
        self._often = self._read = False  # True once nodes report often, and once settings and the like are read

    def begin(self, title: str, *, force: bool) -> None:
        """Make a pending stop, then publish the machine; it must be present and this robot's.

        Raises:
            StopRequestedError: as `make_stop`.
            BusError: as `make_stop`; or an axis is missing, or the board has another robot's name, unless forced.
        """
        self.make_stop()
        self.session.require_present()
        foreign = None if force or self.session.streaming else self.session.foreign_board()
        if foreign:
            raise BusError(f"{foreign}; --force goes on all the same").plainly(f"{foreign.axis} {foreign.why}")
        service = self._service
        service.telemetry, service.session = self.publisher.telemetry, self.session
        service.shown.void("the machine was connected again")

        def follow() -> None:
            self.publisher.publish()
            service.speed.tend(self.session.machine)

        self._link.publish = follow
        service.events.info(f"connected: {title}")

    def turn(self) -> None:
        """Make a requested stop; then execute a command, or jog, or wait.

        Raises:
            StopRequestedError: a stop is requested; the next turn makes it.
            BusError: the connection is lost.
        """
        self.make_stop()
        wanted = self._service.take()
        if wanted is None:
            self._link.wait(_TURN_S)
            self._ask_slowly()
        elif isinstance(wanted, Press):
            self._jog(wanted)
        else:
            self._carry_out(wanted)

    @contextmanager
    def _reporting(self, name: str) -> Iterator[list[str]]:
        """Log an error of the block and append it to the yielded list; the service is idle afterwards."""
        events, failures = self._service.events, list[str]()
        try:
            yield failures
        except (InputError, DeviceFaultError, BusError) as error:
            failures.append(f"{name}: {operator_message(error)}")
            events.error(failures[0])
        except StopRequestedError as asked:
            events.warning(f"{name}: {asked}")
            raise
        finally:
            self._service.end()

    def _carry_out(self, order: "Order") -> None:
        service, command, title = self._service, order.command, order.command.title
        with self._reporting(title), self.session.one_action():
            seen_s = service.shown.require(order.shown)

            def progress(fraction: float) -> None:
                service.begin(title, fraction, self.session.machine.waits_for)

            text = command.perform(Work(self.session, service.limits, service.events, service.runs, progress, seen_s))
            self._slow_questions_s = float("-inf")
            if text:
                service.events.info(f"{title}: {text}" if title not in text else text)

    def _jog(self, press: Press) -> None:
        """Jog until the button is released; any other end of the jog ends the press, too."""
        presses, events, title = self._service.presses, self._service.events, press.jog.title

        def released() -> bool:
            return presses.present is not press

        why = f"{title}: stopped"
        try:
            with self._reporting(title) as failures, self.session.one_action():
                moved, at_end = press.jog.perform(self.session, released)
                if not (moved or at_end) and press.in_vain:
                    events.error(press.in_vain)
                elif press.over == EXPIRED:
                    events.warning(f"{title}: {EXPIRED}")
                why = f"{title}: at the end of its travel"
                if at_end:
                    events.info(why)
        finally:
            if not released():
                presses.end(failures[0] if failures else why)

    def make_stop(self) -> None:
        """Make the requested stop, if any.

        Raises:
            StopRequestedError: a greater stop was requested meanwhile.
            BusError: a node did not answer an emergency stop; it is still to be made.
        """
        asked = self._service.stops.answer()
        if asked is Stop.NONE:
            return
        if asked is Stop.EMERGENCY:
            self._hold()
        elif asked is Stop.STOP:
            with self._reporting("stop"):
                stop(self.session)
        self._service.stops.done(asked)

    def _hold(self) -> None:
        axes, link = self.session.machine.axes, self.session.link
        try:
            stopping.emergency_stop(link, axes)
        except DeviceFaultError as error:
            self._service.events.error(f"emergency stop: {operator_message(error)}")
            return
        wait_until(link, lambda: all(axis.in_fault for axis in axes), _HELD_S)
        self._service.events.warning("emergency stop: all drives are off and held until a reset")

    def _ask_slowly(self) -> None:
        """Query values that no node reports, from time to time at standstill: queries disturb streams."""
        session, now_s, service = self.session, time.monotonic(), self._service
        if now_s - self._slow_questions_s < _SLOWLY_S or session.streaming:
            return
        self._slow_questions_s = now_s
        try:
            self._often = self._often or set_up_reports(session)
            if not self._read:
                self.publisher.telemetry.ask_once(session)
                service.simulated = _SIMULATED in session.machine.axes[0].read_text(od.DEVICE_NAME)
                service.limits.read(session)
                self._read = True
            service.outputs = read_outputs(session)
        except InputError:
            return  # a trajectory has begun meanwhile
        except DeviceFaultError as error:
            service.events.warning(operator_message(error))
