"""Plan one step of the tool by hand: straight along axes, or turning on the spot, at the highest allowed speed.

The axes are the world's, or the tool's own at the start. A rotation about a tool axis equals one about its direction in
the world, since the axis does not move.

Along the path the joints move by q'(s) for each mm or degree s of the tool. So the tool may have at most the speed

    v(s) = min(speed_max / |q'|, sqrt(acceleration_max / |q''|))

over all joints and axes, at a constant speed; the planner checks ramps. A jog ends where its speed would be too high. A
jog that would end soon is made at half the speed, or half of that, since v(s) falls near a singularity.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import at_most, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import check_planning_time, in_planning_time
from steptwin.host.planning.laws import SCurve
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.joint_move import joint_move
from steptwin.host.planning.motions.tool_move import (
    branches_on,
    is_straight_in_joints,
    present_branch,
    tool_move,
)
from steptwin.host.planning.paths import FreeAttitude, OnTheSpot, Oriented, StraightLine, ToolPath, Turn
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import executed_duration_s, plan_stretched
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
from steptwin.host.robots.kinematics.base import tool_frames
from steptwin.host.robots.poses import PLACE, STEP_NAMES, TURNS, Pose, Task, Turning, turn_of
from steptwin.host.robots.robot import Robot

SPEED_MAX_MM_S: Final = 250.0
"""Highest speed of a tool moved by hand: the reduced speed of ISO 10218-1:2011, clause 5.6.2."""
TURN_SPEED_MAX_DEG_S: Final = 90.0
"""Highest rotation speed of a tool on the spot by hand."""
TURN_MAX_DEG: Final = 360.0

STEP_UNITS: Final = {name: PLACE.get(name, "deg") for name in STEP_NAMES}
"""Unit of each step of a tool by name; the tool's task defines the possible steps."""

_QUARTERS: Final = (0.25, 0.5, 0.75, 1.0)
_RAMP_S: Final = 0.3
"""Ramp time of the tool, unless a longer ramp makes the whole motion shorter."""
_PER_UNIT: Final = 10
"""Resolution of passing distances: tenths of a mm or degree."""


class StepFrame(StrEnum):
    """Axes of a step: the world's, or the tool's own, as `fk --matrices` prints them."""

    WORLD = "world"
    TOOL = "tool"


@dataclass(frozen=True, slots=True)
class ToolStep:
    """A step of the tool.

    Attributes:
        distances: in mm and degrees by coordinate.
        speed_percent: percentage of the highest speeds to use.
        frame: axes of x, y, z, rx, ry and rz; phi is always about the vertical.
    """

    distances: Mapping[str, float]
    speed_percent: float
    frame: StepFrame = StepFrame.WORLD

    def __post_init__(self) -> None:
        for name in self.distances:
            if name not in STEP_UNITS:
                raise unknown("coordinate", name, STEP_UNITS)
        if not any(self.distances.values()):
            raise InputError(f"a step of 0 moves nothing: {self}")
        if not self.turn_deg <= TURN_MAX_DEG:
            raise InputError(f"{self}: a step turns the tool by at most {TURN_MAX_DEG:g} deg")

    @property
    def turn_deg(self) -> float:
        """Angle by which the tool turns, by phi or about the station's axes."""
        return max(abs(self.distances.get("phi", 0.0)), float(np.linalg.norm(turn_of(self.distances))))

    @property
    def moves(self) -> bool:
        """True if the tool changes its place."""
        return any(self.distances.get(name) for name in PLACE)

    def __str__(self) -> str:
        words = ", ".join(f"{name} {value:+g} {STEP_UNITS[name]}" for name, value in self.distances.items())
        return f"the tool's {words}" if self.frame is StepFrame.TOOL else words

    def part(self, fraction: float) -> "ToolStep":
        """Return a fraction of the step in the same direction."""
        return replace(self, distances={name: fraction * value for name, value in self.distances.items()})

    def in_world(self, tool: FloatArray) -> dict[str, float]:
        """Return the distances along and about the world's axes; `tool`, (3, 3), has the tool's axes as columns."""
        along = dict(self.distances)
        for names in (tuple(PLACE), TURNS) if self.frame is StepFrame.TOOL else ():
            if any(name in along for name in names):
                way = tool @ np.array([along.get(name, 0.0) for name in names])
                along.update(zip(names, way.tolist(), strict=True))
        return along


@in_planning_time()
def plan_tool_step(robot: Robot, standing: list[float], step: ToolStep) -> Plan:
    """Plan a step from a joint position on the present branch; joints' limits make it slower.

    Raises InputError, with the reason and the passing part of the step, if the path leaves the mechanism's reach or a
    joint's limits or comes near a singularity.
    """
    _check_step(robot, step)
    try:
        return _gentle_plan(robot, standing, step)
    except InputError as error:
        raise InputError(f"{step}: {error}; {_passing_text(robot, standing, step)}") from error


def _check_step(robot: Robot, step: ToolStep) -> None:
    """Raise InputError for a step that the robot's tool cannot make anywhere."""
    kinematics = make_kinematics(robot)
    if "phi" in step.distances and kinematics.attitude_follows:
        raise InputError(f"{step}: the tool of {robot.name} does not turn by itself")
    kinematics.task.check_steps(step.distances)


def _gentle_plan(robot: Robot, standing: list[float], step: ToolStep) -> Plan:
    """Plan a step; raise InputError with the reason alone, since finding the passing part takes many plans."""
    plan, stretch = _plan(robot, standing, step, _RAMP_S)
    if stretch > 1.0:  # a ramp of the square of it needs no more acceleration at the same speed
        with suppress(InputError):
            gentle, _ = _plan(robot, standing, step, _RAMP_S * stretch**2)
            plan = min(plan, gentle, key=lambda each: each.motion.duration_s)
    return plan


@in_planning_time()
def farthest_part(robot: Robot, standing: list[float], step: ToolStep) -> ToolStep | None:
    """Return the largest passing part of a step, in tenths of a mm or degree; None if not even one tenth passes."""
    tenths = int(_PER_UNIT * max(map(abs, step.distances.values())))
    passing, failing = 0, tenths + 1
    while failing - passing > 1:  # if a distance passes, so do shorter ones
        check_planning_time()
        middle = (passing + failing) // 2
        try:
            _plan(robot, standing, step.part(middle / tenths), _RAMP_S)
        except InputError:
            failing = middle
        else:
            passing = middle
    return step.part(passing / tenths) if passing else None


def _passing_text(robot: Robot, standing: list[float], step: ToolStep) -> str:
    passing = farthest_part(robot, standing, step)
    if passing is None:
        return f"not even {1 / _PER_UNIT:g} passes in this direction: jog a joint first"
    return f"{passing} passes"


def _plan(robot: Robot, standing: list[float], step: ToolStep, ramp_s: float) -> tuple[Plan, float]:
    """Return the plan of a step with a ramp, and the factor by which the joints' limits make it slower."""
    motion = _motion(robot, within_limits(robot, standing), step, ramp_s)
    plan = plan_stretched(robot, motion)
    return plan, plan.motion.duration_s / executed_duration_s(robot, motion)


def step_path(robot: Robot, start: FloatArray, step: ToolStep) -> ToolPath:
    """Return the tool's path of a step from the joints `start`, of shape (joints,)."""
    kinematics = make_kinematics(robot)
    here: Pose = tuple(kinematics.forward(start[np.newaxis])[0].tolist())
    tool = tool_frames(kinematics, start[np.newaxis])[0, :3, :3]
    path = _path(kinematics.task, here, step, step.in_world(tool))
    return FreeAttitude(path) if kinematics.attitude_follows else path


def within_limits(robot: Robot, standing: list[float]) -> FloatArray:
    """Return a joint position limited to the joints' ranges, if only rounding to wire units exceeds them."""
    within = np.array(standing)
    units = robot.to_units(within)
    for i, joint in enumerate(robot.joints):
        clipped = within.copy()
        clipped[i] = min(max(within[i], joint.lower), joint.upper)
        if np.array_equal(robot.to_units(clipped), units):
            within = clipped
    return within


def _motion(robot: Robot, start: FloatArray, step: ToolStep, ramp_s: float) -> Motion:
    kinematics = make_kinematics(robot)
    branch = present_branch(robot, start)
    path = step_path(robot, start, step)
    try:
        goal = _goal(kinematics, path, branch, start)
    except InputError:
        if kinematics.keeps_branch:
            raise
        names, goal = branches_on(robot, path, branch, start)
        if len(names) == 1:
            raise
    speed = step.speed_percent / 100 * (SPEED_MAX_MM_S if step.moves else TURN_SPEED_MAX_DEG_S)
    if is_straight_in_joints(robot, path, start, goal):  # even at a singularity, for a lift or a wrist alone
        law = _law(path, 1.0, speed, ramp_s)
        return joint_move(robot.joint_names, tuple(start.tolist()), tuple(goal.tolist()), law)
    return tool_move(robot, path, _law(path, path.length_mm, speed, ramp_s), branch, start)


def _goal(kinematics: Kinematics, path: ToolPath, branch: str, start: FloatArray) -> FloatArray:
    """Return the joints at a path's end in their turns along the path; raise InputError if it is out of reach."""
    _solve(kinematics, path, 1.0, branch, start)  # its reason is more useful than that of a place on the path
    goal = start
    for share in _QUARTERS:  # a circle at most, so the nearest turn is the next one
        goal = _solve(kinematics, path, share, branch, goal)
    return goal


def _solve(kinematics: Kinematics, path: ToolPath, share: float, branch: str, near: FloatArray) -> FloatArray:
    solved = kinematics.solve(path.poses(np.array([share * path.length_mm])), branch, near)
    if not solved.reachable[0]:
        raise InputError(str(solved.reason(0)))
    joints: FloatArray = solved.joints[0]
    return joints


def _path(task: Task, here: Pose, step: ToolStep, distances: Mapping[str, float]) -> ToolPath:
    """Return the path of a step from a pose; distances are those along and about the world's axes."""
    there = task.stepped(here, distances)
    if task.is_flat:
        return StraightLine(here, there) if step.moves else Turn(here, distances.get("phi", 0.0))
    turn_deg, orientation = turn_of(distances), np.array(here[3:])
    if not step.moves and task.is_spin(orientation, turn_deg):
        raise InputError("turns the tool about itself only, and its spin follows from the arm: nothing would move")
    places = StraightLine(here[:3], there[:3]) if step.moves else OnTheSpot(here[:3], step.turn_deg)
    return Oriented(places, Turning(task, orientation, turn_deg))


def _law(path: ToolPath, distance: float, speed: float, ramp_s: float) -> SCurve:
    """Return the law that covers a distance with the tool's speed along its path."""
    return SCurve.at_speed(distance, speed * distance / path.length_mm, ramp_s)


WAY_MAX_MM: Final = 2000.0
"""Longest distance of a jog; a rotation is at most a full circle."""
_PLACES_PER_UNIT: Final = 2
"""Number of places in a mm or degree where reach and speeds are computed."""
_HALVINGS: Final = 5
_SOON_S: Final = 1.0
"""Duration below which a jog is made more slowly."""
_SHORTER: Final = 0.98
_SHORTENINGS: Final = 4
"""Number of times that a distance refused by the planner is shortened; the planner checks more places, and ramps."""


def tool_speed_max(coordinate: str) -> float:
    """Return the highest speed of a jog along a coordinate, in mm/s or deg/s."""
    return TURN_SPEED_MAX_DEG_S if STEP_UNITS[coordinate] == "deg" else SPEED_MAX_MM_S


def check_tool_jog(robot: Robot, coordinate: str, speed: float) -> None:
    """Raise InputError for a coordinate or a speed, in mm/s or deg/s, that the robot's tool cannot have.

    A dependent attitude is refused when the jog is planned.
    """
    steps = make_kinematics(robot).task.steps
    if coordinate not in steps:
        raise unknown("coordinate", coordinate, steps)
    speed_max = tool_speed_max(coordinate)
    if not 0 < abs(speed) <= speed_max:
        unit = STEP_UNITS[coordinate]
        limit = f"above 0 and up to {at_most(speed_max)} {unit}/s, with a sign"
        raise InputError(f"{coordinate}: a speed of {speed:g} {unit}/s is not {limit}")


@in_planning_time()
def plan_tool_jog(
    robot: Robot, standing: list[float], coordinate: str, speed: float, frame: StepFrame = StepFrame.WORLD
) -> Plan:
    """Plan a straight jog of the tool, or a rotation on the spot, from a joint position at a speed with sign.

    Raises:
        InputError: as `check_tool_jog`, or no distance passes in this direction; the message has the reason.
    """
    check_tool_jog(robot, coordinate, speed)
    longest = TURN_MAX_DEG if STEP_UNITS[coordinate] == "deg" else WAY_MAX_MM
    percent = 100.0 * abs(speed) / tool_speed_max(coordinate)
    whole = ToolStep({coordinate: longest if speed > 0 else -longest}, percent, frame)
    _check_step(robot, whole)
    way, fraction = _farthest(_speeds_along(robot, within_limits(robot, standing), whole), abs(speed))
    for _ in range(_SHORTENINGS if way else 0):
        with suppress(InputError):
            slower = replace(whole.part(way / longest), speed_percent=fraction * percent)
            return _gentle_plan(robot, standing, slower)
        way *= _SHORTER
    part = farthest_part(robot, standing, whole) or whole.part(1 / (_PER_UNIT * longest))
    return plan_tool_step(robot, standing, part)  # if not even the least passes, its error has the reason


def _speeds_along(robot: Robot, start: FloatArray, step: ToolStep) -> FloatArray:
    """Return the highest speed of the tool, in mm/s or deg/s, at places of its path up to the first out of reach."""
    path, kinematics = step_path(robot, start, step), make_kinematics(robot)
    way = max(map(abs, step.distances.values()))
    count = round(way * _PLACES_PER_UNIT) + 1
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
    """Return v(s) as in the module's docstring, shape (n,), from q'(s), of shape (n, joints)."""
    bends = np.gradient(slopes, 1 / _PLACES_PER_UNIT, axis=0) if len(slopes) > 1 else np.zeros_like(slopes)
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
    """Return the passing distance, in mm or degrees, and the fraction of the requested speed."""
    ways = []
    for halving in range(_HALVINGS + 1):
        fraction = 0.5**halving
        passing = speeds >= fraction * asked
        places = len(speeds) if passing.all() else int(np.argmin(passing))
        way = max(places - 1, 0) / _PLACES_PER_UNIT
        if way >= fraction * asked * _SOON_S:
            return way, fraction
        ways.append((way, fraction))
    return max(ways)
