"""The desk: what pages read and ask. One in a process, for one machine."""

import time

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.bus_link import Connection
from steptwin.host.client.pausing import send_pause, send_resume
from steptwin.host.client.stopping import UNSURE, send_quick_stop
from steptwin.host.common.errors import BusError, InputError
from steptwin.host.operate.jogging import check_jog
from steptwin.host.panel.desk.actions import ACTIONS
from steptwin.host.panel.desk.checks import Standing
from steptwin.host.panel.desk.commands import AGE_MAX_S, Command, Jog, JointJog
from steptwin.host.panel.desk.events import EventLog
from steptwin.host.panel.desk.figures import Figures
from steptwin.host.panel.desk.history import History
from steptwin.host.panel.desk.operators import Operators
from steptwin.host.panel.desk.parts import Asked, Parts
from steptwin.host.panel.desk.presses import Presses
from steptwin.host.panel.desk.publisher import Publisher
from steptwin.host.panel.desk.refused import RefusedError
from steptwin.host.panel.desk.results import Result, Results
from steptwin.host.panel.desk.settings import Limits, Setting
from steptwin.host.panel.desk.snapshot import Snapshot
from steptwin.host.panel.desk.stops import Stop, StopRequests
from steptwin.host.panel.desk.words import told
from steptwin.host.panel.desk.worker import Worker
from steptwin.host.planning.tool_jog import check_tool_jog
from steptwin.host.robots.robot import Robot


class Desk:
    """A machine that any number of pages watch and one of them operates; thread-safe, and no call waits for the bus.

    A page is a client, under a text of its own. It reads `snapshot`, `history`, `events`, `settings` and `results`. To
    move the machine it becomes the operator (`operators.take`), then asks for commands or holds a jog by beats.
    Everybody may stop at any time.

    Attributes:
        events: what has happened, in words.
        history: the last minutes of every joint.
        operators: who may move the machine.
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
        self.events = EventLog()
        self.operators = Operators(self.events, self._operator_lost)
        self.history = History(len(robot.joints))
        self._presses = Presses()
        self._stops = StopRequests()
        self._results = Results(self.history)
        self._limits = Limits(robot, robot)
        self._publisher = Publisher(self.operators, self.history, self.events, self._stops)
        self._asked = Asked(self._publisher, self._presses)
        parts = Parts(self._publisher, self._presses, self._stops, self.events, self._results, self._limits)
        self._worker = Worker(connection, parts, self._asked, force=force)
        self._figures = None if control is None else Figures(*control, self._publisher.known)
        self._worker.start()

    def _operator_lost(self) -> None:
        self._presses.end("another client operates the machine")

    @property
    def robot(self) -> Robot:
        """The machine, with the limits that the settings have now: plan for this one."""
        return self._limits.robot

    @property
    def snapshot(self) -> Snapshot:
        """The machine now; a new one comes at least 30 times a second while it moves."""
        return self._publisher.snapshot

    @property
    def settings(self) -> tuple[Setting, ...]:
        """The settings as last read; empty before the first connection."""
        return self._limits.settings

    @property
    def results(self) -> tuple[Result, ...]:
        """The last runs that have ended, the newest last."""
        return self._results.all()

    # --- for the operator

    def ask(self, client: str, command: Command) -> None:
        """Let the machine carry out a command; return at once. How it ends is in `events`, and `results` for a run.

        Raises:
            RefusedError: nothing happens, and why: the client is not the operator; the command is more than a second
                old or wrong; the machine is not connected, is busy, is held by an emergency stop, or not homed.
        """
        self.operators.require(client)
        age_s = time.monotonic() - command.asked_s
        if age_s > AGE_MAX_S:
            raise RefusedError(f"the command is {age_s:.1f} s old, more than {AGE_MAX_S:g} s: ask again")
        action = ACTIONS[type(command)]
        name = action.title(command)
        self._require_ready(name, drives=action.drives, homed=action.homed)
        if self._presses.present is not None:
            raise RefusedError(f"{name}: a jog button is held")
        try:
            action.check(Standing(self._limits, [joint.position for joint in self.snapshot.joints]), command)
        except InputError as error:
            raise RefusedError(told(error)) from error
        self._asked.ask(command)

    def beat(self, client: str, press: int, jog: Jog) -> None:
        """Begin a jog or hold it: call this when a button is pressed and every 80 ms (`presses.BEAT_S`) after that.

        The machine stops 250 ms (`presses.LEASE_S`) after the last beat. Each press has a number, greater than all
        before on this client; a press that is over stays so.

        Raises:
            RefusedError: nothing moves, and why: as `ask`, or because the press is over.
        """
        self.operators.require(client)
        if not self._presses.is_present(client, press):
            self._presses.require_new(client, press)
            self._require_ready(f"jog {jog.name}", drives=True, homed=not isinstance(jog, JointJog), jogging=True)
            try:
                if isinstance(jog, JointJog):
                    check_jog(self.robot, jog.joint, jog.speed)
                else:
                    check_tool_jog(jog.coordinate, jog.speed)
            except InputError as error:
                raise RefusedError(told(error)) from error
        self._presses.beat(client, press, jog)

    def release(self, client: str, press: int) -> None:
        """End a jog: the button is released, the page is left or loses the focus. Never raises."""
        self._presses.release(client, press)

    def resume(self, client: str) -> None:
        """Let a paused trajectory go on; raise RefusedError unless the client is the operator and one is paused."""
        self.operators.require(client)
        if self.snapshot.emergency_stopped:
            raise RefusedError("resume: the machine is held by an emergency stop")
        send_resume(self._executing("resume"))
        self.events.info("resumed")

    def _executing(self, what: str) -> list[AxisClient]:
        """Return the axes that execute a trajectory, at rest or not; raise RefusedError if there is none."""
        session = self._worker.session
        axes = [axis for axis in session.machine.axes if axis.interpolating] if session else []
        if not axes:
            raise RefusedError(f"nothing to {what}: no trajectory runs")
        return axes

    def _require_ready(self, name: str, *, drives: bool, homed: bool, jogging: bool = False) -> None:
        """Raise RefusedError, with the first reason, unless the machine can do what this name stands for now."""
        snapshot = self.snapshot
        if not snapshot.connected:
            raise RefusedError(f"{name}: not connected: {snapshot.why_not}")
        if drives and snapshot.emergency_stopped:
            raise RefusedError(f"{name}: the machine is held by an emergency stop: reset it first")
        activity = snapshot.activity
        if activity is not None and not (jogging and activity.jogging):
            raise RefusedError(f"{name}: busy: {activity.name}")
        faulty = [joint for joint in snapshot.joints if joint.error is not None]
        if drives and faulty:
            raise RefusedError(f"{name}: {faulty[0].name} is in fault, {faulty[0].error}: reset it first")
        hindered = [joint for joint in snapshot.joints if joint.hindrance is not None]
        if drives and hindered:
            raise RefusedError(f"{name}: {hindered[0].name}: {hindered[0].hindrance}")
        unknown = [joint.name for joint in snapshot.joints if not joint.homed]
        if homed and unknown:
            raise RefusedError(f"{name}: {', '.join(unknown)} not homed: home the machine first")

    # --- for everybody, at any time

    def pause(self, by: str = "a client") -> None:
        """Halt the trajectory that runs, on its path; raise RefusedError if there is none."""
        send_pause(self._executing("pause"))
        self.events.info(f"paused by {by}")

    def stop(self, by: str = "a client") -> None:
        """Stop all axes together; they hold their positions. `by` is whom the events name."""
        self._presses.end("stopped")
        self._asked.drop()  # before the stop is asked for, or it could begin once the stop is made
        if self._worker.session is None:
            self.events.error(f"stop by {by}: not connected; {UNSURE}")
            return
        self._stops.ask(Stop.STOP)
        self.events.warning(f"stop by {by}")

    def emergency_stop(self, by: str = "a client") -> None:
        """Stop all axes at once and switch their power off, until a reset; `by` is whom the events name.

        The quick stop is sent from the calling thread. Without a connection it is made as soon as there is one again.
        """
        self._publisher.known.emergency_stopped = True
        self._asked.drop()
        self._stops.ask(Stop.EMERGENCY)
        self._presses.end("emergency stop")
        session = self._worker.session
        try:
            if session is None:
                raise BusError("not connected")
            send_quick_stop(session.link, session.machine.axes)
        except BusError as error:
            self.events.error(f"emergency stop by {by}: {told(error)}; {UNSURE}")
        else:
            self.events.error(f"emergency stop by {by}")

    def gone(self, client: str) -> None:
        """Say that a page is closed for ever: its jog ends, and it no longer operates the machine."""
        self.operators.give_up(client)
        self._presses.forget(client)

    def close(self) -> None:
        """End the connection; what the desk makes the machine do stops first."""
        self._worker.close()
        if self._figures:
            self._figures.close()
