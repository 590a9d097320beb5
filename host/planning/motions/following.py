"""Solve the inverse kinematics along a tool path, checked and without jumps of a joint; find the arm's branch."""

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import unknown
from steptwin.host.planning.out_of_reach import OutOfReachError
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
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
    _check(solved.mechanism, t_s)
    _check(kinematics.singularities(solved.joints), t_s)
    joints = solved.joints
    for axis, joint in enumerate(robot.joints):
        if joint.unit is Unit.DEG:
            joints[:, axis] = np.unwrap(joints[:, axis], period=360.0) + _turns_deg(joints[0, axis], near[axis])
    return joints


def present_branch(kinematics: Kinematics, joints: FloatArray) -> str:
    """Return the branch on which an arm is: the one whose joints at its pose are nearest to its own, of shape (n,)."""
    pose = kinematics.forward(joints[np.newaxis])
    return min(
        kinematics.inverse(pose, joints),
        key=lambda branch: float(np.nan_to_num(np.abs(branch.joints[0] - joints), nan=np.inf).max()),
    ).name


def _turns_deg(first_deg: float, near_deg: float) -> float:
    """Return the degrees from `first_deg` to `near_deg` if they are whole turns, else 0."""
    turns_deg = 360.0 * round((near_deg - first_deg) / 360.0)
    return turns_deg if abs(first_deg + turns_deg - near_deg) < LIMIT_TOLERANCE else 0.0


def _check(constraints: tuple[Constraint, ...], t_s: FloatArray) -> None:
    for constraint in constraints:
        if not constraint.kept.all():
            i = int(np.argmin(constraint.kept))
            raise OutOfReachError(
                f"at t = {t_s[i]:.3f} s the tool's path breaks off: {constraint.complaint(i, of_path=True)}"
            )
