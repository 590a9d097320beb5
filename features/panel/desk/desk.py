"""The desk: what pages read and ask, with the figures of a served board by its control port. One in a process."""

import time
from collections import deque
from threading import Event as Flag
from threading import Thread
from typing import Final

from steptwin.features.panel.desk.history import EventLog
from steptwin.features.panel.desk.jogs import Jog
from steptwin.features.panel.desk.requests import Command, Order, Request
from steptwin.features.panel.desk.state import DeskState
from steptwin.features.panel.desk.stops import Stop
from steptwin.features.panel.desk.words import RefusedError, busy, told
from steptwin.features.panel.desk.worker import Worker
from steptwin.host.client.axis import AxisClient
from steptwin.host.client.control_client import ControlClient
from steptwin.host.client.links.bus_link import Connection
from steptwin.host.client.pausing import check_speed, send_pause, send_resume
from steptwin.host.client.stopping import UNSURE, send_quick_stop
from steptwin.host.common.errors import BusError, InputError, StepTwinError
from steptwin.host.common.processes import ClockStood, Slowness
from steptwin.host.robots.robot import Robot

_PERIOD_S: Final = 0.5
_RECENT: Final = 10
"""Number of answers over which it is told which part of the time the board's clock has stood: five seconds."""


class BoardFigures:
    """Asks a control port twice a second, in a thread of its own; without an answer the figures are unknown."""

    def __init__(self, host: str, port: int, state: DeskState) -> None:
        self._client = ControlClient(host, port)
        self._state = state
        self._clock = ClockWatch(state.events)
        self._closing = Flag()
        self._thread = Thread(target=self._run, name="desk figures", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread and the connection."""
        self._closing.set()
        self._thread.join()
        self._client.close()

    def _run(self) -> None:
        while not self._closing.is_set():
            self._ask()
            self._closing.wait(_PERIOD_S)

    def _ask(self) -> None:
        desk = self._state
        try:
            board = self._client.state()
        except StepTwinError:
            desk.bus_load_percent = desk.late_ms = desk.stood_percent = None
        else:
            desk.bus_load_percent, desk.late_ms = board.bus_load_percent, board.ticks.late_us_p99 / 1000
            desk.stood_percent = self._clock.percent(time.monotonic(), board.stood)


class ClockWatch:
    """Watches how a served board's clock stands since the computer is too slow, and tells of it in the events."""

    def __init__(self, events: EventLog) -> None:
        self._events = events
        self._slowness = Slowness()
        self._recent: deque[tuple[float, float]] = deque(maxlen=_RECENT + 1)
        """The instant of each answer in seconds, and for how long the clock had stood by then in ms."""

    def percent(self, now_s: float, stood: ClockStood) -> float:
        """Return in percent for how much of the last seconds the clock has stood, 0 at the first answer."""
        if self._recent and stood.total_ms < self._recent[-1][1]:  # another board
            self._recent.clear()
            self._slowness = Slowness()
        if self._slowness.worth_telling(stood):
            self._events.warning(str(stood))
        self._recent.append((now_s, stood.total_ms))
        begin_s, begin_ms = self._recent[0]
        return 0.1 * (stood.total_ms - begin_ms) / (now_s - begin_s) if now_s > begin_s else 0.0


class Desk(DeskState):
    """A machine that any number of pages watch and one of them operates; thread-safe, and no call waits for the bus.

    A page is a client, under a text of its own. It reads `snapshot`, `history`, `events`, `drawing`, `settings` and
    `results`. To move the machine it becomes the operator (`operators.take`), then asks for commands or holds a jog by
    beats. Everybody may stop at any time.
    """

    def __init__(
        self, connection: Connection, robot: Robot, *, control: tuple[str, int] | None = None, force: bool = False
    ) -> None:
        """Connect in a thread of its own, again and again until `close`.

        Args:
            connection: the bus.
            robot: the machine on it.
            control: host and port of a served board's control port, for its load and lateness; None without one.
            force: go on although the board carries another robot's name.
        """
        super().__init__(robot)
        self._figures = None if control is None else BoardFigures(*control, self)
        self._worker = Worker(connection, self, force=force)

    # --- for the operator

    def require_shown(self, name: str, shown: int | None) -> None:
        """Raise RefusedError, with why, if the page that asks has not shown the machine's present state.

        `name` says what is asked for, `shown` is the number of the newest snapshot that the page had shown then.
        """
        try:
            self.shown.require(shown)
        except RefusedError as error:
            raise RefusedError(f"{name}: {error}") from error

    def ask(self, client: str, command: Command, shown: int | None) -> None:
        """Let the machine carry out a command; return at once. How it ends is in `events`, and `results` for a run.

        Args:
            client: the page.
            command: what the operator wants.
            shown: number of the newest snapshot that the page had shown when he asked for it; None before the first.

        Raises:
            RefusedError: nothing happens, and why: the client is not the operator; the command comes more than a second
                late, or was asked for before a stop, a reset, or another operator or connection; it is wrong; the
                machine is not connected, is busy, is held by an emergency stop, or not homed.
        """
        self.operators.require(client)
        self._require(command, shown)
        assert shown is not None
        if self.presses.present is not None:
            raise RefusedError(f"{command.title}: a jog button is held")
        self.order(Order(command, shown))

    def beat(self, client: str, press: int, jog: Jog, shown: int | None) -> None:
        """Begin a jog or hold it: call this when a button is pressed and every 80 ms (`jogs.BEAT_S`) after that.

        The machine stops 250 ms (`jogs.LEASE_S`) after the last beat. Each press has a number, greater than all
        before on this client; a press that is over stays so. `shown` is the number of the newest snapshot that the page
        had shown when it sent the beat.

        Raises:
            RefusedError: nothing moves, and why: as `ask`, or because the press is over.
        """
        self.operators.require(client)
        if self.presses.is_present(client, press):
            self._require_young(jog, shown)
        else:
            self.presses.require_new(client, press)
            self._require(jog, shown)
        self.presses.beat(client, press, jog)

    def _require_young(self, jog: Jog, shown: int | None) -> None:
        """End the press that is held, and raise RefusedError, if its beats come too late: its release would, too."""
        try:
            self.shown.require_young(shown)
        except RefusedError as error:
            late = f"{jog.title}: {error}"
            self.presses.end(late)
            raise RefusedError(late) from error

    def release(self, client: str, press: int) -> str | None:
        """End a jog: the button is released, the page is left or loses the focus. Never raises.

        Return why the jog had ended before; None if it had not.
        """
        return self.presses.release(client, press)

    def resume(self, client: str, shown: int | None) -> None:
        """Let a paused trajectory go on; raise RefusedError as `ask`, or if none is paused."""
        self.operators.require(client)
        self.require_shown("resume", shown)
        if self.snapshot.emergency_stopped:
            raise RefusedError("resume: the machine is held by an emergency stop")
        send_resume(self._executing("resume"))
        self.events.info("resumed")

    def change_speed(self, client: str, percent: int, shown: int | None) -> None:
        """Let the trajectory that runs be slower or faster, in percent of its planned speed; return at once.

        Raise RefusedError as `resume`, or if no motion may have this speed. What the motion's own limits do not allow
        is told in `events`.
        """
        self.operators.require(client)
        self.require_shown("speed", shown)
        assert shown is not None
        if self.snapshot.emergency_stopped:
            raise RefusedError("speed: the machine is held by an emergency stop")
        try:
            check_speed(percent)
        except InputError as error:
            raise RefusedError(told(error)) from error
        self._executing("make slower or faster")
        self.speed.ask(percent, shown)

    def _executing(self, what: str) -> list[AxisClient]:
        """Return the axes that execute a trajectory, at rest or not; raise RefusedError if there is none."""
        session = self.session
        axes = [axis for axis in session.machine.axes if axis.interpolating] if session else []
        if not axes:
            raise RefusedError(f"nothing to {what}: no trajectory runs")
        return axes

    def _require(self, request: Request, shown: int | None) -> None:
        """Raise RefusedError, with the first reason, unless the machine can do now what a request asks for."""
        name, snapshot = request.title, self.snapshot
        if not snapshot.connected:
            raise RefusedError(f"{name}: not connected: {snapshot.why_not}")
        if request.needs_drives and snapshot.emergency_stopped:
            raise RefusedError(f"{name}: the machine is held by an emergency stop: reset it first")
        activity = snapshot.activity
        if activity is not None and not (request.jogs and activity.jogging):
            raise RefusedError(busy(name, activity.name))
        for joint in snapshot.drives if request.needs_drives else ():
            if joint.error is not None:
                raise RefusedError(f"{name}: {joint.name} is in fault, {joint.error}: reset it first")
        for joint in snapshot.drives if request.needs_drives else ():
            if joint.hindrance is not None:
                raise RefusedError(f"{name}: {joint.name}: {joint.hindrance}")
        unknown = [joint.name for joint in snapshot.joints if not joint.homed]
        if request.needs_homed and unknown:
            raise RefusedError(f"{name}: {', '.join(unknown)} not homed: home the machine first")
        self.require_shown(name, shown)
        try:
            request.check(self.limits, [joint.position for joint in snapshot.joints])
        except InputError as error:
            raise RefusedError(told(error)) from error

    # --- for everybody, at any time

    def pause(self, by: str = "a client") -> None:
        """Halt the trajectory that runs, on its path; raise RefusedError if there is none."""
        send_pause(self._executing("pause"))
        self.events.info(f"paused by {by}")

    def stop(self, by: str = "a client", press: str | None = None) -> bool:
        """Stop all axes together; they hold their positions. Arguments and result are those of `emergency_stop`."""
        self.shown.void("a stop came")
        self.presses.end("stopped")
        self.drop()  # before the stop is asked for, or it could begin once the stop is made
        if self.session is None:
            self.events.error(f"stop by {by}: not connected; {UNSURE}")
            return False  # the press is not known then: its copy that comes later stops the machine
        if press is not None and not self.stops.is_new(press):
            return self.snapshot.connected
        self.stops.ask(Stop.STOP)
        self.events.warning(f"stop by {by}")
        return self.snapshot.connected

    def emergency_stop(self, by: str = "a client", press: str | None = None) -> bool:
        """Stop all axes at once and switch their power off, until a reset.

        The quick stop is sent from the calling thread. Without a connection it is made as soon as there is one again.

        Args:
            by: whom the events name.
            press: name of the press of a button. A page sends a press again and again, on two ways, until it has an
                answer: the first that comes stops the machine, and the others change nothing, also after a reset.

        Returns:
            Whether the machine was connected, so that it has been told.
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
            self.events.error(f"emergency stop by {by}: {told(error)}; {UNSURE}")
            return False
        self.events.error(f"emergency stop by {by}")
        return self.snapshot.connected

    def gone(self, client: str) -> None:
        """Say that a page is closed for ever: its jog ends, and it no longer operates the machine."""
        self.operators.give_up(client)
        self.presses.forget(client)

    def close(self) -> None:
        """End the connection; what the desk makes the machine do stops first."""
        self._worker.close()
        if self._figures:
            self._figures.close()
