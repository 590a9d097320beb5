"""The one thread that owns the link: it connects, watches, does one thing at a time, and connects again."""

import logging
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from threading import Event as Flag
from threading import Lock, Thread
from typing import Final

from steptwin.host.client import stopping
from steptwin.host.client.bus_link import Connection, open_bus
from steptwin.host.client.waiting import wait_until
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError, StepTwinError
from steptwin.host.operate.jogging import jog
from steptwin.host.operate.recovering import stop
from steptwin.host.operate.session import Session
from steptwin.host.operate.switching import read_outputs
from steptwin.host.operate.tool_jogging import jog_tool
from steptwin.host.panel.desk.actions import ACTIONS, Doing
from steptwin.host.panel.desk.commands import AGE_MAX_S, Command, JointJog
from steptwin.host.panel.desk.events import EventLog
from steptwin.host.panel.desk.link import DeskLink
from steptwin.host.panel.desk.presses import Press, Presses
from steptwin.host.panel.desk.publisher import Publisher
from steptwin.host.panel.desk.refused import RefusedError
from steptwin.host.panel.desk.reports import Reports, ask_once, set_up_reports
from steptwin.host.panel.desk.results import Results
from steptwin.host.panel.desk.settings import Setting, read_settings
from steptwin.host.panel.desk.snapshot import Activity
from steptwin.host.panel.desk.stops import Stop, StopAskedError, StopRequests
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od

_TURN_S: Final = 0.01
"""Longest time until an idle worker looks round."""
_RETRY_S: Final = 0.3
"""Time between two attempts to connect."""
_LOST_S: Final = 1.0
"""Silence after which the worker connects anew."""
_SLOWLY_S: Final = 1.0
"""Period of the questions about what no node reports by itself."""
_HELD_S: Final = 0.5
"""Longest wait for the reports that drives are held, once they are."""

_SIMULATED: Final = "SIMULATED"
"""What an emulated board's device name (1008h) says."""

_LOGGER: Final = logging.getLogger(__name__)


class Worker:
    """Connects to the machine and serves the desk until it is closed.

    Everything that waits for the bus happens in its thread. `session` and `robot` may be read by any thread.
    """

    def __init__(
        self,
        connection: Connection,
        robot: Robot,
        publisher: Publisher,
        presses: Presses,
        stops: StopRequests,
        events: EventLog,
        results: Results,
        *,
        force: bool,
    ) -> None:
        self.session: Session | None = None
        """The session while the machine is connected."""
        self.robot = robot
        """The robot with the limits that the settings have now."""
        self.settings: tuple[Setting, ...] = ()
        self._file = robot
        self._connection = connection
        self._publisher = publisher
        self._presses = presses
        self._stops = stops
        self._events = events
        self._results = results
        self._force = force
        self._jogging = False
        self._asked: Command | None = None
        self._asked_lock = Lock()
        self._asked_slowly_s = float("-inf")
        self._set_up = self._read_once = False
        """Whether the nodes report often, and whether settings and the like have been read."""
        self._closing = Flag()
        self._thread = Thread(target=self._run, name="desk", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """Stop what the worker makes the machine do, and end the thread and the connection."""
        self._closing.set()
        if self.activity is not None:
            self._stops.ask(Stop.STOP)
        self._thread.join()

    def take(self, command: Command) -> None:
        """Take a command to carry out next; raise RefusedError if another one waits or is carried out."""
        with self._asked_lock:
            activity, name = self.activity, ACTIONS[type(command)].title(command)
            if activity is not None:
                raise RefusedError(f"{name}: busy: {activity.name}")
            self._asked = command
            self._begin(name, 0.0)

    @property
    def activity(self) -> Activity | None:
        """What the worker makes the machine do."""
        return self._publisher.known.activity

    @property
    def jogging(self) -> bool:
        """True while the worker jogs."""
        return self._jogging

    # --- connecting

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
            except StopAskedError:
                continue  # while connecting: stop first
            except Exception as error:  # a fault of this program: nobody may be left without a desk
                _LOGGER.exception("the desk's worker has failed")
                why = f"internal error: {error}"
            self._publisher.disconnected(why)
            if why != told and not self._closing.is_set():
                self._events.error(f"not connected: {why}")
                told = why
            self._closing.wait(_RETRY_S)

    @contextmanager
    def _connected(self) -> Iterator[Reports]:
        bus = open_bus(self._connection)
        with DeskLink(bus, self._connection.title, self._stops, self._publisher.publish) as link:
            session = Session(link, self.robot)
            self._make_stop(session)
            reports = Reports(link.network, session.machine.axes, self._publisher.emergency)
            session.require_present()
            foreign = None if self._force or session.streaming else session.foreign_board()
            if foreign:
                raise InputError(f"{foreign}; --force goes on all the same")
            self._asked_slowly_s = float("-inf")
            self._set_up = self._read_once = False
            self._publisher.connected(session, reports)
            self.session = session
            self._events.info(f"connected: {self._connection.title}")
            try:
                yield reports
            finally:
                self.session = None
                self._presses.end("the connection is lost")
                with self._asked_lock:
                    self._asked = self._publisher.known.activity = None

    def _serve(self, reports: Reports) -> None:
        """Look round until the worker is closed; raise BusError when the connection is lost."""
        session = self.session
        assert session is not None
        began_s = time.monotonic()
        while not self._closing.is_set():
            with suppress(StopAskedError):  # which the next turn makes
                self._make_stop(session)
                self._turn(session, reports)
            if time.monotonic() - max(reports.heard_s, began_s) > _LOST_S:
                raise BusError(f"{self._connection.title}: the machine has fallen silent")

    def _turn(self, session: Session, reports: Reports) -> None:
        """Do what is asked for, or wait."""
        with self._asked_lock:
            command, self._asked = self._asked, None
            press = self._presses.present if command is None else None
            if press is not None:
                self._begin(f"jog {press.jog.name}", None)
        if command is not None:
            self._carry_out(session, command)
        elif press is not None:
            self._jog(session, press)
        else:
            session.link.wait(_TURN_S)
            self._ask_slowly(session, reports)

    # --- what is done

    def _begin(self, name: str, fraction: float | None) -> None:
        self._publisher.known.activity = Activity(name, fraction, paused=False, pausable=False)

    @contextmanager
    def _telling(self, name: str) -> Iterator[None]:
        """Tell in the events how the block fails, then let the machine be idle."""
        try:
            yield
        except (InputError, DeviceFaultError, BusError) as error:
            self._events.error(f"{name}: {error}")
        except StopAskedError as asked:
            self._events.warning(f"{name}: {asked}")
            raise
        finally:
            self._publisher.known.activity = None

    def _carry_out(self, session: Session, command: Command) -> None:
        action = ACTIONS[type(command)]
        name = action.title(command)
        with self._telling(name):
            age_s = time.monotonic() - command.asked_s
            if age_s > AGE_MAX_S:
                raise RefusedError(f"dropped, since it is {age_s:.1f} s old")
            doing = Doing(
                session,
                self._file,
                lambda fraction: self._begin(name, fraction),
                self._switched,
                self._limited,
                self._results,
            )
            text = action.perform(doing, command)
            self._asked_slowly_s = float("-inf")
            if text:
                self._events.info(f"{name}: {text}" if name not in text else text)

    def _jog(self, session: Session, press: Press) -> None:
        """Jog until the button is released; whatever else ends the jog ends the press too."""
        wanted = press.jog

        def released() -> bool:
            return not self._presses.holds(press)

        name = f"jog {wanted.name}"
        self._jogging = True
        why = f"{name}: it has failed, see the events"
        try:
            with self._telling(name):
                if isinstance(wanted, JointJog):
                    at_end = jog(session, wanted.joint, wanted.speed, None, until=released).at_limit
                else:
                    at_end = jog_tool(session, wanted.coordinate, wanted.speed, released).at_end
                why = f"{name}: at the end of its travel"
                if at_end:
                    self._events.info(why)
        finally:
            self._jogging = False
            if not released():
                self._presses.end(why)

    def _make_stop(self, session: Session) -> None:
        """Make the stop that is asked for, if any; a lost connection leaves an emergency stop to be made later."""
        asked = self._stops.answer()
        if asked is Stop.NONE:
            return
        if asked is Stop.EMERGENCY:
            self._hold(session)
        else:
            with self._telling("stop"):
                stop(session)
        self._stops.done(asked)

    def _hold(self, session: Session) -> None:
        """Hold all drives until a reset; raise BusError if one does not answer."""
        try:
            stopping.emergency_stop(session.link, session.machine.axes)
        except DeviceFaultError as error:
            self._events.error(f"emergency stop: {error}")
            return
        axes = session.machine.axes
        wait_until(session.link, lambda: all(axis.in_fault for axis in axes), _HELD_S)
        self._events.warning("emergency stop: all drives are off and held until a reset")

    def _switched(self, outputs: Mapping[str, bool]) -> None:
        self._publisher.known.outputs = outputs

    def _limited(self, robot: Robot) -> None:
        assert self.session is not None
        self.robot = self.session.robot = robot
        self._read_once = False

    # --- what no node reports by itself

    def _ask_slowly(self, session: Session, reports: Reports) -> None:
        """Ask for what is not reported, from time to time while nothing moves; SDO disturbs who streams."""
        now_s, known = time.monotonic(), self._publisher.known
        if now_s - self._asked_slowly_s < _SLOWLY_S or session.streaming:
            return
        self._asked_slowly_s = now_s
        try:
            if not self._set_up:
                self._set_up = set_up_reports(session)
            if not self._read_once:
                ask_once(session, reports)
                known.simulated = _SIMULATED in session.machine.axes[0].read_text(od.DEVICE_NAME)
                self.settings = read_settings(session, self._file)
                self._read_once = True
            known.outputs = read_outputs(session)
        except InputError:
            return  # a trajectory has begun meanwhile
        except DeviceFaultError as error:
            self._events.warning(str(error))
