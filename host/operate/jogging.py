"""Jog one joint or the tool: at a speed for a time, until a condition holds or until Ctrl-C, or by a step."""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, copysign, floor, inf
from typing import Final

import numpy as np

from steptwin.host.client import Progress, StreamedMotion
from steptwin.host.client.axis import AxisClient
from steptwin.host.client.pausing import abandon_trajectory
from steptwin.host.client.profile_motion import (
    VELOCITY_MIN_UNITS_PER_S,
    VelocityTarget,
    drive,
    follow,
    halt,
    reports_zero_speed,
)
from steptwin.host.client.waiting import POLL_S
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import at_least, at_most, outside
from steptwin.host.common.errors import DeviceFaultError, InputError
from steptwin.host.operate.moving import Moved, axes_concerned, move_joints, move_within
from steptwin.host.operate.running import run_plan
from steptwin.host.operate.session import MachineCharge, Session
from steptwin.host.operate.setting_up import clear_targets, restore_decelerations
from steptwin.host.planning.motions.joint_move import limits_along
from steptwin.host.planning.tool_by_hand import StepFrame, ToolStep, check_tool_jog, plan_tool_jog, plan_tool_step
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.poses import PoseDocument
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od
from steptwin.protocol.cia402 import Status

STEP_SPEED_PERCENT: Final = 20.0
"""Default speed of a step, in percent of the highest speeds: 50 mm/s for the tool."""
SPEED_PERCENT_MIN: Final = 1.0

_THOUSANDTHS: Final = 1000
"""Messages give valid values in 1/1000 mm or degree, which is less than half a step of any joint."""


@dataclass(frozen=True, slots=True)
class ToolJogged:
    """A finished jog of the tool: joint positions in mm and degrees, and whether the end of the path was reached."""

    coordinate: str
    start: list[float]
    end: list[float]
    at_end: bool
    pose: PoseDocument | None


def jog_tool(
    session: Session,
    coordinate: str,
    speed: float,
    seconds: float | None,
    *,
    frame: StepFrame = StepFrame.WORLD,
    until: Callable[[], bool] = lambda: False,
) -> ToolJogged:
    """Move the tool along an axis x, y or z of the world or tool frame, or rotate it about this axis or by phi.

    The signed speed is in mm/s or deg/s. The path ends at the limits of reach and joints. `until` is called every 10
    ms. When it returns True or the time is over, the tool halts on its line and the rest of the path is abandoned.
    Without a time, KeyboardInterrupt does the same and is not raised further.

    Raises:
        InputError: the tool cannot move in this direction (with the reason), or as `execute_live`.
        DeviceFaultError, BusError: as `execute_live`.
    """
    check_tool_jog(session.robot, coordinate, speed)
    with session.charge("jog") as charge:
        plan = plan_tool_jog(session.robot, charge.start.joints, coordinate, speed, frame)
        machine = charge.enable()
        move_within(session, charge.start.units, plan.start_units)
        start = session.positions(plan.start_units)
        if until():
            return ToolJogged(coordinate, start, start, at_end=False, pose=session.pose(start))
        stream = machine.start(StreamedMotion(plan.records(), plan.start_units))
        until_s = session.link.now_s() + (inf if seconds is None else seconds)
        try:
            while not (stream.ended or session.link.now_s() >= until_s or until()):
                machine.wait(POLL_S)
        except KeyboardInterrupt:
            if seconds is not None:
                raise
        if not stream.ended:
            abandon_trajectory(machine)
        end = session.positions(machine.positions_units())
    return ToolJogged(coordinate, start, end, stream.ended, session.pose(end))


@dataclass(frozen=True, slots=True)
class Jogged:
    """A finished jog of a joint: start and end in its unit, and whether a software position limit ended it."""

    joint: str
    start: float
    end: float
    at_limit: bool


def check_jog(robot: Robot, name: str, speed: float) -> Joint:
    """Return the joint of this name; raise InputError if it does not exist or the speed is not within its limits.

    At the lowest speed, the slowest moving axis has `VELOCITY_MIN_UNITS_PER_S`.
    """
    i = robot.index_of(name)
    joint = robot.joints[i]
    speed_min = VELOCITY_MIN_UNITS_PER_S / min(map(abs, travels_per_unit(robot, i).values()))
    speed_max, _ = limits_along(robot, _one(robot, i))
    if not speed_min <= abs(speed) <= speed_max:
        limit = f"from {at_least(speed_min)} to {at_most(speed_max)} {joint.unit}/s, with a sign"
        raise InputError(f"{name}: a speed of {speed:g} {joint.unit}/s is not {limit}")
    return joint


def travels_per_unit(robot: Robot, joint: int) -> dict[int, float]:
    """Return the travel of each axis in wire units per mm or degree of a joint that moves alone."""
    return {
        axis: element * robot.axes[axis].transmission.wire_units_per_unit
        for axis, element in robot.coupling.axes_moved_by(joint).items()
    }


def jog(
    session: Session, name: str, speed: float, seconds: float | None, *, until: Callable[[], bool] = lambda: False
) -> Jogged:
    """Move one joint at a speed until the time is over, `until` returns True, or the joint has reached its limit.

    All axes that are coupled to the joint move in proportion, so the other joints do not move. All ramps have the
    highest acceleration that joint and axes allow. The board keeps the joint's limits if the joint has a position
    reference; otherwise there are no limits. The signed speed is in mm/s or deg/s. The time includes the ramp up.
    `until` is called every 10 ms and once before the start. Without a time the joint moves until KeyboardInterrupt,
    which then ends the jog by a ramp and is not raised further.

    Raises:
        InputError, DeviceFaultError, BusError: as `move`, but without a position reference, too, the joint may move.
    """
    robot = session.robot
    joint = robot.joints.index(check_jog(robot, name, speed))
    axes = {i: session.machine.axes[i] for i in robot.coupling.axes_moved_by(joint)}
    moving = list(axes.values())
    with session.charge("jog", needs=()) as charge:
        charge.enable(axes)
        start = _position(charge, joint)
        if until():
            return Jogged(name, start, start, at_limit=False)
        _set_limits(charge, joint, axes)
        drive(session.link, _drives(robot, joint, speed, axes))
        until_s = session.link.now_s() + (inf if seconds is None else seconds)
        try:
            follow(
                session.link,
                moving,
                lambda: session.link.now_s() >= until_s or until() or all(map(_at_limit, moving)),
            )
        except KeyboardInterrupt:
            if seconds is not None:
                raise
        at_limit = all(map(_at_limit, moving))
        halt(session.link, moving)
        clear_targets(moving)
        restore_decelerations(session.machine, robot, axes)
        end = _position(charge, joint)
    return Jogged(name, start, end, at_limit)


def _one(robot: Robot, joint: int) -> FloatArray:
    """Return joint displacements with 1 for one joint and 0 for the others."""
    return np.array([float(other == joint) for other in range(len(robot.joints))])


def _drives(robot: Robot, joint: int, speed: float, axes: dict[int, AxisClient]) -> list[VelocityTarget]:
    """Return the velocity targets of the axes with which one joint moves alone."""
    _, acceleration = limits_along(robot, _one(robot, joint))
    drives = []
    for i, per_unit in travels_per_unit(robot, joint).items():
        drives.append(VelocityTarget(axes[i], round(speed * per_unit), ceil(acceleration * abs(per_unit))))
    return drives


def _position(charge: MachineCharge, joint: int) -> float:
    """Read the position of a joint from the step counters of its axes."""
    session, units = charge.session, list(charge.start.units)
    for axis in session.robot.coupling.axes_of(joint):
        units[axis] = session.machine.axes[axis].read(od.POSITION_ACTUAL)
    return session.positions(units)[joint]


def _set_limits(charge: MachineCharge, joint: int, axes: dict[int, AxisClient]) -> None:
    """Write the joint's limits to the axes, so the board keeps them even if this program ends.

    Because the other joints do not move, all axes reach their limits at the same time. The limits can be computed only
    if these axes, and those on which the joint's position depends, have a position reference.
    """
    robot = charge.session.robot
    if not charge.start.knows(axes.keys() | robot.coupling.axes_of(joint).keys()):
        return
    ends = np.array([charge.start.joints, charge.start.joints])
    ends[:, joint] = robot.joints[joint].lower, robot.joints[joint].upper
    axis_ends = robot.coupling.to_axes(ends) * robot.wire_units_per_unit
    for i, axis in axes.items():
        axis.write(od.POSITION_LIMIT_MIN, ceil(axis_ends[:, i].min()))
        axis.write(od.POSITION_LIMIT_MAX, floor(axis_ends[:, i].max()))


def _at_limit(axis: AxisClient) -> bool:
    status = axis.drive_status
    return status is not None and reports_zero_speed(axis) and bool(status.statusword & Status.INTERNAL_LIMIT)


def check_step(robot: Robot, name: str, distance: float) -> Joint:
    """Return the joint of this name; raise InputError if there is none or the distance is out of range.

    The smallest step is one wire unit of each axis that moves, the largest the joint's travel.
    """
    i = robot.index_of(name)
    joint = robot.joints[i]
    least, travel = 1 / min(map(abs, travels_per_unit(robot, i).values())), joint.upper - joint.lower
    if not least <= abs(distance) <= travel:
        limits = f"from {at_least(least)} to {at_most(travel)} {joint.unit}"
        raise InputError(f"{name}: a step of {distance:g} {joint.unit} is not {limits}, with a sign")
    return joint


def check_step_speed(speed_percent: float) -> None:
    """Raise InputError unless a step may have this part of the highest speeds."""
    if not SPEED_PERCENT_MIN <= speed_percent <= 100:
        raise InputError(f"speed_percent={speed_percent:g}: is not from {SPEED_PERCENT_MIN:g} to 100 percent")


def step_joint(
    session: Session,
    name: str,
    distance: float,
    *,
    speed_percent: float = STEP_SPEED_PERCENT,
    progress: Progress = lambda _: None,
) -> Moved:
    """Move one joint by a distance in mm or degrees, with a sign; the other joints stay.

    A joint that knows its position keeps its limits; another one moves in any case, up to its limit switches. The
    part of the speed is that of the joint's highest speed and acceleration.

    Raises:
        InputError, DeviceFaultError, BusError: as `move`, but positions may be unknown.
    """
    joint = check_step(session.robot, name, distance)
    check_step_speed(speed_percent)
    i = session.robot.joints.index(joint)
    with session.charge("jog", needs=()) as charge:
        standing = charge.start.joints[i]
        goal: list[float | None] = [None] * len(session.robot.joints)
        goal[i] = standing + distance
        if charge.start.knows(axes_concerned(session.robot, goal)):
            goal[i] = _within_limits(joint, standing, standing + distance)
        return move_joints(charge, goal, speed_percent, progress)


def _within_limits(joint: Joint, start: float, goal: float) -> float:
    """Return a goal within the limits; raise InputError if it is more than half a step beyond a limit.

    Steps of rounded distances may pass a limit by rounding. A joint outside of its limits may move towards them.
    """
    limit = min(max(goal, joint.lower), joint.upper)
    if abs(goal - limit) < 0.5 / joint.transmission.steps_per_unit:
        return limit
    if abs(goal - limit) < abs(start - limit) and (goal - limit) * (start - limit) > 0:
        return goal
    towards = (limit - start) * (goal - start) > 0
    left = copysign(floor(_THOUSANDTHS * abs(limit - start)) / _THOUSANDTHS if towards else 0.0, goal - start)
    passing = f"{left:+g} {joint.unit} passes" if left else "only the other direction passes"
    raise InputError(f"{joint.name}: {outside(goal, joint.lower, joint.upper, joint.unit)}; {passing}")


def step_tool(session: Session, step: ToolStep, *, progress: Progress = lambda _: None) -> Moved:
    """Move or rotate the tool by a step, on the present branch of the arm.

    Raises:
        InputError: the path is not possible (with the nearest possible step), or as `execute_live`.
        DeviceFaultError, BusError: as `execute_live`; DeviceFaultError also if an axis ends at another step.
    """
    check_step_speed(step.speed_percent)
    with session.charge("jog") as charge:
        plan = plan_tool_step(session.robot, charge.start.joints, step)
        outcome = run_plan(charge, plan, "jog", progress=progress)
    for axis in outcome.axes:
        if not axis.passed:
            raise DeviceFaultError(f"{axis.name}: ended {axis.error_steps:.4f} steps from where planned")
    goal = session.positions([axis.planned_units for axis in outcome.axes])
    return Moved(outcome.start, goal, outcome.end, plan.motion.duration_s, session.pose(outcome.end))
