"""Plan a motion of the tool that lasts while a button is held: straight on, as far as reach and limits permit.

Along the path the joints move by q'(s) for each mm or degree s of the tool. So the tool may have at most the speed

    v(s) = min(speed_max / |q'|, sqrt(acceleration_max / |q''|))

over all joints and axes, at a constant speed; ramps are the planner's. The way ends where the speed asked for would be
too high. A way that would end soon is made at half the speed, or half of that, since near a singularity v(s) falls.
"""

from contextlib import suppress
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import at_most, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motions.following import present_branch
from steptwin.host.planning.paths import COORDINATES
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.tool_step import (
    COORDINATE_UNITS,
    SPEED_MAX_MM_S,
    TURN_MAX_DEG,
    TURN_SPEED_MAX_DEG_S,
    ToolStep,
    farthest_part,
    plan_tool_step,
    step_path,
    within_limits,
)
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot

WAY_MAX_MM: Final = 2000.0
"""Longest way of one jog; a turn is one of a full circle."""
_PER_UNIT: Final = 2
"""Places in a mm or degree at which reach and speeds are looked at."""
_HALVINGS: Final = 5
_SOON_S: Final = 1.0
"""A way that is over sooner is made more slowly."""
_SHORTER: Final = 0.98
_SHORTENINGS: Final = 4
"""Number of times that a way which the planner refuses is shortened: it looks closer, and at the ramps."""


def tool_speed_max(coordinate: str) -> float:
    """Return the highest speed of a jog along a coordinate, in mm/s or deg/s; InputError if there is no such one."""
    if coordinate not in COORDINATES:
        raise unknown("coordinate", coordinate, COORDINATES)
    return TURN_SPEED_MAX_DEG_S if coordinate == "phi" else SPEED_MAX_MM_S


def check_tool_jog(coordinate: str, speed: float) -> None:
    """Raise InputError unless the coordinate exists and the speed, in mm/s or deg/s, is within its limit."""
    speed_max = tool_speed_max(coordinate)
    if not 0 < abs(speed) <= speed_max:
        unit = COORDINATE_UNITS[coordinate]
        limit = f"above 0 and up to {at_most(speed_max)} {unit}/s, with a sign"
        raise InputError(f"{coordinate}: a speed of {speed:g} {unit}/s is not {limit}")


def plan_tool_jog(robot: Robot, standing: list[float], coordinate: str, speed: float) -> Plan:
    """Plan a straight way of the tool, or a turn on the spot, from a joint position at a speed with a sign.

    Raises:
        InputError: as `check_tool_jog`, or nothing passes in this direction; the message says why.
    """
    check_tool_jog(coordinate, speed)
    longest = TURN_MAX_DEG if coordinate == "phi" else WAY_MAX_MM
    percent = 100.0 * abs(speed) / tool_speed_max(coordinate)
    whole = ToolStep({coordinate: longest if speed > 0 else -longest}, percent)
    way, fraction = _farthest(_speeds_along(robot, within_limits(robot, standing), whole), abs(speed))
    for _ in range(_SHORTENINGS if way else 0):
        with suppress(InputError):
            distances = whole.part(way / longest).distances
            return plan_tool_step(robot, standing, ToolStep(distances, fraction * percent))
        way *= _SHORTER
    part = farthest_part(robot, standing, whole)
    return plan_tool_step(robot, standing, whole if part is None else part)  # the whole way says why nothing passes


def _speeds_along(robot: Robot, start: FloatArray, step: ToolStep) -> FloatArray:
    """Return the highest speed of the tool, in mm/s or deg/s, at places of its path up to the first out of reach."""
    path, kinematics = step_path(robot, start, step), make_kinematics(robot)
    way = max(map(abs, step.distances.values()))
    count = round(way * _PER_UNIT) + 1
    places = np.linspace(0.0, path.length_mm, count)
    solved = kinematics.solve(path.poses(places), present_branch(robot, start), start)
    kept = solved.reachable & np.logical_and.reduce([each.kept for each in kinematics.singularities(solved.joints)])
    reached = count if kept.all() else int(np.argmin(kept))
    if reached == 0:
        return np.zeros(1)
    joints, scale = solved.joints[:reached], path.length_mm / way
    slopes = kinematics.joint_velocities(joints, path.derivatives(places[:reached])) * scale
    return _highest(robot, slopes)


def _highest(robot: Robot, slopes: FloatArray) -> FloatArray:
    """Return v(s) of this module's first lines, shape (n,), from q'(s), of shape (n, joints)."""
    bends = np.gradient(slopes, 1 / _PER_UNIT, axis=0) if len(slopes) > 1 else np.zeros_like(slopes)
    to_axes = robot.coupling.to_axes
    joints = robot.joints
    with np.errstate(divide="ignore"):
        speeds = [
            np.array([joint.speed_max for joint in joints]) / np.abs(slopes),
            robot.axis_speeds_max / np.abs(to_axes(slopes)),
            np.sqrt(np.array([joint.acceleration_max for joint in joints]) / np.abs(bends)),
            np.sqrt(robot.axis_accelerations_max / np.abs(to_axes(bends))),
        ]
    return np.asarray(np.min([each.min(axis=1) for each in speeds], axis=0))


def _farthest(speeds: FloatArray, asked: float) -> tuple[float, float]:
    """Return the way that is passed, in mm or degrees, and with which part of the speed asked for."""
    ways = []
    for halving in range(_HALVINGS + 1):
        fraction = 0.5**halving
        passing = speeds >= fraction * asked
        places = len(speeds) if passing.all() else int(np.argmin(passing))
        way = max(places - 1, 0) / _PER_UNIT
        if way >= fraction * asked * _SOON_S:
            return way, fraction
        ways.append((way, fraction))
    return max(ways)
