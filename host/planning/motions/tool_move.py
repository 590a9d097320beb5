"""Move the tool along a path in space by a time law, with joints from the inverse kinematics at every instant.

The joints are checked and have no jumps: they stay on one branch of the arm, or on the one nearest to the last joints.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import isclose
from typing import Final, Self

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.planning.laws import Law
from steptwin.host.planning.motion import JointLaw, Motion
from steptwin.host.planning.paths import FreeAttitude, OutOfReachError, ToolPath
from steptwin.host.planning.peaks import windows_ms
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics import Branch, Kinematics, make_kinematics
from steptwin.host.robots.kinematics.base import LIMIT_TOLERANCE, Constraint
from steptwin.host.robots.robot import Robot


def follow(robot: Robot, poses: FloatArray, t_s: FloatArray, branch: str, near: FloatArray) -> FloatArray:
    """Return joints of shape (n, joints) for tool poses of shape (n, width) along a path, at times (n,).

    They begin at the turns nearest to `near`, of shape (joints,), and continue without jumps of a whole turn. The
    planner checks the joints' limits, not this function. It raises InputError, with the time, if the path leaves the
    mechanism's reach or is too close to a singularity.
    """
    return followed(robot, poses, at_time(t_s), branch, near).joints


Where = Callable[[int], str]
"""Returns the position of a pose on its path as text, by its index, such as `at t = 0.100 s`."""


def at_time(t_s: FloatArray) -> Where:
    """Return the `Where` of a path from the times, of shape (n,), of its poses."""
    return lambda i: f"at t = {t_s[i]:.3f} s"


def followed(robot: Robot, poses: FloatArray, where: Where, branch: str, near: FloatArray) -> Branch:
    """Return the joints as a branch of the kinematics, with constraints; messages use `where` for positions."""
    kinematics = make_kinematics(robot)
    if branch not in kinematics.branches:
        raise unknown("branch", branch, kinematics.branches)
    solved = kinematics.along(poses, branch, near)
    passes_until = partial(_passes_until, kinematics, branch, poses, near)
    _check(solved.mechanism, where, passes_until)
    _check(kinematics.singularities(solved.joints), where, passes_until)
    joints = solved.joints
    for axis, joint in enumerate(robot.joints):
        if joint.unit is Unit.DEG:
            joints[:, axis] = np.unwrap(joints[:, axis], period=360.0) + _turns_deg(joints[0, axis], near[axis])
    return solved


def present_branch(robot: Robot, joints: FloatArray) -> str:
    """Return the present branch of an arm: its joints at the arm's pose equal the given ones, except for turns."""
    kinematics = make_kinematics(robot)

    def distance(branch: Branch) -> float:
        apart = np.abs(nearest_turns(robot, branch.joints[0], joints) - joints)
        return float(np.nan_to_num(apart, nan=np.inf).max())

    return min(kinematics.inverse(kinematics.forward(joints[np.newaxis]), joints), key=distance).name


_LOOKED_AT: Final = 257
"""Number of poses of a path where its branches are determined."""


def branches_on(robot: Robot, path: ToolPath, branch: str, start: FloatArray) -> tuple[tuple[str, ...], FloatArray]:
    """Return the branches of an arm along a path that starts at joints on a branch, and the joints at its end.

    The branch may change at a point where two meet, such as at a straight wrist, if the arm follows the nearest one.
    Limits are not checked.
    """
    kinematics = make_kinematics(robot)
    solved = kinematics.along(path.poses(np.linspace(0.0, path.length_mm, _LOOKED_AT)), branch, start)
    return (branch, *(name for _, name in solved.changes)), np.asarray(solved.joints[-1])


def nearest_turns(robot: Robot, joints: FloatArray, near: FloatArray) -> FloatArray:
    """Return joints of shape (joints,) with each rotary joint in the turn nearest to `near`, ignoring limits."""
    rotary = [joint.unit is Unit.DEG for joint in robot.joints]
    return np.where(rotary, joints + 360.0 * np.round((near - joints) / 360.0), joints)


def _turns_deg(first_deg: float, near_deg: float) -> float:
    """Return the degrees from `first_deg` to `near_deg` if they are whole turns, else 0."""
    turns_deg = 360.0 * round((near_deg - first_deg) / 360.0)
    return turns_deg if abs(first_deg + turns_deg - near_deg) < LIMIT_TOLERANCE else 0.0


def _check(constraints: tuple[Constraint, ...], where: Where, passes_until: Callable[[int], str]) -> None:
    """Raise OutOfReachError for the first violated constraint of a path, with the last pose that passes."""
    for constraint in constraints:
        if not constraint.kept.all():
            i = int(np.argmin(constraint.kept))
            broken = constraint.complaint(i, of_path=True)
            raise OutOfReachError(f"{where(i)} the tool's path breaks off: {broken}{passes_until(i)}")


def _passes_until(kinematics: Kinematics, branch: str, poses: FloatArray, near: FloatArray, end: int) -> str:
    """Return the last pose before an index that passes, in 0.1 mm and degrees, as text; empty if none passes."""
    task = kinematics.task
    tenths = task.of_figures(np.round(task.figures(poses[:end]), 1) + 0.0)
    solved = kinematics.along(tenths, branch, near) if end else kinematics.solve(tenths, branch, near)
    constraints = (*solved.mechanism, *kinematics.singularities(solved.joints))
    passing = np.flatnonzero(np.logical_and.reduce([constraint.kept for constraint in constraints]))
    return f"; it passes up to {task.words(tenths[passing[-1]])}" if len(passing) else ""


_ALONG: Final = 20
"""Number of points where a straight motion in joint space is compared with the tool's path."""
_ON_PATH: Final = 1e-3
"""Distance in mm or degrees from the tool's path: less than a step of any axis, more than rounding at a singularity."""


def is_straight_in_joints(robot: Robot, path: ToolPath, start: FloatArray, goal: FloatArray) -> bool:
    """Return whether the tool stays on its path from one joint position to another, each of shape (joints,)."""
    parts = np.linspace(0.0, 1.0, _ALONG + 1)
    kinematics = make_kinematics(robot)
    poses = kinematics.forward(start + parts[:, np.newaxis] * (goal - start))
    wanted = path.poses(parts * path.length_mm)
    off_mm = np.abs(poses[:, :3] - wanted[:, :3]).max()
    turned_deg = 0.0 if kinematics.attitude_follows else np.abs(kinematics.task.off_deg(poses, wanted)).max()
    return bool(max(off_mm, turned_deg) < _ON_PATH)


_STEP_MS: Final = 10
"""Spacing in time of the stored joints: no joint makes half a turn in it."""

_LENGTH_TOLERANCE: Final = 1e-9
"""Largest difference between a law's distance and a path's length, as a fraction of the length."""


@dataclass(frozen=True, slots=True, eq=False)
class ToolMove(JointLaw):
    """The joints of a tool that moves along a path, on one branch of the inverse kinematics.

    Positions and velocities are exact at every instant, not interpolated between solutions.

    Attributes:
        kinematics: kinematics of the robot.
        branch: branch of the inverse kinematics.
        path: path of the tool.
        law: length travelled, from 0 to the path's length.
        guide_s: shape (m,), times for which the joints' turns are stored.
        guide_joints: shape (m, joints), the joints at these times, without jumps of a whole turn.
        rotary: columns of the rotary joints.
        changes: times from which on the arm is on another branch, and its name; only where two branches meet.
        keeps_limits: whether each joint is within its limits at each millisecond.
    """

    kinematics: Kinematics
    branch: str
    path: ToolPath
    law: Law
    guide_s: FloatArray
    guide_joints: FloatArray
    rotary: tuple[int, ...]
    changes: tuple[tuple[float, str], ...]
    keeps_limits: bool

    @classmethod
    def along(cls, robot: Robot, path: ToolPath, law: Law, branch: str, start: FloatArray, from_s: float = 0.0) -> Self:
        """Return the law of `tool_move`, which names the errors."""
        if not isclose(law.distance, path.length_mm, rel_tol=_LENGTH_TOLERANCE):
            raise InputError(f"the law covers {law.distance:.9g} mm, the tool's path is {path.length_mm:.9g} mm long")
        kinematics = make_kinematics(robot)
        if kinematics.attitude_follows:
            path = FreeAttitude(path)
        rotary = tuple(axis for axis, joint in enumerate(robot.joints) if joint.unit is Unit.DEG)
        guide_ms, guide = [np.zeros(1, np.int64)], [np.array([start])]
        changes: list[tuple[float, str]] = []
        lower, upper = (np.array([getattr(joint, end) for joint in robot.joints]) for end in ("lower", "upper"))
        keeps_limits = True
        for times_ms in windows_ms(round(1000 * law.duration_s)):
            t_s = times_ms / 1000
            near = start if kinematics.keeps_branch else guide[-1][-1]
            solved = followed(robot, path.poses(law.position(t_s)), at_time(from_s + t_s), branch, near)
            joints = solved.joints
            changes += [(float(t_s[i]), name) for i, name in solved.changes]
            if times_ms[0] == 0:
                check_start(robot, branch, start, joints[0], at_time(np.array([from_s]))(0))
                guide[0] = joints[:1]
            else:  # the turns in which the window before has ended
                joints[:, rotary] += 360.0 * np.round((guide[-1][-1] - joints[0])[list(rotary)] / 360.0)
            _check_steps(robot, kinematics, joints, from_s + t_s)
            keeps_limits = keeps_limits and bool(((joints >= lower) & (joints <= upper)).all())
            stored = np.flatnonzero((times_ms[1:] % _STEP_MS == 0) | (times_ms[1:] == times_ms[-1])) + 1
            guide_ms.append(times_ms[stored])
            guide.append(joints[stored])
        guide_s = np.concatenate(guide_ms) / 1000
        guide_joints = np.concatenate(guide)
        return cls(
            kinematics,
            branch,
            path,
            law,
            guide_s,
            guide_joints,
            rotary,
            tuple(changes),
            keeps_limits,
        )

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions, of shape (n, joints)."""
        guides = self._guides(t_s)
        return self._in_turns(self._solved(self.law.position(t_s), guides), guides)

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities, of shape (n, joints), by the inverse Jacobian."""
        s_mm = self.law.position(t_s)
        return self._rates(t_s, s_mm, self._solved(s_mm, self._guides(t_s)))

    def states(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities, from one inverse of the poses."""
        s_mm, guides = self.law.position(t_s), self._guides(t_s)
        joints = self._solved(s_mm, guides)
        velocities = self._rates(t_s, s_mm, joints)
        return self._in_turns(joints, guides), velocities

    def _solved(self, s_mm: FloatArray, guides: FloatArray) -> FloatArray:
        """Return joints, of shape (n, joints), at lengths of the path, near guides except for turns."""
        return self.kinematics.at(self.path.poses(s_mm), self.branch, self.guide_joints[0], guides)

    def _in_turns(self, joints: FloatArray, guides: FloatArray) -> FloatArray:
        """Shift each rotary joint, in place, to the turn of its guide; return the joints."""
        for axis in self.rotary:
            joints[:, axis] += 360.0 * np.round((guides[:, axis] - joints[:, axis]) / 360.0)
        return joints

    def _rates(self, t_s: FloatArray, s_mm: FloatArray, joints: FloatArray) -> FloatArray:
        """Return joint velocities with which the tool follows the path."""
        tool = self.law.velocity(t_s)[:, np.newaxis] * self.path.derivatives(s_mm)
        return self.kinematics.joint_velocities(joints, tool)

    def _guides(self, t_s: FloatArray) -> FloatArray:
        """Return approximate joints, shape (n, joints), at times of shape (n,)."""
        return np.column_stack([np.interp(t_s, self.guide_s, column) for column in self.guide_joints.T])


def tool_move(robot: Robot, path: ToolPath, law: Law, branch: str, start: FloatArray, from_s: float = 0.0) -> Motion:
    """Return the motion of the tool along a path by a law of the length travelled.

    It begins at the joints `start`, of shape (joints,); joints not needed for the pose stay. The attitudes of the path
    do not count for a tool that cannot turn by itself.

    Raises:
        InputError: the law's distance is not the path's length; the path leaves the mechanism's reach or comes near a
            singularity; or it does not begin at `start` on this branch. The messages give times plus `from_s`.
    """
    move = ToolMove.along(robot, path, law, branch, start, from_s)
    return Motion(robot.joint_names, law.duration_s, move, law.breakpoints_s)


_JUMP_DEG: Final = 0.1
"""Step of a rotary joint in a millisecond above which a path is checked: 100 degrees per second."""


def _check_steps(robot: Robot, kinematics: Kinematics, joints: FloatArray, t_s: FloatArray) -> None:
    """Raise OutOfReachError if, near a singularity, a joint's step in a millisecond exceeds its speed limit.

    A mechanism that keeps its branch cannot jump. Away from singularities, the planner refuses a motion that is too
    fast.
    """
    if kinematics.keeps_branch or len(joints) < 2:
        return
    steps, most = np.abs(np.diff(joints, axis=0)), np.array([joint.speed_max for joint in robot.joints])
    fast = (steps > most * np.diff(t_s)[:, np.newaxis]) & (steps > _JUMP_DEG)
    for row in np.flatnonzero(fast.any(axis=1)):
        what = kinematics.near_what(joints[row])
        if what:
            axis = int(np.argmax(steps[row] / most))
            pose = kinematics.task.words(np.round(kinematics.forward(joints[row : row + 1])[0], 3))
            unit = robot.joints[axis].unit
            raise OutOfReachError(
                f"at t = {t_s[row + 1]:.3f} s the tool's path breaks off: {robot.joints[axis].name} would move by"
                f" {steps[row, axis]:.3g} {unit} in a millisecond, {what}, at {pose}"
            )


def check_start(robot: Robot, branch: str, start: FloatArray, begins: FloatArray, where: str) -> None:
    """Raise InputError if the joints would jump at the start, for example because they are on another branch."""
    for i, joint in enumerate(robot.joints):
        half_step = 0.5 / joint.transmission.steps_per_unit
        if abs(begins[i] - start[i]) > half_step:
            raise InputError(
                f"{joint.name}: {where} the tool's path on the branch {branch!r} begins at"
                f" {begins[i]:.4f} {joint.unit}, the joint is at {start[i]:.4f} {joint.unit}"
            )
