"""The desk's state: snapshots of the machine for the pages, and what the desk's threads share beside them.

The speed of the trajectory that runs is followed here in percent of the planned one, and changed as the operator asks.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import Final, NamedTuple

from steptwin.features.panel.desk.history import Drawing, EventLog, History
from steptwin.features.panel.desk.jogs import Press, Presses
from steptwin.features.panel.desk.reports import SILENT_S, Reports
from steptwin.features.panel.desk.requests import Operators, Order
from steptwin.features.panel.desk.results import Result, RunResults
from steptwin.features.panel.desk.settings import MachineSettings, Setting
from steptwin.features.panel.desk.stops import ShownStates, StopRequests
from steptwin.features.panel.desk.words import RefusedError, busy, told
from steptwin.host.client import Machine
from steptwin.host.client.pausing import change_speed, present_speed_percent
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError
from steptwin.host.operate.session import Session
from steptwin.host.robots.robot import Robot

SPEED_PERIOD_S: Final = 0.3
"""Time from one question about the present speed to the next, while a trajectory runs."""
PLANNED_PERCENT: Final = 100


class _Wanted(NamedTuple):
    """A speed, and the number of the newest state that the page had shown which asks for it."""

    percent: int
    shown: int


class RunSpeed:
    """The speed on the way: any thread may ask for one or read it; the worker's thread tends it in its waits.

    Attributes:
        percent: the present speed as last read, 0 in a pause; None without a trajectory.
    """

    def __init__(self, events: EventLog, shown: ShownStates, faster: Callable[[], None]) -> None:
        """Begin without a trajectory; `faster` is called when one runs faster than planned."""
        self.percent: float | None = None
        self._events = events
        self._shown = shown
        self._faster = faster
        self._wanted: _Wanted | None = None
        self._tending = False
        self._read_s = float("-inf")

    def ask(self, percent: int, shown: int) -> None:
        """Let the trajectory run at a percentage of the planned speed, with the worker's next wait."""
        self._wanted = _Wanted(percent, shown)

    def drop(self) -> None:
        """Drop what is asked for and not done yet."""
        self._wanted = None

    def tend(self, machine: Machine) -> None:
        """Change the speed if that is asked for, and read it from time to time; in the worker's thread.

        A speed that comes too late, or after a stop, is refused as a command is, with a line in the events.
        """
        if self._tending:  # a question waits itself
            return
        if not any(axis.interpolating for axis in machine.axes):
            self.percent = self._wanted = None
            return
        wanted, self._wanted = self._wanted, None
        if wanted is None and time.monotonic() - self._read_s < SPEED_PERIOD_S:
            return
        self._tending = True
        try:
            if wanted is not None:
                self._change(machine, wanted)
            self.percent = present_speed_percent(machine.axes)
        except (InputError, DeviceFaultError, BusError) as error:
            self._events.error(f"speed: {told(error)}")
        finally:
            self._tending, self._read_s = False, time.monotonic()
        if self.percent is not None and self.percent > PLANNED_PERCENT:
            self._faster()

    def _change(self, machine: Machine, wanted: _Wanted) -> None:
        self._shown.require(wanted.shown)
        change_speed(machine, wanted.percent)
        self._events.info(f"speed: {wanted.percent} % of the planned one")
        if wanted.percent > PLANNED_PERCENT:
            self._faster()


_SILENT: Final = f"no report from the machine for {SILENT_S:g} s"


@dataclass(frozen=True, slots=True)
class JointView:
    """One joint and its drive.

    Attributes:
        name: name of the joint.
        unit: `mm` or `deg`; speeds are in this unit per second.
        position: position by the step counter.
        rate: speed with its sign; None while the board does not report it.
        following_error: how far the drive's position is from the demanded one; None while the board does not report it.
        lower: lower limit of the position.
        upper: upper limit of the position.
        homed: True if the position counts from the joint's zero.
        state: the drive's state in plain words.
        drive_state: the drive's state as the standard (CiA 402) writes it.
        error: the drive's fault in plain words; None without one.
        hindrance: what keeps the drive from being switched on, in plain words; None if nothing that is known does.
    """

    name: str
    unit: str
    position: float
    rate: float | None
    following_error: float | None
    lower: float
    upper: float
    homed: bool
    state: str
    drive_state: str
    error: str | None
    hindrance: str | None = None


@dataclass(frozen=True, slots=True)
class Activity:
    """The present work of the machine.

    Attributes:
        name: such as `home`, `jog th2` or the job's name.
        fraction: the part that is done, 0 to 1; None if it has no end, as a jog.
        paused: True while the machine rests amid its trajectory.
        pausable: True if it can be paused: only trajectories can.
        foreign: True if another program moves the machine, not the desk.
        waits_for: the input for which a program stands, in words; empty while it does not.
    """

    name: str
    fraction: float | None
    paused: bool
    pausable: bool
    foreign: bool = False
    waits_for: str = ""

    @property
    def jogging(self) -> bool:
        """True if the desk jogs."""
        return self.fraction is None and not self.foreign


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """The machine and the desk at an instant. Everything but the texts is the last known while not connected.

    Attributes:
        number: counts up; a command names the newest that its page had shown. -1 before the first connection.
        time_s: when it was taken, on the clock of `time.monotonic`.
        connected: False while no telemetry comes.
        why_not: why it is not connected, in one line; None while it is.
        simulated: True if the board says that it is emulated; None while that is unknown.
        joints: the joints in the robot's order; empty before the first connection.
        second_motors: the drives of second motors, with the positions of their ends of the joints.
        pose: the tool's coordinates by the keys of its task; None unless every joint is homed.
        links_mm: the polylines of the arm's parts, axes and frames, each of shape (n, 3), in the world frame; also of
            an arm that is not homed, with NaN where the mechanism cannot be assembled.
        inputs: whether each digital input is on, by its name in the robot's file.
        outputs: whether each digital output is on, by its name; as last read.
        activity: what the machine is doing; None at rest.
        emergency_stopped: True from an emergency stop until the reset.
        operator: name of the operator; None if there is none.
        bus_load_percent: of a served board; None if the bus does not tell.
        queue_fill: least part of a drive's queue of motion that is full, 0 to 1; None while no trajectory runs.
        late_ms: how late a served board is at the 99th percentile; None if it does not tell.
        stood_percent: part of the last five seconds for which a served board's clock has stood since the computer was
            too slow; None if it does not tell.
        speed_percent: speed of the trajectory that runs, in percent of the planned one; 0 in a pause, None without one.
    """

    number: int = -1
    time_s: float = field(default_factory=time.monotonic)
    connected: bool = False
    why_not: str | None = "looking for the machine"
    simulated: bool | None = None
    joints: tuple[JointView, ...] = ()
    second_motors: tuple[JointView, ...] = ()
    pose: Mapping[str, float] | None = None
    links_mm: tuple[FloatArray, ...] = ()
    inputs: Mapping[str, bool] = field(default_factory=dict)
    outputs: Mapping[str, bool] = field(default_factory=dict)
    activity: Activity | None = None
    emergency_stopped: bool = False
    operator: str | None = None
    bus_load_percent: float | None = None
    queue_fill: float | None = None
    late_ms: float | None = None
    stood_percent: float | None = None
    speed_percent: float | None = None

    @property
    def drives(self) -> tuple[JointView, ...]:
        """All drives: those of the joints, then those of second motors."""
        return (*self.joints, *self.second_motors)

    @property
    def homed(self) -> bool:
        """True if every joint knows its position."""
        return bool(self.joints) and all(joint.homed for joint in self.joints)


class DeskState:
    """What the desk's threads share; it outlives each connection. The worker writes it, any thread reads it.

    Attributes:
        events: what has happened, in words.
        history: the last minutes of every joint.
        drawing: the planned path and the tool's trace.
        runs: the runs that have ended.
        limits: the robot's limits and all settings.
        operators: who may move the machine.
        shown: the states from which commands may be asked for.
        presses: the jog button that is held.
        stops: the stop that is asked for.
        speed: the speed of the trajectory that runs.
        session: the session while the machine is connected.
        reports: what the axes report, while the machine is connected.
        latest: the newest snapshot that was published.
        activity: what the worker makes the machine do.
        emergency_stopped: True from an emergency stop until the reset.
        simulated: True if the board says that it is emulated.
        outputs: the digital outputs, as last read.
        bus_load_percent, late_ms, stood_percent: figures of a served board.
    """

    def __init__(self, robot: Robot) -> None:
        """Begin without a connection to the machine of this robot's file."""
        self.events: EventLog = EventLog()
        self.history: History = History(len(robot.joints))
        self.drawing: Drawing = Drawing()
        self.runs: RunResults = RunResults()
        self.limits: MachineSettings = MachineSettings(robot, robot)
        self.operators: Operators = Operators(self.events, self._change_operator)
        self.shown: ShownStates = ShownStates()
        self.presses: Presses = Presses(self.events.error)
        self.stops: StopRequests = StopRequests()
        self.speed: RunSpeed = RunSpeed(self.events, self.shown, self.runs.note_faster)
        self.session: Session | None = None
        self.reports: Reports | None = None
        self.latest: Snapshot = Snapshot()
        self.activity: Activity | None = None
        self.emergency_stopped = False
        self.simulated: bool | None = None
        self.outputs: Mapping[str, bool] = {}
        self.bus_load_percent: float | None = None
        self.late_ms: float | None = None
        self.stood_percent: float | None = None
        self._order: Order | None = None
        self._lock = Lock()

    @property
    def robot(self) -> Robot:
        """The machine, with the limits that the settings have now: plan for this one."""
        return self.limits.robot

    @property
    def settings(self) -> tuple[Setting, ...]:
        """The settings as last read; empty before the first connection."""
        return self.limits.settings

    @property
    def results(self) -> tuple[Result, ...]:
        """The last runs that have ended, the newest last."""
        return self.runs.all()

    @property
    def snapshot(self) -> Snapshot:
        """The machine now; a new one comes at least 30 times a second while it moves.

        It is not connected if the axes have fallen silent since.
        """
        latest, own, holder = self.latest, self.activity, self.operators.holder
        activity = latest.activity  # which may have ended, or something else begun, since it was published
        if own is None or activity is None or activity.name != own.name:
            activity = own or (activity if activity and activity.foreign else None)
        lost = latest.connected and (self.reports is None or self.reports.silent)
        return replace(
            latest,
            operator=holder.name if holder else None,
            emergency_stopped=self.emergency_stopped,
            connected=latest.connected and not lost,
            why_not=_SILENT if lost else latest.why_not,
            activity=None if lost else activity,
        )

    def disconnected(self, why: str) -> None:
        """Show that the machine is not connected, and why; the rest stays as last known."""
        self.latest = replace(
            self.latest,
            time_s=time.monotonic(),
            connected=False,
            why_not=why,
            activity=None,
            queue_fill=None,
            speed_percent=None,
        )

    # --- what waits for the worker, and what it does

    def begin(self, name: str, fraction: float | None, waits_for: str = "") -> None:
        """Say what the worker does, which part is done, None for a jog without an end, and for what it stands."""
        self.activity = Activity(name, fraction, paused=False, pausable=False, waits_for=waits_for)

    def end(self) -> None:
        """Say that the worker does nothing any more."""
        self.activity = None

    def order(self, order: Order) -> None:
        """Let a command wait for the worker; raise RefusedError if the worker is busy."""
        title = order.command.title
        with self._lock:
            if self.activity is not None:
                raise RefusedError(busy(title, self.activity.name))
            self._order = order
            self.begin(title, 0.0)

    def take(self) -> Order | Press | None:
        """Return the command that waits, else the press that is held, else None."""
        with self._lock:
            order, self._order = self._order, None
            if order is not None:
                return order
            press = self.presses.serve()
            if press is not None:
                self.begin(press.jog.title, None)
            return press

    def drop(self) -> None:
        """Drop a command that waits, and a speed; one that is carried out goes on."""
        self.speed.drop()
        with self._lock:
            if self._order is not None:
                self._order = None
                self.end()

    def _change_operator(self) -> None:
        self.shown.void("the operator changed")
        self.presses.end("another client operates the machine")
