"""Solve the inverse kinematics along a tool path, checked and without jumps of a joint; find the arm's branch."""

from collections.abc import Callable
from functools import partial

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import unknown
from steptwin.host.planning.paths import OutOfReachError, Pose
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics import Branch, Kinematics, make_kinematics, pose_words
from steptwin.host.robots.kinematics.base import LIMIT_TOLERANCE, Constraint
from steptwin.host.robots.robot import Robot


def follow(robot: Robot, poses: FloatArray, t_s: FloatArray, branch: str, near: FloatArray) -> FloatArray:
    """Return joints of shape (n, joints) for tool poses of shape (n, 4) along a path, at times of shape (n,).

    They begin at the turns nearest to `near`, of shape (joints,), and continue without jumps of a whole turn. The
    planner checks the joints' limits, this function does not. It raises InputError, with the time, if the path leaves
    the mechanism's reach or comes near a singularity.
    """
    kinematics = make_kinematics(robot)
    if branch not in kinematics.branches:
        raise unknown("branch", branch, kinematics.branches)
    solved = kinematics.solve(poses, branch, near)
    passing_before = partial(_passing_before, kinematics, branch, poses, near)
    _check(solved.mechanism, t_s, passing_before)
    _check(kinematics.singularities(solved.joints), t_s, passing_before)
    joints = solved.joints
    for axis, joint in enumerate(robot.joints):
        if joint.unit is Unit.DEG:
            joints[:, axis] = np.unwrap(joints[:, axis], period=360.0) + _turns_deg(joints[0, axis], near[axis])
    return joints


def present_branch(robot: Robot, joints: FloatArray) -> str:
    """Return the branch on which an arm is: its joints at the arm's pose are those given, but for whole turns."""
    kinematics = make_kinematics(robot)

    def distance(branch: Branch) -> float:
        apart = np.abs(nearest_turns(robot, branch.joints[0], joints) - joints)
        return float(np.nan_to_num(apart, nan=np.inf).max())

    return min(kinematics.inverse(kinematics.forward(joints[np.newaxis]), joints), key=distance).name


def nearest_turns(robot: Robot, joints: FloatArray, near: FloatArray) -> FloatArray:
    """Return joints of shape (joints,) with each rotary one in the turn nearest to `near`; limits do not matter."""
    rotary = [joint.unit is Unit.DEG for joint in robot.joints]
    return np.where(rotary, joints + 360.0 * np.round((near - joints) / 360.0), joints)


def _turns_deg(first_deg: float, near_deg: float) -> float:
    """Return the degrees from `first_deg` to `near_deg` if they are whole turns, else 0."""
    turns_deg = 360.0 * round((near_deg - first_deg) / 360.0)
    return turns_deg if abs(first_deg + turns_deg - near_deg) < LIMIT_TOLERANCE else 0.0


def _check(constraints: tuple[Constraint, ...], t_s: FloatArray, passing_before: Callable[[int], Pose | None]) -> None:
    """Raise OutOfReachError for the first place where a path breaks a constraint, with the last that passes."""
    for constraint in constraints:
        if not constraint.kept.all():
            i = int(np.argmin(constraint.kept))
            passing = passing_before(i)
            until = "" if passing is None else f"; it passes up to {pose_words(passing)}"
            raise OutOfReachError(
                f"at t = {t_s[i]:.3f} s the tool's path breaks off: {constraint.complaint(i, of_path=True)}{until}"
            )


def _passing_before(kinematics: Kinematics, branch: str, poses: FloatArray, near: FloatArray, end: int) -> Pose | None:
    """Return the last pose of a path before an index that passes in tenths of a mm and degree; None if none does."""
    tenths = np.round(poses[:end], 1) + 0.0
    solved = kinematics.solve(tenths, branch, near)
    constraints = (*solved.mechanism, *kinematics.singularities(solved.joints))
    passing = np.flatnonzero(np.logical_and.reduce([constraint.kept for constraint in constraints]))
    return tuple(tenths[passing[-1]].tolist()) if len(passing) else None
