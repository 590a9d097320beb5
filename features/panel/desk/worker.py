"""The one thread that owns the link: it connects, serves the machine one thing at a time, and connects again."""

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Event as Flag
from threading import Thread, get_ident
from typing import Final

import can

from steptwin.features.panel.desk.jogs import EXPIRED, Press
from steptwin.features.panel.desk.publisher import Publisher
from steptwin.features.panel.desk.reports import ask_once, set_up_reports
from steptwin.features.panel.desk.requests import Order, Work
from steptwin.features.panel.desk.settings import read_settings
from steptwin.features.panel.desk.state import DeskState
from steptwin.features.panel.desk.stops import Stop, StopAskedError, StopRequests
from steptwin.features.panel.desk.words import told
from steptwin.host.client import stopping
from steptwin.host.client.links.bus_link import BusLink, BusNetwork, Connection, open_bus
from steptwin.host.client.waiting import wait_until
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError, StepTwinError
from steptwin.host.operate.inputs_outputs import read_outputs
from steptwin.host.operate.recovering import stop
from steptwin.host.operate.session import Session
from steptwin.protocol import od


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
    """A BusLink on which any function of `host/operate` publishes telemetry and ends when a stop is asked for.

    Attributes:
        publish: called in every wait.
    """

    def __init__(self, bus: can.BusABC, title: str, stops: StopRequests) -> None:
        """Open the link in the worker's thread."""
        super().__init__(bus, title, network=lambda: StoppableNetwork(bus, title, stops))
        self._stops = stops
        self.publish: Callable[[], None] = lambda: None

    def wait(self, dt_s: float) -> None:
        """Sleep and publish; raise StopAskedError if the worker must stop, BusError if the bus has failed."""
        super().wait(dt_s)
        self.publish()
        self._stops.check()


_TURN_S: Final = 0.01
"""Longest time until an idle worker looks round."""
_SLOWLY_S: Final = 1.0
"""Period of the questions about what no node reports by itself."""
_HELD_S: Final = 0.5
"""Longest wait for the reports that drives are held, once they are."""
_SIMULATED: Final = "SIMULATED"
"""Word in an emulated board's device name (1008h)."""


class ConnectedMachine:
    """A machine that is connected; everything here happens in the worker's thread."""

    def __init__(self, link: DeskLink, state: DeskState) -> None:
        self._link = link
        self._state = state
        self.session: Session = Session(link, state.robot)
        self.publisher: Publisher = Publisher(self.session, state)
        state.runs.listen(self.session)
        self._slow_questions_s = float("-inf")
        self._often = self._read = False
        """True once the nodes report often, and once settings and the like have been read."""

    def begin(self, title: str, *, force: bool) -> None:
        """Make a stop that waits before anything else; then show the machine, which must be there and this robot's.

        Raises:
            StopAskedError: as `make_stop`.
            BusError: as `make_stop`; an axis is missing, or the board carries another robot's name, unless forced.
        """
        self.make_stop()
        self.session.require_present()
        foreign = None if force or self.session.streaming else self.session.foreign_board()
        if foreign:
            raise BusError(f"{foreign}; --force goes on all the same").plainly(f"{foreign.axis} {foreign.why}")
        state = self._state
        state.reports, state.session = self.publisher.reports, self.session
        state.shown.void("the machine was connected again")
        self._link.publish = self._follow
        state.events.info(f"connected: {title}")

    def _follow(self) -> None:
        """Publish, and tend the speed of a trajectory, in every wait."""
        self.publisher.publish()
        self._state.speed.tend(self.session.machine)

    def turn(self) -> None:
        """Stop if that is asked for; then carry out a command, or jog, or wait.

        Raises:
            StopAskedError: a stop is asked for; the next turn makes it.
            BusError: the connection is lost.
        """
        self.make_stop()
        wanted = self._state.take()
        if wanted is None:
            self._link.wait(_TURN_S)
            self._ask_slowly()
        elif isinstance(wanted, Press):
            self._jog(wanted)
        else:
            self._carry_out(wanted)

    @contextmanager
    def _telling(self, name: str) -> Iterator[list[str]]:
        """Tell in the events how the block fails, and in the list that is yielded; then the worker does nothing."""
        events, failures = self._state.events, list[str]()
        try:
            yield failures
        except (InputError, DeviceFaultError, BusError) as error:
            failures.append(f"{name}: {told(error)}")
            events.error(failures[0])
        except StopAskedError as asked:
            events.warning(f"{name}: {asked}")
            raise
        finally:
            self._state.end()

    def _carry_out(self, order: Order) -> None:
        state, command, title = self._state, order.command, order.command.title
        with self._telling(title), self.session.one_action():
            seen_s = state.shown.require(order.shown)

            def progress(fraction: float) -> None:
                state.begin(title, fraction, self.session.machine.waits_for)

            text = command.perform(Work(self.session, state.limits, state.events, state.runs, progress, seen_s))
            self._slow_questions_s = float("-inf")
            self._read = self._read and not command.changes_settings
            if text:
                state.events.info(f"{title}: {text}" if title not in text else text)

    def _jog(self, press: Press) -> None:
        """Jog until the button is released; whatever else ends the jog ends the press too."""
        presses, events, title = self._state.presses, self._state.events, press.jog.title

        def released() -> bool:
            return presses.present is not press

        why = f"{title}: stopped"
        try:
            with self._telling(title) as failures, self.session.one_action():
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

    # --- stops

    def make_stop(self) -> None:
        """Make the stop that is asked for, if any.

        Raises:
            StopAskedError: meanwhile a greater stop is asked for.
            BusError: an emergency stop has found a node that does not answer; it is still to be made.
        """
        asked = self._state.stops.answer()
        if asked is Stop.NONE:
            return
        if asked is Stop.EMERGENCY:
            self._hold()
        elif asked is Stop.STOP:
            with self._telling("stop"):
                stop(self.session)
        self._state.stops.done(asked)

    def _hold(self) -> None:
        """Hold all drives until a reset."""
        axes, link = self.session.machine.axes, self.session.link
        try:
            stopping.emergency_stop(link, axes)
        except DeviceFaultError as error:
            self._state.events.error(f"emergency stop: {told(error)}")
            return
        wait_until(link, lambda: all(axis.in_fault for axis in axes), _HELD_S)
        self._state.events.warning("emergency stop: all drives are off and held until a reset")

    # --- what no node reports by itself

    def _ask_slowly(self) -> None:
        """Ask for what is not reported, from time to time while nothing moves: questions disturb who streams."""
        session, now_s = self.session, time.monotonic()
        if now_s - self._slow_questions_s < _SLOWLY_S or session.streaming:
            return
        self._slow_questions_s = now_s
        state = self._state
        try:
            self._often = self._often or set_up_reports(session)
            if not self._read:
                ask_once(session, self.publisher.reports)
                state.simulated = _SIMULATED in session.machine.axes[0].read_text(od.DEVICE_NAME)
                state.limits.settings = read_settings(session, state.limits)
                self._read = True
            state.outputs = read_outputs(session)
        except InputError:
            return  # a trajectory has begun meanwhile
        except DeviceFaultError as error:
            self._state.events.warning(told(error))


_RETRY_S: Final = 0.3
"""Time between two attempts to connect."""
_LOST_S: Final = 1.0
"""Silence after which the worker connects anew."""

_LOGGER: Final = logging.getLogger(__name__)


class Worker:
    """Connects to the machine and serves it until it is closed; everything that waits for the bus happens here."""

    def __init__(self, connection: Connection, state: DeskState, *, force: bool) -> None:
        """Start the thread."""
        self._connection = connection
        self._state = state
        self._force = force
        self._closing = Flag()
        self._thread = Thread(target=self._run, name="desk", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop what the worker makes the machine do, and end the thread and the connection."""
        self._closing.set()
        if self._state.activity is not None:
            self._state.stops.ask(Stop.STOP)
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
            self._state.disconnected(why)
            if why != last and not self._closing.is_set():
                self._state.events.error(f"not connected: {why}")
                last = why
            self._closing.wait(_RETRY_S)

    @contextmanager
    def _connected(self) -> Iterator[ConnectedMachine]:
        """Open the bus while the block runs."""
        title, state = self._connection.title, self._state
        link = DeskLink(open_bus(self._connection), title, state.stops)
        with link:
            connected = ConnectedMachine(link, state)
            connected.begin(title, force=self._force)
            try:
                yield connected
            finally:
                state.session = state.reports = None
                state.presses.end("the connection is lost")
                state.drop()
                connected.publisher.tell_emergencies()

    def _serve(self, connected: ConnectedMachine) -> None:
        """Serve the machine until the worker is closed; raise BusError when the connection is lost."""
        began_s = time.monotonic()
        while not self._closing.is_set():
            with suppress(StopAskedError):  # which the next turn makes
                connected.turn()
            if time.monotonic() - max(connected.publisher.reports.heard_s, began_s) > _LOST_S:
                raise BusError(f"{self._connection.title}: the machine has fallen silent")
