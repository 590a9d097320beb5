"""The machine service: states and requests of pages, and the one thread that owns the bus. One in a process."""

import logging
import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from threading import Event as Flag
from threading import Lock, Thread
from typing import Final, NamedTuple

from steptwin.features.panel.service.commands import Command, Jog, Request
from steptwin.features.panel.service.connected import ConnectedMachine, RunSpeed, ServiceLink
from steptwin.features.panel.service.guards import (
    OperatorPlace,
    Press,
    Presses,
    ShownStates,
    Stop,
    StopRequestedError,
    StopRequests,
)
from steptwin.features.panel.service.history import Drawing, EventLog, History
from steptwin.features.panel.service.messages import RefusedError, operator_message
from steptwin.features.panel.service.results import Result, RunResults
from steptwin.features.panel.service.settings import MachineSettings, Setting
from steptwin.features.panel.service.snapshots import Activity, BoardFigures, Snapshot
from steptwin.features.panel.service.telemetry import SILENT_S, Telemetry
from steptwin.host.client.axis import AxisClient
from steptwin.host.client.control_client import ControlClient
from steptwin.host.client.links.bus_link import Connection, open_bus
from steptwin.host.client.pausing import check_speed, send_pause, send_resume
from steptwin.host.client.stopping import UNSURE, send_quick_stop
from steptwin.host.common.errors import BusError, InputError, StepTwinError
from steptwin.host.common.processes import ClockStood, Slowness
from steptwin.host.operate.session import Session
from steptwin.host.robots.robot import Robot

_LOGGER: Final = logging.getLogger(__name__)
_SILENT: Final = f"no report from the machine for {SILENT_S:g} s"
_RETRY_S: Final = 0.3
"""Time between two attempts to connect."""
_LOST_S: Final = 1.0
"""Silence until the thread reconnects."""


class Order(NamedTuple):
    """A command, and the number of the newest state that its page had shown."""

    command: Command
    shown: int


class MachineService:
    """A machine that any number of pages watch and one of them operates; thread-safe, and no call waits for the bus.

    A page is a client with a name of its own. It reads `snapshot`, `history`, `events`, `drawing`, `settings` and
    `results`. To move the machine it becomes the operator (`operator.take`), then requests commands or holds a jog by
    beats. Every client may stop at any time.

    All threads write `events` and `drawing`. The service's thread alone writes `latest` (newest published snapshot),
    `session` and `telemetry` (None while not connected), `outputs` (last read), `activity` (its present work) and
    `simulated`. `emergency_stopped` is True from an emergency stop until the reset.
    """

    def __init__(
        self, connection: Connection, robot: Robot, *, control: tuple[str, int] | None = None, force: bool = False
    ) -> None:
        """Create the service of a machine with this robot's file; `start` connects it.

        Args:
            connection: the bus.
            robot: the machine on it.
            control: host and port of a served board's control port, for its load and lateness; None without one.
            force: True to accept a board with another robot's name.
        """
        self.events: EventLog = EventLog()
        self.history: History = History(len(robot.joints))
        self.drawing: Drawing = Drawing()
        self.runs: RunResults = RunResults()
        self.limits: MachineSettings = MachineSettings(robot, robot)
        self.operator: OperatorPlace = OperatorPlace(self.events, self._change_operator)
        self.shown: ShownStates = ShownStates()
        self.presses: Presses = Presses(self.events.error)
        self.stops: StopRequests = StopRequests()
        self.speed: RunSpeed = RunSpeed(self)
        self.session: Session | None = None
        self.telemetry: Telemetry | None = None
        self.latest: Snapshot = Snapshot()
        self.activity: Activity | None = None
        self.emergency_stopped = False
        self.simulated: bool | None = None
        self.outputs: Mapping[str, bool] = {}
        self.board_figures: BoardFigures = BoardFigures()
        self._connection, self._force = connection, force
        self._order: Order | None = None
        self._why_not_logged = ""
        self._lock = Lock()
        self._closing = Flag()
        self._threads = [Thread(target=self._run, name="machine service", daemon=True)]
        if control is not None:
            follow = ControlClient(*control)
            self._threads.append(Thread(target=self._follow_board, args=(follow,), name="board figures", daemon=True))

    def start(self) -> None:
        """Connect, repeatedly until `close`."""
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Close the connection; the service's own motions stop first."""
        self._closing.set()
        if self.activity is not None:
            self.stops.ask(Stop.STOP)
        for thread in self._threads:
            thread.join()

    # --- states for pages

    @property
    def robot(self) -> Robot:
        """The machine with the limits of the present settings; plan for this one."""
        return self.limits.robot

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Settings as last read; empty before the first connection."""
        return self.limits.settings

    @property
    def results(self) -> tuple[Result, ...]:
        """Last ended runs, the newest last."""
        return self.runs.all()

    @property
    def snapshot(self) -> Snapshot:
        """Present state of the machine; a new one comes at least 30 times a second while it moves.

        It is not connected if the axes have been silent since.
        """
        latest, own, holder = self.latest, self.activity, self.operator.holder
        activity = latest.activity  # the activity may have changed since it was published
        if own is None or activity is None or activity.name != own.name:
            activity = own or (activity if activity and activity.foreign else None)
        lost = latest.connected and (self.telemetry is None or self.telemetry.silent)
        return replace(
            latest,
            operator=holder.name if holder else None,
            emergency_stopped=self.emergency_stopped,
            connected=latest.connected and not lost,
            why_not=_SILENT if lost else latest.why_not,
            activity=None if lost else activity,
        )

    # --- requests of the operator

    def require_shown(self, name: str, shown: int | None) -> None:
        """Raise RefusedError, with the reason, if the requesting page has not shown the present state.

        `name` is the request's title, `shown` the number of the newest snapshot that the page had shown then.
        """
        try:
            self.shown.require(shown)
        except RefusedError as error:
            raise RefusedError(f"{name}: {error}") from error

    def ask(self, client: str, command: Command, shown: int | None) -> None:
        """Request a command; return at once. Its result appears in `events`, and in `results` for a run.

        Args:
            client: the page.
            command: the command.
            shown: number of the newest snapshot that the page had shown then; None before the first.

        Raises:
            RefusedError: with the reason; nothing happens. The client is not the operator; the command comes more than
                a second late, or from before a stop, a reset, or another operator or connection; it is invalid; the
                machine is not connected, is busy, is held by an emergency stop, or not homed.
        """
        self.operator.require(client)
        self._require(command, shown)
        assert shown is not None
        if self.presses.present is not None:
            raise RefusedError(f"{command.title}: a jog button is held")
        self.order(Order(command, shown))

    def beat(self, client: str, press: int, jog: Jog, shown: int | None) -> None:
        """Begin a jog or extend it: call this when a button is pressed and every 80 ms (`guards.BEAT_S`) after that.

        The machine stops 250 ms (`guards.LEASE_S`) after the last beat. Each press has a number, greater than all
        before on this client; an ended press stays ended. `shown` is the number of the newest snapshot that the page
        had shown when it sent the beat.

        Raises:
            RefusedError: with the reason, as `ask`, or because the press has ended; nothing moves.
        """
        self.operator.require(client)
        if not self.presses.is_present(client, press):
            self.presses.require_new(client, press)
            self._require(jog, shown)
        else:
            try:
                self.shown.require_young(shown)
            except RefusedError as error:  # the release would be late, too
                late = f"{jog.title}: {error}"
                self.presses.end(late)
                raise RefusedError(late) from error
        self.presses.beat(client, press, jog)

    def release(self, client: str, press: int) -> str | None:
        """End a jog when the button is released, or the page is left or loses the focus. Never raises.

        Return why the jog had ended before; None if it had not.
        """
        return self.presses.release(client, press)

    def resume(self, client: str, shown: int | None) -> None:
        """Continue a paused trajectory; raise RefusedError as `ask`, or if none is paused."""
        send_resume(self._running(client, "resume", "resume", shown))
        self.events.info("resumed")

    def change_speed(self, client: str, percent: int, shown: int | None) -> None:
        """Request a speed of the running trajectory, in percent of its planned speed; return at once.

        Raise RefusedError as `resume`, or for a speed that no motion may have. If the motion's own limits do not allow
        the speed, `events` has a line about it.
        """
        self._running(client, "speed", "make slower or faster", shown)
        assert shown is not None
        try:
            check_speed(percent)
        except InputError as error:
            raise RefusedError(operator_message(error)) from error
        self.speed.ask(percent, shown)

    def _running(self, client: str, name: str, what: str, shown: int | None) -> Sequence[AxisClient]:
        """Return the axes of the trajectory that the operator may change; raise RefusedError without one."""
        self.operator.require(client)
        self.require_shown(name, shown)
        if self.emergency_stopped:
            raise RefusedError(f"{name}: the machine is held by an emergency stop")
        return self._executing(what)

    def _executing(self, what: str) -> Sequence[AxisClient]:
        """Return the axes that execute a trajectory, moving or not; raise RefusedError without one."""
        session = self.session
        axes = [axis for axis in session.machine.axes if axis.interpolating] if session else []
        if not axes:
            raise RefusedError(f"nothing to {what}: no trajectory runs")
        return axes

    def _require(self, request: Request, shown: int | None) -> None:
        """Raise RefusedError, with the first reason, if the machine cannot execute a request now."""
        name, snapshot = request.title, self.snapshot
        if not snapshot.connected:
            raise RefusedError(f"{name}: not connected: {snapshot.why_not}")
        if request.needs_drives and snapshot.emergency_stopped:
            raise RefusedError(f"{name}: the machine is held by an emergency stop: reset it first")
        activity = snapshot.activity
        if activity is not None and not (request.jogs and activity.jogging):
            raise RefusedError(_busy(name, activity.name))
        drives = snapshot.drives if request.needs_drives else ()
        for joint in drives:
            if joint.error is not None:
                raise RefusedError(f"{name}: {joint.name} is in fault, {joint.error}: reset it first")
        for joint in drives:
            if joint.hindrance is not None:
                raise RefusedError(f"{name}: {joint.name}: {joint.hindrance}")
        unknown = [joint.name for joint in snapshot.joints if not joint.homed]
        if request.needs_homed and unknown:
            raise RefusedError(f"{name}: {', '.join(unknown)} not homed: home the machine first")
        self.require_shown(name, shown)
        try:
            request.check(self.limits, [joint.position for joint in snapshot.joints])
        except InputError as error:
            raise RefusedError(operator_message(error)) from error

    def _change_operator(self) -> None:
        self.shown.void("the operator changed")
        self.presses.end("another client operates the machine")

    # --- requests of any client at any time

    def pause(self, by: str = "a client") -> None:
        """Pause the running trajectory on its path; raise RefusedError without one."""
        send_pause(self._executing("pause"))
        self.events.info(f"paused by {by}")

    def stop(self, by: str = "a client", press: str | None = None) -> bool:
        """Stop all axes together; they hold their positions. Arguments and result are those of `emergency_stop`."""
        self.shown.void("a stop came")
        self.presses.end("stopped")
        self.drop()  # first, otherwise the trajectory could continue after the stop
        if self.session is None:
            self.events.error(f"stop by {by}: not connected; {UNSURE}")
            return False  # the press is unknown then: its later copy stops the machine
        if press is not None and not self.stops.is_new(press):
            return self.snapshot.connected
        self.stops.ask(Stop.STOP)
        self.events.warning(f"stop by {by}")
        return self.snapshot.connected

    def emergency_stop(self, by: str = "a client", press: str | None = None) -> bool:
        """Stop all axes at once and switch their power off, until a reset.

        The calling thread sends the quick stop. Without a connection it is made at the next connection.

        Args:
            by: name for the events.
            press: name of the press of a button. A page repeats a press, by two paths, until it has an answer: the
                first copy stops the machine, and the others change nothing, even after a reset.

        Returns:
            True if the machine was connected and has received the stop.
        """
        if press is not None and not self.stops.is_new(press):
            return self.snapshot.connected
        self.emergency_stopped = True
        self.shown.void("an emergency stop came")
        self.drop()
        self.stops.ask(Stop.EMERGENCY)
        self.presses.end("emergency stop")
        session = self.session
        try:
            if session is None:
                raise BusError("not connected")
            send_quick_stop(session.link, session.machine.axes)
        except BusError as error:
            self.events.error(f"emergency stop by {by}: {operator_message(error)}; {UNSURE}")
            return False
        self.events.error(f"emergency stop by {by}")
        return self.snapshot.connected

    def gone(self, client: str) -> None:
        """Remove a client whose page is closed forever: its jog ends, and it no longer operates the machine."""
        self.operator.give_up(client)
        self.presses.forget(client)

    # --- work of the service's thread

    def begin(self, name: str, fraction: float | None, waits_for: str = "") -> None:
        """Set the present activity: fraction done, None for a jog without an end, and the input that it waits for."""
        self.activity = Activity(name, fraction, waits_for=waits_for)

    def end(self) -> None:
        self.activity = None

    def order(self, order: Order) -> None:
        """Queue a command for the service's thread; raise RefusedError if it is busy."""
        title = order.command.title
        with self._lock:
            if self.activity is not None:
                raise RefusedError(_busy(title, self.activity.name))
            self._order = order
            self.begin(title, 0.0)

    def take(self) -> Order | Press | None:
        """Return the waiting command, else the held press, else None."""
        with self._lock:
            order, self._order = self._order, None
            if order is not None:
                return order
            press = self.presses.serve()
            if press is not None:
                self.begin(press.jog.title, None)
            return press

    def drop(self) -> None:
        """Drop a waiting command and a requested speed; a command in progress continues."""
        self.speed.drop()
        with self._lock:
            if self._order is not None:
                self._order = None
                self.end()

    def _run(self) -> None:
        while not self._closing.is_set():
            why = "closed"
            try:
                self._serve()
            except StepTwinError as error:
                why = operator_message(error)
            except StopRequestedError:
                continue  # while connecting: stop first
            except Exception as error:  # an error of this program must not leave users without a service
                _LOGGER.exception("the machine service has failed")
                why = f"internal error: {error}"
            self.latest = replace(
                self.latest,
                time_s=time.monotonic(),
                connected=False,
                why_not=why,
                activity=None,
                queue_fill=None,
                speed_percent=None,
            )
            if why != self._why_not_logged and not self._closing.is_set():
                self.events.error(f"not connected: {why}")
                self._why_not_logged = why
            self._closing.wait(_RETRY_S)

    def _serve(self) -> None:
        """Connect, and serve the machine until the service is closed; raise BusError when the connection is lost."""
        title = self._connection.title
        link = ServiceLink(open_bus(self._connection), title, self.stops)
        with link:
            connected = ConnectedMachine(link, self)
            connected.begin(title, force=self._force)
            self._why_not_logged = ""
            began_s = time.monotonic()
            try:
                while not self._closing.is_set():
                    with suppress(StopRequestedError):  # made by the next turn
                        connected.turn()
                    if time.monotonic() - max(connected.publisher.telemetry.heard_s, began_s) > _LOST_S:
                        raise BusError(f"{title}: the machine has fallen silent")
            finally:
                self.session = self.telemetry = None
                self.presses.end("the connection is lost")
                self.drop()
                connected.publisher.log_emergencies()

    def _follow_board(self, control: ControlClient) -> None:
        clock = ClockWatch(self.events)
        while not self._closing.is_set():
            try:
                board = control.state()
            except StepTwinError:
                self.board_figures = BoardFigures()
            else:
                stood_percent = clock.percent(time.monotonic(), board.stood)
                self.board_figures = BoardFigures(board.bus_load_percent, board.ticks.late_us_p99 / 1000, stood_percent)
            self._closing.wait(_FIGURES_S)
        control.close()


def _busy(name: str, activity: str) -> str:
    return f"{name} goes on already" if name == activity else f"{name}: not begun: {activity} goes on"


_FIGURES_S: Final = 0.5
_RECENT: Final = 10
"""Number of answers, five seconds, for the percentage of time with a stopped clock."""


class ClockWatch:
    """Watches the clock of a served board, which stops on a slow computer, and logs it in the events."""

    def __init__(self, events: EventLog) -> None:
        self._events = events
        self._slowness = Slowness()
        self._recent: deque[tuple[float, float]] = deque(maxlen=_RECENT + 1)
        """Time of each answer in seconds, and the total standstill of the clock in ms."""

    def percent(self, now_s: float, stood: ClockStood) -> float:
        """Return the percentage of the last seconds with a stopped clock; 0 at the first answer."""
        if self._recent and stood.total_ms < self._recent[-1][1]:  # another board
            self._recent.clear()
            self._slowness = Slowness()
        if self._slowness.worth_telling(stood):
            self._events.warning(str(stood))
        self._recent.append((now_s, stood.total_ms))
        begin_s, begin_ms = self._recent[0]
        return 0.1 * (stood.total_ms - begin_ms) / (now_s - begin_s) if now_s > begin_s else 0.0
