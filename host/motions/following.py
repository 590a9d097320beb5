"""Joints that follow the tool: inverse kinematics along a path, checked and without jumps."""

import numpy as np

from host.errors import InputError
from host.kinematics import make_kinematics
from host.kinematics.base import Constraint
from host.robot import Robot, Unit
from host.trajectory import FloatArray


def follow(robot: Robot, poses: FloatArray, t_s: FloatArray, branch: str, near: FloatArray) -> FloatArray:
    """Joints, shape (n, joints), for tool poses of shape (n, 4) along a path, at times of shape (n,).

    They begin at the turns nearest to `near`, of shape (joints,), and go on without jumps of a whole turn. Joints'
    limits are not asked: the planner checks them.

    Raises:
        InputError: the path leaves the mechanism's reach or comes near a singularity; the message says when.
    """
    kinematics = make_kinematics(robot)
    solved = kinematics.solve(poses, branch, near)
    _check(solved.mechanism, t_s)
    _check(kinematics.singularities(solved.joints), t_s)
    joints = solved.joints
    for axis, joint in enumerate(robot.joints):
        if joint.unit is Unit.DEG:
            joints[:, axis] = np.unwrap(joints[:, axis], period=360.0)
    return joints


def _check(constraints: tuple[Constraint, ...], t_s: FloatArray) -> None:
    for constraint in constraints:
        if not constraint.kept.all():
            i = int(np.argmin(constraint.kept))
            raise InputError(f"at t = {t_s[i]:.3f} s the tool's path breaks off: {constraint.complaint(i)}")
