"""Turn what the axes report into snapshots, history and events."""

import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from steptwin.features.panel.desk.reports import Reports
from steptwin.features.panel.desk.state import Activity, DeskState, JointView, Snapshot
from steptwin.features.panel.desk.stops import Stop
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


class DrawnArm:
    """A robot's tool pose and polylines at the joint position that was given last."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._kinematics = make_kinematics(robot)
        self._skeleton = Skeleton(robot)
        self._positions: list[float] = []
        self.pose: Mapping[str, float] | None = None
        """The tool's coordinates; None where the mechanism cannot be assembled, or without a tool."""
        self.links_mm: tuple[FloatArray, ...] = ()
        """The polylines of the arm's parts, axes and frames, each of shape (n, 3)."""

    def move_to(self, positions: list[float]) -> None:
        """Take a joint position in mm and degrees."""
        if positions == self._positions:
            return
        self._positions = positions
        joints = np.array([positions])
        task = self._kinematics.task
        figures = task.figures(self._kinematics.forward(joints))[0]
        assembled = bool(figures.size and np.isfinite(figures).all())
        self.pose = dict(zip(task.keys, figures.tolist(), strict=True)) if assembled else None
        self.links_mm = tuple(link.points_mm[0] for link in self._skeleton.whole(joints))


PERIOD_S: Final = 0.015
"""Least time between two snapshots."""
_REST_S: Final = 0.1
"""Longest time between two snapshots, without news."""
_SETTLED_S: Final = 0.15
"""Time for which the drives' states must last until the events tell of them: drives change one after the other."""
_ANOTHER: Final = "another program moves the machine"


class Publisher:
    """Publishes what the axes of a session report; in the worker's thread, but for `reports`.

    Attributes:
        reports: what the axes report.
    """

    def __init__(self, session: Session, state: DeskState) -> None:
        self._session = session
        self._state = state
        self._emergencies: deque[tuple[int, int]] = deque(maxlen=100)
        """Number of an axis and error code of emergencies that the events do not tell of yet."""
        self.reports: Reports = Reports(session, self._emergency)
        self._arm: DrawnArm | None = None
        self._published_s = self._news_s = float("-inf")
        self._states: tuple[str, ...] = ()
        """The drives' states as last seen, and since when."""
        self._states_s = float("-inf")
        self._told: dict[str, str] = {}
        """The states that the events tell of, by joint."""
        self._stopped = self._faulty = False
        """True if a drive was stopped or in fault, as last seen."""

    def _emergency(self, axis: int, code: int) -> None:
        """Take an error that an axis reports; called in the receiving thread.

        After an emergency stop, also one that is reset at once, nothing goes on that was asked for before.
        """
        self._emergencies.append((axis, code))
        if code == ErrorCode.ESTOP:
            self._state.shown.void("an emergency stop came")
            self._state.stops.ask(Stop.VOID)

    def publish(self) -> None:
        """Publish a snapshot, unless the last one is new enough or an axis has not reported yet."""
        reports, now_s = self.reports, time.monotonic()
        if now_s - self._published_s < PERIOD_S:
            return
        drives = [report.drive for report in reports.axes if report.drive is not None]
        if len(drives) < len(reports.axes) or reports.silent:
            return
        if reports.news_s == self._news_s and now_s - self._published_s < _REST_S:
            return
        self._published_s, self._news_s = now_s, reports.news_s
        self._follow_emergency_stop(drives)
        self._follow_stops(drives)
        self._state.latest = self._snapshot(now_s, drives)
        self._state.drawing.follow(self._state.latest.pose)
        self.tell_emergencies()
        self._tell_states(now_s, self._state.latest.drives)

    def _snapshot(self, now_s: float, drives: list[DriveStatus]) -> Snapshot:
        session, reports, state = self._session, self.reports.axes, self._state
        robot = session.robot
        places = axis_readings(
            robot,
            [drive.position_units for drive in drives],
            [bool(drive.statusword & Status.POSITION_KNOWN) for drive in drives],
        )
        positions = [place.position for place in places[: len(robot.joints)]]
        if self._arm is None or self._arm.robot is not robot:
            self._arm = DrawnArm(robot)
        self._arm.move_to(positions)
        rates = _joint_values(session, [report.velocity_units_per_s for report in reports])
        errors = _joint_values(session, [report.following_error_units for report in reports])
        self._state.history.add(now_s, np.array(positions), rates, errors)
        no_value = [np.nan] * len(robot.second_motors)
        views = tuple(
            JointView(
                name=joint.name,
                unit=str(joint.unit),
                position=place.position,
                rate=_number(rate),
                following_error=_number(error),
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
            number=self._state.shown.add(),
            time_s=now_s,
            connected=True,
            why_not=None,
            simulated=state.simulated,
            joints=views[: len(robot.joints)],
            second_motors=views[len(robot.joints) :],
            pose=self._arm.pose if all(place.known for place in places) else None,
            links_mm=self._arm.links_mm,
            inputs={name: bool((reports[axis].inputs or 0) & bit) for name, (axis, bit) in wired_inputs(robot).items()},
            outputs=state.outputs,
            activity=_activity(state.activity, drives),
            emergency_stopped=state.emergency_stopped,
            operator=None,
            bus_load_percent=state.bus_load_percent,
            queue_fill=_queue_fill(session, drives),
            speed_percent=state.speed.percent,
            late_ms=state.late_ms,
            stood_percent=state.stood_percent,
        )

    def _follow_emergency_stop(self, drives: Sequence[DriveStatus]) -> None:
        """Note an emergency stop by any program, and its end by a reset."""
        state, codes = self._state, [report.error_code for report in self.reports.axes]
        if any(drive.in_fault and code == ErrorCode.ESTOP for drive, code in zip(drives, codes, strict=True)):
            state.emergency_stopped = True
        elif (
            state.emergency_stopped
            and self._state.stops.asked is not Stop.EMERGENCY
            and not any(drive.in_fault for drive in drives)
        ):
            state.emergency_stopped = False
            self._state.events.info("the emergency stop is over")

    def _follow_stops(self, drives: Sequence[DriveStatus]) -> None:
        """Void what was asked for before a stop by any program or a fault, and before a reset."""
        stopped, faulty = any(drive.state in STOPPED for drive in drives), any(drive.in_fault for drive in drives)
        if stopped and not self._stopped:
            self._state.shown.void("the machine was stopped")
        if self._faulty and not faulty:
            self._state.shown.void("the machine was reset")
        self._stopped, self._faulty = stopped, faulty

    def tell_emergencies(self) -> None:
        """Log the errors that axes have reported, those with the same error together."""
        names = self._session.robot.axis_names
        found: dict[int, list[str]] = {}
        while self._emergencies:
            axis, code = self._emergencies.popleft()
            if code and names[axis] not in found.setdefault(code, []):
                found[code].append(names[axis])
        for code, named in found.items():
            self._state.events.warning(f"{_who(named, names)}: {error_words(code)}")

    def _tell_states(self, now_s: float, joints: Sequence[JointView]) -> None:
        """Log which drives have changed their state for good, those with the same new state together."""
        states = tuple(joint.state for joint in joints)
        if states != self._states:
            self._states, self._states_s = states, now_s
        if now_s - self._states_s < _SETTLED_S:
            return
        changed: dict[str, list[str]] = {}
        for joint in joints:
            if self._told.get(joint.name) != joint.state:
                self._told[joint.name] = joint.state
                changed.setdefault(joint.state, []).append(joint.name)
        for state, names in changed.items():
            self._state.events.info(f"{_who(names, joints)}: {state}")


def _who(some: Sequence[str], every: Sequence[object]) -> str:
    return "all drives" if len(some) == len(every) else ", ".join(some)


def _joint_values(session: Session, units: Sequence[int | None]) -> FloatArray:
    """Return the joints' values from those of the axes in wire units; NaN for all while one is unknown."""
    if any(each is None for each in units):
        return np.full(len(session.robot.joints), np.nan)
    return session.robot.to_positions(np.array(units, dtype=np.int64))


def _number(value: float) -> float | None:
    return None if np.isnan(value) else value


def _activity(own: Activity | None, drives: Sequence[DriveStatus]) -> Activity | None:
    """Return what the machine does: what the worker says, or that it moves although the worker does nothing."""
    running = [drive for drive in drives if drive.interpolating]
    paused = bool(running) and all(drive.halted for drive in running)
    if own is not None:
        return replace(own, paused=paused, pausable=bool(running))
    if running or not all(at_rest(drive.statusword, drive.mode) for drive in drives):
        return Activity(_ANOTHER, None, paused, pausable=bool(running), foreign=True)
    return None


def _queue_fill(session: Session, drives: Sequence[DriveStatus]) -> float | None:
    """Return the least filled part of the queues of axes that execute a trajectory; None if there is none."""
    free = [
        axis.pvt_status.free
        for axis, drive in zip(session.machine.axes, drives, strict=True)
        if drive.interpolating and axis.pvt_status is not None
    ]
    return 1 - max(free) / QUEUE_DEPTH if free else None
