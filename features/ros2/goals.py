"""Goals of a FollowJointTrajectory action: states, checks before any motion, and plans.

Points with velocities are joined by cubics, points without them by a C2 spline, as in files.

Sources: "Actions" in the design articles of ROS 2 (goal states and transitions), and action_msgs/msg/GoalStatus (the
numbers).
"""

from dataclasses import dataclass, replace
from enum import Enum, IntEnum
from math import inf
from typing import Final

import numpy as np

from steptwin.features.ros2.messages import PER_ROS_UNIT, FollowCode
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Table, number_at
from steptwin.host.operate.running import END_ERROR_STEPS_MAX
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.planning.trajectory_file.file_motion import FileMotion
from steptwin.host.planning.trajectory_file.points import FileUnits, Points
from steptwin.host.planning.trajectory_file.ros_points import read_message
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.robot import Robot
from steptwin.protocol.od import UNITS_PER_FULL_STEP

START_TOLERANCES: Final = {Unit.DEG: 0.01 * PER_ROS_UNIT[Unit.DEG], Unit.MM: 1.0}
"""Largest distance from the machine's position to a trajectory's start: MoveIt's 0.01 rad, and 1 mm."""
_KEYS: Final = (
    *("trajectory", "multi_dof_trajectory", "path_tolerance", "component_path_tolerance"),
    *("goal_tolerance", "component_goal_tolerance", "goal_time_tolerance"),
)
_TOLERANCE_KEYS: Final = ("name", "position", "velocity", "acceleration")
_STAMP_KEYS: Final = ("sec", "nanosec")


class GoalState(IntEnum):
    """State of a goal, with its number in action_msgs/msg/GoalStatus."""

    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6

    @property
    def ended(self) -> bool:
        """True for a final state."""
        return self >= GoalState.SUCCEEDED


class GoalEvent(Enum):
    """Events of a goal."""

    BEGUN = "the axes have set off"
    CANCEL = "a client asks to cancel it"
    REACHED = "the axes stand at its end"
    STOPPED = "the axes rest, since it was canceled"
    FAILED = "it was refused, or has failed"


TRANSITIONS: Final = {
    (GoalState.ACCEPTED, GoalEvent.BEGUN): GoalState.EXECUTING,
    (GoalState.ACCEPTED, GoalEvent.CANCEL): GoalState.CANCELING,
    (GoalState.ACCEPTED, GoalEvent.FAILED): GoalState.ABORTED,
    (GoalState.EXECUTING, GoalEvent.CANCEL): GoalState.CANCELING,
    (GoalState.EXECUTING, GoalEvent.REACHED): GoalState.SUCCEEDED,
    (GoalState.EXECUTING, GoalEvent.FAILED): GoalState.ABORTED,
    (GoalState.CANCELING, GoalEvent.CANCEL): GoalState.CANCELING,
    (GoalState.CANCELING, GoalEvent.STOPPED): GoalState.CANCELED,
    (GoalState.CANCELING, GoalEvent.FAILED): GoalState.ABORTED,
}
"""State after an event; pairs that are missing here are impossible."""


class ActiveGoal:
    """A goal from its arrival to its result."""

    def __init__(self, goal_id: str, args: object) -> None:
        self.goal_id = goal_id
        self.args = args
        self.state: GoalState = GoalState.ACCEPTED

    def take(self, event: GoalEvent) -> None:
        """Change the state by an event; raise ValueError if the event is impossible now."""
        after = TRANSITIONS.get((self.state, event))
        if after is None:
            raise ValueError(f"{self.goal_id}: {event.name} does not happen to a goal that is {self.state.name}")
        self.state = after


class RefusedGoalError(InputError):
    """A goal was rejected before any motion; `code` is that of the action's result."""

    def __init__(self, message: str, code: FollowCode = FollowCode.INVALID_GOAL) -> None:
        super().__init__(message)
        self.code = code


@dataclass(frozen=True, slots=True, eq=False)
class FollowGoal:
    """An accepted goal with its plan.

    Attributes:
        plan: the motion.
        end_tolerances: shape (joints,), largest distance of each joint from the end, in mm and degrees; inf: any.
        late_max_s: longest delay after the trajectory's own end; None: any.
    """

    plan: Plan
    end_tolerances: FloatArray
    late_max_s: float | None

    def missed(self, joints: list[float]) -> str | None:
        """Return a line about the joint farthest beyond its tolerance; None if all are within."""
        robot, end = self.plan.robot, self.plan.motion.positions(np.array([self.plan.motion.duration_s]))[0]
        away = np.abs(np.array(joints) - end)
        beyond = away - self.end_tolerances
        worst = int(np.argmax(beyond))
        if beyond[worst] <= 0.0:
            return None
        joint = robot.joints[worst]
        return (
            f"{joint.name}: stands {away[worst]:.4f} {joint.unit} from the end"
            f" (limit: {self.end_tolerances[worst]:.4f} {joint.unit})"
        )


def follow_goal(robot: Robot, args: object, standing: list[float]) -> FollowGoal:
    """Check the arguments of a goal, in rad and m, for a machine at `standing`, in mm and degrees.

    A first point at 0 s within START_TOLERANCES of the machine is moved to the machine's position. Without a point at 0
    s the motion begins at the machine's position.

    Raises:
        RefusedGoalError: joints do not match, times do not rise, a value is missing or beyond a limit, the start is
            elsewhere, or a tolerance cannot be kept; the message names joint, value and limit.
    """
    try:
        goal = Table(args, "JSON object")
        goal.check_keys(_KEYS)
        _check_stamp(goal)
        points = read_message(goal.values)
        _check_names(robot, points)
        least = step_tolerances(robot)
        _check_path_tolerances(robot, goal, least)
        end_tolerances = _end_tolerances(robot, goal, least)
        begun = _begun_at(robot, points.in_units(FileUnits.named("rad,m"), robot), standing)
        joint_points = begun.joint_points(robot)
        joint_points.check_within(robot)
        motion = FileMotion.of(robot, joint_points, None, 0.0).whole
        late_max_s = _seconds(goal.values.get("goal_time_tolerance"), "goal_time_tolerance")
        return FollowGoal(plan(robot, motion), end_tolerances, late_max_s or None)
    except RefusedGoalError:
        raise
    except InputError as error:
        raise RefusedGoalError(str(error)) from error


def step_tolerances(robot: Robot) -> FloatArray:
    """Return each joint's largest deviation from its plan by the firmware's step rule, shape (joints,), mm or deg."""
    per_axis = np.array([1.0 / joint.transmission.microsteps for joint in robot.axes])
    units = np.diag(END_ERROR_STEPS_MAX * UNITS_PER_FULL_STEP * per_axis)
    rounding = 1.0 + 1e-6
    return np.asarray(np.abs(robot.to_positions(units)).sum(axis=0) * rounding)


def _check_names(robot: Robot, points: Points) -> None:
    if sorted(points.names) != sorted(robot.joint_names):
        given, own = " ".join(points.names) or "none", " ".join(robot.joint_names)
        raise RefusedGoalError(f"joint_names: {given}: {robot.name} has {own}, each once", FollowCode.INVALID_JOINTS)


def _check_stamp(goal: Table) -> None:
    """Reject a start at a time of ROS' clock, which is unknown here; MoveIt sends none."""
    points = goal.values.get("trajectory")
    header = points.get("header") if isinstance(points, dict) else None
    stamp = header.get("stamp") if isinstance(header, dict) else None
    if _seconds(stamp, "header.stamp"):
        raise RefusedGoalError(
            "header.stamp: a start at a time of ROS' clock, which the bridge does not have; 0 starts at once",
            FollowCode.OLD_HEADER_TIMESTAMP,
        )


def _seconds(time: object, place: str) -> float:
    """Return a time or duration of ROS in seconds; 0 if it is missing."""
    if time is None:
        return 0.0
    with prefixed(f"{place}: "):
        parts = Table(time, "JSON object")
        parts.check_keys(_STAMP_KEYS)
        sec, nanosec = (number_at(key, parts.values.get(key, 0)) for key in _STAMP_KEYS)
    return sec + nanosec / 1e9


def _begun_at(robot: Robot, points: Points, standing: list[float]) -> Points:
    """Return the points with the machine's position as the first one."""
    if not len(points.times_s):
        raise RefusedGoalError("points: there are none; to stop a motion, cancel its goal")
    at = dict(zip(robot.joint_names, standing, strict=True))
    if points.times_s[0] != 0.0:
        return points.begun_at(at)
    start = np.array([at[name] for name in points.names])
    _check_start(robot, points, start)
    return replace(points, positions=np.vstack([start, points.positions[1:]]))


def _check_start(robot: Robot, points: Points, standing: FloatArray) -> None:
    for name, first, stands in zip(points.names, points.positions[0].tolist(), standing.tolist(), strict=True):
        unit = robot.joint(name).unit
        limit = START_TOLERANCES[unit]
        if abs(first - stands) > limit:
            raise RefusedGoalError(
                f"{name}: the trajectory starts at {first:.4f} {unit}, the machine stands at {stands:.4f} {unit}"
                f" (limit: {limit:.4g} {unit}); a first point after 0 s moves it there"
            )


# --- tolerances


def _tolerances(robot: Robot, goal: Table, key: str) -> dict[str, dict[str, float]]:
    """Return tolerances by joint in mm and degrees; 0 means the default and is left out."""
    if goal.values.get(f"component_{key}"):
        raise RefusedGoalError(f"component_{key}: is for joints with several degrees of freedom; leave it out")
    found: dict[str, dict[str, float]] = {}
    for i, value in enumerate(goal.elements(key) if goal.values.get(key) else [], start=1):
        place = f"{key} {i}"
        with prefixed(f"{place}: "):
            entry = Table(value, "JSON object")
            entry.check_keys(_TOLERANCE_KEYS)
            values = {each: number_at(each, entry.values.get(each, 0.0)) for each in _TOLERANCE_KEYS[1:]}
        name = entry.values.get("name")
        if name not in robot.joint_names:
            raise RefusedGoalError(f"{place}: {name} is no joint of {robot.name}", FollowCode.INVALID_JOINTS)
        per_unit = PER_ROS_UNIT[robot.joint(str(name)).unit]
        found[str(name)] = {each: per_unit * number for each, number in values.items() if number}
    return found


def _check_path_tolerances(robot: Robot, goal: Table, least: FloatArray) -> None:
    """Reject path tolerances below the firmware's own step rule; nothing could check them in time."""
    for name, values in _tolerances(robot, goal, "path_tolerance").items():
        joint, limit = robot.joint(name), float(least[robot.index_of(name)])
        if 0.0 < values.get("position", inf) < limit:
            raise RefusedGoalError(
                f"path_tolerance, {name}: {values['position']:.4g} {joint.unit} is less than 9/16 step, {limit:.4g}"
                f" {joint.unit}, which a stepper cannot keep"
            )
        for each in ("velocity", "acceleration"):
            if values.get(each, 0.0) > 0.0:
                raise RefusedGoalError(f"path_tolerance, {name}: {each} is not watched; leave it 0")


def _end_tolerances(robot: Robot, goal: Table, least: FloatArray) -> FloatArray:
    """Return the largest distances of joints from the end; velocities do not count, since the machine stops there."""
    tolerances = least.copy()
    for name, values in _tolerances(robot, goal, "goal_tolerance").items():
        if position := values.get("position"):
            tolerances[robot.index_of(name)] = position if position > 0.0 else inf
    return tolerances
