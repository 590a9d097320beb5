"""Move all axes to a joint position or a tool pose by synchronised profiles."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, copysign, nan

import numpy as np

from steptwin.host.client import Progress
from steptwin.host.client.profile_motion import VELOCITY_MIN_UNITS_PER_S, ProfileMove, move_together
from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.bad_input import nearest_within, outside
from steptwin.host.common.errors import InputError
from steptwin.host.operate.session import MachineCharge, Session
from steptwin.host.operate.setting_up import restore_decelerations
from steptwin.host.planning.motions.joint_move import fastest_law, limits_along
from steptwin.host.planning.programs.moves import Moves
from steptwin.host.planning.programs.positions import ToolPosition
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.poses import Pose, PoseDocument
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.workspace.nearest_pose import passing_text

Goal = Sequence[float | None] | Callable[[list[float]], Sequence[float | None]]
"""Joint positions in mm and degrees, None for a joint that stays; or a function of the present joint positions."""


@dataclass(frozen=True, slots=True)
class Moved:
    """A finished move: joint positions in mm and degrees, planned duration, and pose of the tool at the end.

    The pose is None if a joint has no position reference.
    """

    start: list[float]
    goal: list[float]
    end: list[float]
    planned_s: float
    pose: PoseDocument | None


def check_goal(robot: Robot, goal: Sequence[float | None]) -> None:
    """Raise InputError, which names the first joint, if a position is outside of its limits; None is valid."""
    for joint, position in zip(robot.joints, goal, strict=True):
        if position is not None and not joint.lower <= position <= joint.upper:
            limits = (joint.lower, joint.upper, joint.unit)
            raise InputError(f"{joint.name}: {outside(position, *limits)}{nearest_within(position, *limits)}")


def goal_by_name(robot: Robot, positions: Mapping[str, float]) -> list[float | None]:
    """Return the goal of joints by name; raise InputError for an unknown joint or a position outside of its limits."""
    goal: list[float | None] = [None] * len(robot.joints)
    for name, position in positions.items():
        goal[robot.index_of(name)] = position
    check_goal(robot, goal)
    return goal


def joints_at(robot: Robot, position: ToolPosition, standing: list[float]) -> list[float]:
    """Return the joint positions for a position of the tool, on its branch or on the present branch of the arm.

    Coordinates that are not given do not change. Raises InputError if the arm cannot reach the position.
    """
    joints = Moves(robot, {}, np.array(standing)).joints_at(position)
    return [float(each) for each in joints]


def nearest_joints(robot: Robot, position: ToolPosition, near: list[float]) -> list[float]:
    """Return the joint position with a tool pose that is reached fastest from the joint position `near`.

    Coordinates that are not given are those at `near`; some arms determine the attitude. Raises InputError if the
    mechanism cannot be assembled at `near`, or if no branch of the inverse kinematics reaches the pose; the message
    gives the reason of each branch and the nearest reachable pose.
    """
    standing, kinematics = np.array(near), make_kinematics(robot)
    present: Pose = tuple(kinematics.forward(standing[np.newaxis])[0].tolist())
    if not np.isfinite(present).all():
        raise InputError("the tool's present pose is unknown: the mechanism cannot be assembled at the axes' positions")
    if kinematics.attitude_follows:
        present = (*present[:3], nan)
    pose = kinematics.task.changed(present, position.coordinates, position.orientation)
    branches = kinematics.inverse(np.array([pose]), standing)
    within = [branch.joints[0] for branch in branches if branch.reachable[0]]
    if not within:
        why: dict[str | None, list[str]] = {}
        for branch in branches:
            why.setdefault(branch.reason(0), []).append(branch.name)
        reasons = "; ".join(f"{', '.join(names)}: {reason}" for reason, names in why.items())
        passing = passing_text(robot, pose, standing)
        raise InputError(f"no branch reaches {kinematics.task.words(pose)}: {reasons}{passing}")
    nearest = min(within, key=lambda joints: 1 / limits_along(robot, joints - standing)[0])
    return [float(position) for position in nearest]


def move(
    session: Session,
    goal: Goal,
    *,
    speed_percent: float = 100.0,
    progress: Progress = lambda _: None,
) -> Moved:
    """Move joints to a position, straight in joint space.

    A joint that stays may be outside of its limits. It needs no position reference, unless it is coupled to a joint
    that moves. For a goal that is a function, all joints need a position reference. StepTwin knows no obstacles: the
    operator must watch the machine.

    Args:
        session: the machine.
        goal: joint positions, or a function that returns them.
        speed_percent: percentage of the joints' speed and acceleration limits.
        progress: called with the finished fraction of the longest travel.

    Raises:
        InputError: a goal is outside of its limits, or a program that has not claimed the machine moves it.
        DeviceFaultError: a drive is in fault or was stopped, or a joint that must move has no position reference.
        BusError: another program is in charge, or a node does not answer.
    """
    robot, needs = session.robot, None
    if not callable(goal):
        check_goal(robot, goal)
        needs = [robot.axis_names[axis] for axis in axes_concerned(robot, goal)]
    with session.charge("move", needs=needs) as charge:
        if callable(goal):
            goal = goal(charge.start.joints)
            check_goal(robot, goal)
        return move_joints(charge, goal, speed_percent, progress)


def move_joints(charge: MachineCharge, goal: Sequence[float | None], speed_percent: float, progress: Progress) -> Moved:
    """Make a move with a machine in charge, without a check of limits; arguments and errors as for `move`."""
    session, start = charge.session, charge.start
    goal_units = units_at(session, start.units, goal)
    moving = travels(start.units, goal_units)
    machine = charge.enable(moving)
    planned_s = move_within(session, start.units, goal_units, speed_percent, progress)
    end = session.positions(machine.positions_units(moving))
    pose = session.pose(end) if charge.start.knows() else None
    return Moved(start.joints, _reached(start.joints, goal), end, planned_s, pose)


def _reached(start: list[float], goal: Sequence[float | None]) -> list[float]:
    return [standing if position is None else position for position, standing in zip(goal, start, strict=True)]


def units_at(session: Session, start_units: list[int], goal: Sequence[float | None]) -> list[int]:
    """Return the axes' target positions in wire units for a goal; an axis that need not move keeps its position."""
    reached = session.units(_reached(session.positions(start_units), goal))
    moved = _axes_moved(session.robot, goal)
    return [units if axis in moved else start_units[axis] for axis, units in enumerate(reached)]


def _axes_moved(robot: Robot, goal: Sequence[float | None]) -> set[int]:
    """Return the axes that move for a goal."""
    moving = [joint for joint, position in enumerate(goal) if position is not None]
    return {axis for joint in moving for axis in robot.coupling.axes_moved_by(joint)}


def axes_concerned(robot: Robot, goal: Sequence[float | None]) -> set[int]:
    """Return the axes that need a position reference: those that move, and those on which their targets depend."""
    moved, coupling = _axes_moved(robot, goal), robot.coupling
    return moved | {other for axis in moved for joint in coupling.joints_of(axis) for other in coupling.axes_of(joint)}


def travels(start_units: Sequence[int], goal_units: Sequence[int]) -> dict[int, int]:
    """Return the travel of each axis that moves, in wire units."""
    both = zip(start_units, goal_units, strict=True)
    return {axis: goal - start for axis, (start, goal) in enumerate(both) if goal != start}


def _joint_travels(robot: Robot, travels_units: Int64Array) -> FloatArray:
    """Return the joints' travels for those of the axes; for a joint with two motors, that of the farther one."""
    joint_travels = robot.to_positions(travels_units)
    for joint, skew in zip(robot.coupling.seconds, robot.skews(travels_units).tolist(), strict=True):
        joint_travels[joint] += copysign(skew / 2, joint_travels[joint])
    return joint_travels


def move_within(
    session: Session,
    start_units: list[int],
    goal_units: list[int],
    speed_percent: float = 100.0,
    progress: Progress = lambda _: None,
) -> float:
    """Make a move of enabled axes; return its planned duration in seconds.

    Afterwards the decelerations of halts are restored, because a trajectory may follow.
    """
    if start_units == goal_units:
        return 0.0
    moves, planned_s = synchronised(session.robot, start_units, goal_units, speed_percent)
    move_together(session.link, session.machine.axes, moves, progress)
    restore_decelerations(session.machine, session.robot, moves)
    return planned_s


def synchronised(
    robot: Robot, start_units: list[int], goal_units: list[int], speed_percent: float
) -> tuple[dict[int, ProfileMove], float]:
    """Scale one trapezoidal profile, with ramps of whole ms, to the travels of all moving axes.

    At least one axis must move. `speed_percent` is the percentage of the joints' speed and acceleration limits.

    Returns:
        The move of each of these axes, and the duration in seconds.
    """
    moves, travels_units = {}, travels(start_units, goal_units)
    law = fastest_law(robot, _joint_travels(robot, np.subtract(goal_units, start_units)), speed_percent / 100)
    for axis, travel_units in travels_units.items():
        velocity = max(VELOCITY_MIN_UNITS_PER_S, ceil(abs(travel_units) * law.speed))
        moves[axis] = ProfileMove(travel_units, goal_units[axis], velocity, ceil(velocity / law.ramp_s))
    return moves, law.duration_s
