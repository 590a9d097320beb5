"""The desk's state: snapshots of the machine for the pages, and what the desk knows beside the axes' reports."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from steptwin.host.common.arrays import FloatArray
from steptwin.host.panel.desk.history import Drawing, EventLog, History
from steptwin.host.panel.desk.results import RunResults
from steptwin.host.panel.desk.settings import MachineSettings
from steptwin.host.robots.robot import Robot


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
    """

    name: str
    fraction: float | None
    paused: bool
    pausable: bool
    foreign: bool = False

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
        pose: the tool's coordinates by the keys of its task; None unless every joint is homed.
        links_mm: the arm's polylines, each of shape (n, 3), in the world frame; also of an arm that is not homed, with
            NaN where the mechanism cannot be assembled.
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
    """

    number: int = -1
    time_s: float = field(default_factory=time.monotonic)
    connected: bool = False
    why_not: str | None = "looking for the machine"
    simulated: bool | None = None
    joints: tuple[JointView, ...] = ()
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

    @property
    def homed(self) -> bool:
        """True if every joint knows its position."""
        return bool(self.joints) and all(joint.homed for joint in self.joints)


class DeskState:
    """The desk's state, which outlives each connection; the worker writes it, any thread reads it.

    Attributes:
        events: what has happened, in words.
        history: the last minutes of every joint.
        drawing: the planned path and the tool's trace.
        results: the runs that have ended.
        limits: the robot's limits and all settings.
        latest: the newest snapshot that was published.
        activity: what the worker makes the machine do.
        emergency_stopped: True from an emergency stop until the reset.
        simulated: True if the board says that it is emulated.
        outputs: the digital outputs, as last read.
        bus_load_percent, late_ms, stood_percent: figures of a served board.
    """

    def __init__(self, robot: Robot) -> None:
        """Begin without a connection to the machine of this robot's file."""
        self.events = EventLog()
        self.history = History(len(robot.joints))
        self.drawing = Drawing()
        self.results = RunResults()
        self.limits = MachineSettings(robot, robot)
        self.activity: Activity | None = None
        self.emergency_stopped = False
        self.simulated: bool | None = None
        self.outputs: Mapping[str, bool] = {}
        self.bus_load_percent: float | None = None
        self.late_ms: float | None = None
        self.stood_percent: float | None = None
        self.latest = Snapshot()

    @property
    def robot(self) -> Robot:
        """The robot with its present limits."""
        return self.limits.robot

    def begin(self, name: str, fraction: float | None) -> None:
        """Say what the worker does, and which part is done; None for a jog, which has no end."""
        self.activity = Activity(name, fraction, paused=False, pausable=False)

    def end(self) -> None:
        """Say that the worker does nothing any more."""
        self.activity = None
