"""Jog a joint or the tool by a step: by a distance from where the machine stands, at reduced speed."""

from math import copysign, floor
from typing import Final

from steptwin.host.client import Progress
from steptwin.host.common.bad_input import at_least, at_most, outside
from steptwin.host.common.errors import DeviceFaultError, InputError
from steptwin.host.operate.jogging import ways_units
from steptwin.host.operate.moving import Moved, axes_concerned, move_joints
from steptwin.host.operate.running import run_plan
from steptwin.host.operate.session import Session
from steptwin.host.planning.tool_by_hand import ToolStep, plan_tool_step
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot

STEP_SPEED_PERCENT: Final = 20.0
"""Usual part of the highest speeds for a step: 50 mm/s for the tool."""
SPEED_PERCENT_MIN: Final = 1.0

_THOUSANDTHS: Final = 1000
"""What would pass is said in thousandths of a mm or degree, less than half a step of any joint."""


def check_step(robot: Robot, name: str, distance: float) -> Joint:
    """Return the joint of this name; raise InputError if there is none or the distance is out of range.

    The smallest step is one wire unit of each axis that moves, the largest the joint's travel.
    """
    i = robot.index_of(name)
    joint = robot.joints[i]
    least, travel = 1 / min(map(abs, ways_units(robot, i).values())), joint.upper - joint.lower
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
    """Return a goal, the limit itself if it is less than half a step beyond; raise InputError farther beyond.

    Steps of rounded distances come to a limit by rounding only. A joint outside its limits may move towards them.
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
    """Move the tool by a step, straight or on the spot, on the branch of the standing arm.

    Raises:
        InputError: the path is not possible, with what would pass; or as `execute_live`.
        DeviceFaultError, BusError: as `execute_live`; DeviceFaultError, too, if an axis ends at another step.
    """
    check_step_speed(step.speed_percent)
    with session.charge("jog") as charge:
        plan = plan_tool_step(session.robot, charge.start.joints, step)
        outcome = run_plan(charge, plan, "jog", progress=progress)
    for axis in outcome.axes:
        if not axis.passed:
            raise DeviceFaultError(f"{axis.name}: ended {axis.error_steps:.4f} steps from where planned")
    goal = session.positions([axis.planned_units for axis in outcome.axes])
    return Moved(outcome.start, goal, outcome.end, plan.trajectory.duration_s, session.pose(outcome.end))
