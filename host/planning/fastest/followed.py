"""A path of the tool with the joints that follow it, by its length."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.motions.tool_move import check_start, followed
from steptwin.host.planning.paths import FreeAttitude, ToolPath
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
from steptwin.host.robots.robot import Robot

_APART_MM: Final = 0.25
"""Distance between two places of a path at which it is looked at, and the joints' turns are stored."""
_GUIDES_MIN, _GUIDES_MAX = 64, 100_000


def _after(at_mm: float) -> str:
    return f"after {at_mm:.2f} mm"


@dataclass(frozen=True, slots=True, eq=False)
class FollowedPath:
    """A path of the tool on one branch of the inverse kinematics; made by `along`.

    Attributes:
        path: path of the tool.
        kinematics: kinematics of the robot.
        branch: branch of the inverse kinematics at the start.
        guide_mm: shape (m,), lengths for which the joints' turns are stored.
        guides: shape (m, joints), the joints there, without jumps of a whole turn.
        rotary: columns of the rotary joints.
        changes: lengths from which on the arm is on another branch, and its name; only where two branches meet.
    """

    path: ToolPath
    kinematics: Kinematics
    branch: str
    guide_mm: FloatArray
    guides: FloatArray
    rotary: tuple[int, ...]
    changes: tuple[tuple[float, str], ...] = ()

    @classmethod
    def along(
        cls, robot: Robot, path: ToolPath, branch: str, start: FloatArray, where: Callable[[float], str] = _after
    ) -> Self:
        """Return a path that begins at the joints `start`, of shape (joints,), on a branch.

        Raises InputError if it leaves the mechanism's reach, comes near a singularity or does not begin at `start`; the
        message says `where`, usually after how many mm. PathLimits of the joints are not checked.
        """
        kinematics = make_kinematics(robot)
        if kinematics.attitude_follows:
            path = FreeAttitude(path)
        count = int(np.clip(np.ceil(path.length_mm / _APART_MM), _GUIDES_MIN, _GUIDES_MAX)) + 1
        guide_mm = np.linspace(0.0, path.length_mm, count)
        solved = followed(robot, path.poses(guide_mm), lambda i: where(float(guide_mm[i])), branch, start)
        check_start(robot, branch, start, solved.joints[0], "at its start")
        rotary = tuple(axis for axis, joint in enumerate(robot.joints) if joint.unit is Unit.DEG)
        changes = tuple((float(guide_mm[i]), name) for i, name in solved.changes)
        return cls(path, kinematics, branch, guide_mm, solved.joints, rotary, changes)

    @property
    def end(self) -> FloatArray:
        """Shape (joints,), the joints at the path's end."""
        return np.asarray(self.guides[-1])

    def branch_at(self, s_mm: float) -> str:
        """Return the branch on which the arm is at a length."""
        return next((name for at_mm, name in reversed(self.changes) if at_mm <= s_mm), self.branch)

    def joints(self, s_mm: FloatArray) -> FloatArray:
        """Return joints of shape (n, joints) at lengths of shape (n,)."""
        guides = np.column_stack([np.interp(s_mm, self.guide_mm, column) for column in self.guides.T])
        solved = self.kinematics.at(self.path.poses(s_mm), self.branch, self.guides[0], guides)
        for axis in self.rotary:  # choose the turn that the guide is in
            solved[:, axis] += 360.0 * np.round((guides[:, axis] - solved[:, axis]) / 360.0)
        return solved

    def derivatives(self, s_mm: FloatArray) -> FloatArray:
        """Return the joints' derivatives by the length, of shape (n, joints), by the inverse Jacobian."""
        return self.kinematics.joint_velocities(self.joints(s_mm), self.path.derivatives(s_mm))
