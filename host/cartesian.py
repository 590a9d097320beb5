"""Trajectories of the tool: a path in space, a time law along it, joints by inverse kinematics at every instant."""

from dataclasses import dataclass

import numpy as np

from host.errors import InputError
from host.kinematics import Kinematics
from host.laws import Trapezoid
from host.trajectory import FloatArray


@dataclass(frozen=True, slots=True)
class StraightLine:
    """The tool moves on a straight line with constant attitude; fulfils Trajectory.

    Positions and velocities are exact at every instant: nothing is sampled or interpolated.

    Attributes:
        joint_names: the robot's joints.
        kinematics: the mechanism.
        branch: which solution of its inverse kinematics to keep to.
        near: joint positions; those that the tool's pose leaves free stay there.
        start_pose: x, y, z in mm and attitude in degrees at t = 0.
        direction: unit vector of the tool's motion in the world frame.
        law: the distance covered at each instant, in mm.
    """

    joint_names: tuple[str, ...]
    kinematics: Kinematics
    branch: str
    near: tuple[float, ...]
    start_pose: tuple[float, float, float, float]
    direction: tuple[float, float, float]
    law: Trapezoid

    @property
    def duration_s(self) -> float:
        """The law's duration."""
        return self.law.duration_s

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """The law's breakpoints."""
        return self.law.breakpoints_s

    def poses(self, t_s: FloatArray) -> FloatArray:
        """Planned tool poses, shape (n, 4)."""
        path = np.array([*self.direction, 0.0])
        poses: FloatArray = np.array(self.start_pose) + self.law.position(t_s)[:, np.newaxis] * path
        return poses

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Joint positions, shape (n, joints).

        Raises:
            InputError: a pose on the line is out of reach; joint limits are the planner's to check.
        """
        solutions = self.kinematics.inverse(self.poses(t_s), np.array(self.near))
        branch = {solution.name: solution for solution in solutions}[self.branch]
        solved = np.isfinite(branch.joints).all(axis=1)
        if not solved.all():
            i = int(np.argmin(solved))
            raise InputError(f"at t = {t_s[i]:.3f} s the tool is {branch.reason(i)}")
        return branch.joints

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Joint velocities, shape (n, joints), through the Jacobian."""
        tool = self.law.velocity(t_s)[:, np.newaxis] * np.array([*self.direction, 0.0])
        return self.kinematics.joint_velocities(self.positions(t_s), tool)
