"""Move all axes to a joint position or a tool pose by their own profiles, so that they arrive together."""

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
"""Joint positions in mm and degrees, None for a joint that stays; or a function of those where the machine stands."""


@dataclass(frozen=True, slots=True)
class Moved:
    """A finished move: joint positions in mm and degrees, the planned duration, and the tool's pose at the end.

    The pose is None unless every joint knows its position.
    """

    start: list[float]
    goal: list[float]
    end: list[float]
    planned_s: float
    pose: PoseDocument | None


def check_goal(robot: Robot, goal: Sequence[float | None]) -> None:
    """Raise InputError, naming the first joint, unless every joint's position is within its limits; None always is."""
    for joint, position in zip(robot.joints, goal, strict=True):
        if position is not None and not joint.lower <= position <= joint.upper:
            limits = (joint.lower, joint.upper, joint.unit)
            raise InputError(f"{joint.name}: {outside(position, *limits)}{nearest_within(position, *limits)}")


def goal_by_name(robot: Robot, positions: Mapping[str, float]) -> list[float | None]:
    """Return the goal that moves some joints, by name, within their limits; raise InputError for another joint."""
    goal: list[float | None] = [None] * len(robot.joints)
    for name, position in positions.items():
        goal[robot.index_of(name)] = position
    check_goal(robot, goal)
    return goal


def joints_at(robot: Robot, position: ToolPosition, standing: list[float]) -> list[float]:
    """Return the joints at a position of the tool, on its branch or on that of the standing arm.

    Coordinates that the position leaves out stay. Raises InputError if the arm cannot reach it.
    """
    joints = Moves(robot, {}, np.array(standing)).joints_at(position)
    return [float(each) for each in joints]


def nearest_joints(robot: Robot, position: ToolPosition, near: list[float]) -> list[float]:
    """Return the joint position that has a tool pose and is reached in the least time from the joint position `near`.

    Coordinates that the position leaves out are those at `near`; an attitude may follow from the arm. Raises InputError
    if the mechanism cannot be assembled at `near`, or if no branch of the inverse kinematics reaches the pose: the
    message gives each branch's reason and the nearest pose in reach.
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

    A joint that stays may stand outside its limits or, unless it is coupled to one that moves, not know its position,
    as after an interrupted homing: it does not move. For a goal that is a function, all positions must be known.
    StepTwin knows no obstacles: the operator must watch the machine. `speed_percent` is the part of the joints' speed
    and acceleration limits to use. `progress` is called with the part of the longest way that is covered.

    Raises:
        InputError: a joint's goal is outside its limits, or a program that claims no charge moves the machine.
        DeviceFaultError: a drive is in fault or was stopped, or a joint that is to move does not know its position.
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
    """Make a move of a machine in charge, wherever the goal is; arguments and errors are those of `move`."""
    session, start = charge.session, charge.start
    goal_units = units_at(session, start.units, goal)
    moving = ways(start.units, goal_units)
    machine = charge.enable(moving)
    planned_s = move_within(session, start.units, goal_units, speed_percent, progress)
    end = session.positions(machine.positions_units(moving))
    pose = session.pose(end) if charge.start.knows() else None
    return Moved(start.joints, _reached(start.joints, goal), end, planned_s, pose)


def _reached(start: list[float], goal: Sequence[float | None]) -> list[float]:
    return [standing if position is None else position for position, standing in zip(goal, start, strict=True)]


def units_at(session: Session, start_units: list[int], goal: Sequence[float | None]) -> list[int]:
    """Return where the axes go when the joints with a goal do, in wire units; an axis that need not move stays."""
    reached = session.units(_reached(session.positions(start_units), goal))
    moved = _axes_moved(session.robot, goal)
    return [units if axis in moved else start_units[axis] for axis, units in enumerate(reached)]


def _axes_moved(robot: Robot, goal: Sequence[float | None]) -> set[int]:
    """Return the axes that move when the joints with a goal do."""
    moving = [joint for joint, position in enumerate(goal) if position is not None]
    return {axis for joint in moving for axis in robot.coupling.axes_moved_by(joint)}


def axes_concerned(robot: Robot, goal: Sequence[float | None]) -> set[int]:
    """Return the axes that must know their positions: those that move, and all that the goal of one depends on."""
    moved, coupling = _axes_moved(robot, goal), robot.coupling
    return moved | {other for axis in moved for joint in coupling.joints_of(axis) for other in coupling.axes_of(joint)}


def ways(start_units: Sequence[int], goal_units: Sequence[int]) -> dict[int, int]:
    """Return the way of each axis that has one, in wire units."""
    both = zip(start_units, goal_units, strict=True)
    return {axis: goal - start for axis, (start, goal) in enumerate(both) if goal != start}


def _joint_ways(robot: Robot, ways_units: Int64Array) -> FloatArray:
    """Return the joints' ways when the axes make theirs: of two motors of a joint, that of the farther one."""
    joint_ways = robot.to_positions(ways_units)
    for joint, skew in zip(robot.coupling.seconds, robot.skews(ways_units).tolist(), strict=True):
        joint_ways[joint] += copysign(skew / 2, joint_ways[joint])
    return joint_ways


def move_within(
    session: Session,
    start_units: list[int],
    goal_units: list[int],
    speed_percent: float = 100.0,
    progress: Progress = lambda _: None,
) -> float:
    """Make a move of enabled axes; return its planned duration in seconds.

    Afterwards a halt brakes as before it: what follows may be a trajectory.
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
    """Scale one trapezoid, with ramps of whole ms, to the way of each axis that has one, so that all arrive together.

    At least one axis must have a way. `speed_percent` is the part of the joints' speed and acceleration limits to use.
    Return the move of each of these axes, and the duration in seconds.
    """
    moves, ways_units = {}, ways(start_units, goal_units)
    law = fastest_law(robot, _joint_ways(robot, np.subtract(goal_units, start_units)), speed_percent / 100)
    for axis, way in ways_units.items():
        velocity = max(VELOCITY_MIN_UNITS_PER_S, ceil(abs(way) * law.speed))
        moves[axis] = ProfileMove(way, goal_units[axis], velocity, ceil(velocity / law.ramp_s))
    return moves, law.duration_s
