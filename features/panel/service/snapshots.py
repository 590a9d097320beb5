"""Snapshots: the state of machine and service at an instant, published from telemetry."""

import time
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np

from steptwin.features.panel.service.guards import Stop
from steptwin.features.panel.service.telemetry import Telemetry
from steptwin.host.client.drive_status import STOPPED, DriveStatus, at_rest
from steptwin.host.client.words import error_words, hindrance_words, state_text, state_words
from steptwin.host.common.arrays import FloatArray
from steptwin.host.operate.inputs_outputs import wired_inputs
from steptwin.host.operate.joint_positions import axis_readings
from steptwin.host.operate.session import Session
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.marks import Skeleton
from steptwin.host.robots.robot import Robot
from steptwin.protocol.cia402 import ErrorCode, Status
from steptwin.protocol.pvt import QUEUE_DEPTH

if TYPE_CHECKING:
    from steptwin.features.panel.service.service import MachineService


@dataclass(frozen=True, slots=True)
class JointView:
    """One joint and its drive.

    Attributes:
        name: name of the joint.
        unit: `mm` or `deg`; speeds are in this unit per second.
        position: position by the step counter.
        rate: speed with sign; None while the board does not report it.
        following_error: actual minus demanded position; None while the board does not report it.
        lower: lower limit of the position.
        upper: upper limit of the position.
        homed: True if the position counts from the joint's zero.
        state: the drive's state in plain words.
        drive_state: the drive's state in the words of the standard (CiA 402).
        error: the drive's fault in plain words; None without one.
        hindrance: known reason why the drive cannot be switched on, in plain words; None without one.
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
        fraction: fraction done, 0 to 1; None for work without an end, such as a jog.
        paused: True at standstill within its trajectory.
        pausable: True for trajectories; other work cannot be paused.
        foreign: True if another program moves the machine.
        waits_for: input for which a program waits, as text; empty without one.
    """

    name: str
    fraction: float | None
    paused: bool = False
    pausable: bool = False
    foreign: bool = False
    waits_for: str = ""

    @property
    def jogging(self) -> bool:
        return self.fraction is None and not self.foreign


@dataclass(frozen=True, slots=True)
class BoardFigures:
    """Figures of a served board from its control port; None if unknown.

    Attributes:
        bus_load_percent: load of the bus.
        late_ms: lateness of the board at the 99th percentile.
        stood_percent: percentage of the last five seconds with a stopped clock on a slow computer.
    """

    bus_load_percent: float | None = None
    late_ms: float | None = None
    stood_percent: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """State of machine and service at an instant; without connection, the last known values.

    Attributes:
        number: counts up; requests have the newest number that their page had shown. -1 before the first connection.
        time_s: time of its creation, on the clock of `time.monotonic`.
        connected: False while no telemetry comes.
        why_not: why it is not connected, in one line; None while it is.
        simulated: True if the board reports that it is emulated; None while that is unknown.
        joints: joints in the robot's order; empty before the first connection.
        second_motors: drives of second motors, with the positions of their ends of the joints.
        pose: the tool's coordinates by the keys of its task; None unless every joint is homed.
        links_mm: polylines of the arm's parts, axes and frames, each of shape (n, 3), in the world frame, even if the
            arm is not homed; NaN where the mechanism cannot be assembled.
        inputs: True for each digital input that is on, by its name in the robot's file.
        outputs: True for each digital output that is on, by name; as last read.
        activity: present work of the machine; None at standstill.
        emergency_stopped: True from an emergency stop until the reset.
        operator: name of the operator; None without one.
        queue_fill: fill level of the emptiest queue of a drive, 0 to 1; None without a trajectory.
        speed_percent: speed of the running trajectory, in percent of the planned one; 0 in a pause, None without one.
        board: figures of a served board.
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
    queue_fill: float | None = None
    speed_percent: float | None = None
    board: BoardFigures = BoardFigures()

    @property
    def drives(self) -> tuple[JointView, ...]:
        """All drives: those of the joints, then those of second motors."""
        return (*self.joints, *self.second_motors)

    @property
    def homed(self) -> bool:
        return bool(self.joints) and all(joint.homed for joint in self.joints)

    @property
    def faulty(self) -> bool:
        return any(joint.error is not None for joint in self.drives)


# --- publishing

PERIOD_S: Final = 0.015
"""Least time between two snapshots."""
_STANDSTILL_S: Final = 0.1
"""Longest time between two snapshots without a change."""
_SETTLED_S: Final = 0.15
"""Time for which drive states must last to be logged: drives change one after the other."""
_ANOTHER: Final = "another program moves the machine"


class Publisher:
    """Publishes the reports of a session's axes, in the service's thread; telemetry itself uses another one.

    Attributes:
        telemetry: what the axes report.
    """

    def __init__(self, session: Session, service: "MachineService") -> None:
        self._session = session
        self._service = service
        self._emergencies: deque[tuple[int, int]] = deque(maxlen=100)
        """Axis number and error code of emergencies that are not logged yet."""
        self.telemetry: Telemetry = Telemetry(session, self._emergency)
        self._drawn: _DrawnArm | None = None
        self._published_s = self._news_s = float("-inf")
        self._states: tuple[str, ...] = ()  # drive states as last seen, and since when
        self._states_s = float("-inf")
        self._logged: dict[str, str] = {}  # logged states by joint
        self._stopped = self._faulty = False  # whether any drive was in quick stop, as last seen

    def _emergency(self, axis: int, code: int) -> None:
        """Register an error reported by an axis; called in the receiving thread.

        An emergency stop, even one that is reset at once, voids earlier requests.
        """
        self._emergencies.append((axis, code))
        if code == ErrorCode.ESTOP:
            self._service.shown.void("an emergency stop came")
            self._service.stops.ask(Stop.VOID)

    def publish(self) -> None:
        """Publish a snapshot, unless the last one is new enough or an axis has not reported yet."""
        telemetry, now_s = self.telemetry, time.monotonic()
        if now_s - self._published_s < PERIOD_S:
            return
        drives = [report.drive for report in telemetry.axes if report.drive is not None]
        if len(drives) < len(telemetry.axes) or telemetry.silent:
            return
        if telemetry.news_s == self._news_s and now_s - self._published_s < _STANDSTILL_S:
            return
        self._published_s, self._news_s = now_s, telemetry.news_s
        self._follow_stops(drives)
        latest = self._service.latest = self._snapshot(now_s, drives)
        self._service.drawing.follow(latest.pose)
        self.log_emergencies()
        self._log_states(now_s, latest.drives)

    def _follow_stops(self, drives: Sequence[DriveStatus]) -> None:
        """Register an emergency stop by any program, and its end; void requests from before a stop, fault or reset."""
        service = self._service
        faulty = any(drive.in_fault for drive in drives)
        codes = [report.error_code for report in self.telemetry.axes]
        if any(drive.in_fault and code == ErrorCode.ESTOP for drive, code in zip(drives, codes, strict=True)):
            service.emergency_stopped = True
        elif service.emergency_stopped and service.stops.asked is not Stop.EMERGENCY and not faulty:
            service.emergency_stopped = False
            service.events.info("the emergency stop is over")
        stopped = any(drive.state in STOPPED for drive in drives)
        if stopped and not self._stopped:
            service.shown.void("the machine was stopped")
        if self._faulty and not faulty:
            service.shown.void("the machine was reset")
        self._stopped, self._faulty = stopped, faulty

    def _snapshot(self, now_s: float, drives: list[DriveStatus]) -> Snapshot:
        session, reports, service = self._session, self.telemetry.axes, self._service
        robot = session.robot
        places = axis_readings(
            robot,
            [drive.position_units for drive in drives],
            [bool(drive.statusword & Status.POSITION_KNOWN) for drive in drives],
        )
        positions = [place.position for place in places[: len(robot.joints)]]
        if self._drawn is None or self._drawn.robot is not robot:
            self._drawn = _DrawnArm(robot)
        self._drawn.move_to(positions)
        rates = _joint_values(robot, [report.velocity_units_per_s for report in reports])
        errors = _joint_values(robot, [report.following_error_units for report in reports])
        service.history.add(now_s, np.array(positions), rates, errors)
        no_value = [np.nan] * len(robot.second_motors)
        views = tuple(
            JointView(
                name=joint.name,
                unit=str(joint.unit),
                position=place.position,
                rate=None if np.isnan(rate) else rate,
                following_error=None if np.isnan(error) else error,
                lower=joint.lower,
                upper=joint.upper,
                homed=place.known,
                state=state_words(drive.state),
                drive_state=state_text(drive.state),
                error=error_words(report.error_code) if drive.in_fault else None,
                hindrance=hindrance_words(report.inputs or 0),
            )
            for joint, place, rate, error, drive, report in zip(
                robot.axes,
                places,
                [*rates.tolist(), *no_value],
                [*errors.tolist(), *no_value],
                drives,
                reports,
                strict=True,
            )
        )
        return Snapshot(
            number=service.shown.add(),
            time_s=now_s,
            connected=True,
            why_not=None,
            simulated=service.simulated,
            joints=views[: len(robot.joints)],
            second_motors=views[len(robot.joints) :],
            pose=self._drawn.pose if all(place.known for place in places) else None,
            links_mm=self._drawn.links_mm,
            inputs={name: bool((reports[axis].inputs or 0) & bit) for name, (axis, bit) in wired_inputs(robot).items()},
            outputs=service.outputs,
            activity=_activity(service.activity, drives),
            emergency_stopped=service.emergency_stopped,
            queue_fill=queue_fill(session, drives),
            speed_percent=service.speed.percent,
            board=service.board_figures,
        )

    def log_emergencies(self) -> None:
        """Log reported errors, equal ones of several axes together."""
        names = self._session.robot.axis_names
        found: list[tuple[str, int]] = []
        while self._emergencies:
            axis, code = self._emergencies.popleft()
            if code:
                found.append((names[axis], code))
        for code, named in grouped(found).items():
            self._service.events.warning(f"{_who(named, names)}: {error_words(code)}")

    def _log_states(self, now_s: float, joints: Sequence[JointView]) -> None:
        """Log lasting changes of drive states, equal ones together."""
        states = tuple(joint.state for joint in joints)
        if states != self._states:
            self._states, self._states_s = states, now_s
        if now_s - self._states_s < _SETTLED_S:
            return
        changed = grouped((each.name, each.state) for each in joints if self._logged.get(each.name) != each.state)
        self._logged |= {joint.name: joint.state for joint in joints}
        for state, names in changed.items():
            self._service.events.info(f"{_who(names, joints)}: {state}")


class _DrawnArm:
    """Tool pose and polylines of a robot at the last given joint position, in mm and degrees."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._kinematics = make_kinematics(robot)
        self._skeleton = Skeleton(robot)
        self._positions: list[float] = []
        self.pose: Mapping[str, float] | None = None  # none where the mechanism cannot be assembled, or without a tool
        self.links_mm: tuple[FloatArray, ...] = ()

    def move_to(self, positions: list[float]) -> None:
        if positions == self._positions:
            return
        self._positions, joints = positions, np.array([positions])
        task = self._kinematics.task
        figures = task.figures(self._kinematics.forward(joints))[0]
        assembled = bool(figures.size and np.isfinite(figures).all())
        self.pose = dict(zip(task.keys, figures.tolist(), strict=True)) if assembled else None
        self.links_mm = tuple(link.points_mm[0] for link in self._skeleton.whole(joints))


V = TypeVar("V")


def grouped(named: Iterable[tuple[str, V]]) -> dict[V, list[str]]:
    """Return names grouped by a common value, each value once."""
    found: dict[V, list[str]] = {}
    for name, value in named:
        if name not in found.setdefault(value, []):
            found[value].append(name)
    return found


def _who(some: Sequence[str], every: Sequence[object]) -> str:
    return "all drives" if len(some) == len(every) else ", ".join(some)


def _joint_values(robot: Robot, units: Sequence[int | None]) -> FloatArray:
    """Return the joints' values from those of the axes in wire units; all NaN while one is unknown."""
    if any(each is None for each in units):
        return np.full(len(robot.joints), np.nan)
    return robot.to_positions(np.array(units, dtype=np.int64))


def _activity(own: Activity | None, drives: Sequence[DriveStatus]) -> Activity | None:
    """Return the present work: the service's own, or a motion by another program."""
    running = [drive for drive in drives if drive.interpolating]
    paused = bool(running) and all(drive.halted for drive in running)
    if own is not None:
        return replace(own, paused=paused, pausable=bool(running))
    if running or not all(at_rest(drive.statusword, drive.mode) for drive in drives):
        return Activity(_ANOTHER, None, paused, pausable=bool(running), foreign=True)
    return None


def queue_fill(session: Session, drives: Sequence[DriveStatus]) -> float | None:
    """Return the fill level of the emptiest queue among axes that execute a trajectory; None if none does."""
    free = [
        axis.pvt_status.free
        for axis, drive in zip(session.machine.axes, drives, strict=True)
        if drive.interpolating and axis.pvt_status is not None
    ]
    return 1 - max(free) / QUEUE_DEPTH if free else None
