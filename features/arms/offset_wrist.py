"""Arms of six rotary joints whose wrist axes miss one point: solve them from a neighbour's eight branches.

The neighbour is the same arm with axes 4, 5 and 6 shifted until they meet, and axis 3 turned parallel to axis 2. It has
a closed form N. The arm's own tool is at A(q) = N(q) C(q); C hardly changes with q. So the iteration

    X_0 = T        q_i = N^-1(X_i) on one branch        X_i+1 = X_i A(q_i)^-1 T

converges to the pose T. Each round reduces the error by about the ratio of the miss to the arm's size. Newton's method
ends it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import Final

import numpy as np

from steptwin.features.arms.spherical_wrist import (
    Solved,
    SphericalWrist,
    closed_form,
    nearest_points,
    why_not,
    wrist_miss_mm,
)
from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.robots.kinematics.serial.chain_geometry import ArmAxes
from steptwin.host.robots.kinematics.serial.levenberg import Found, NumericInverse
from steptwin.host.robots.kinematics.serial.screws import Screws
from steptwin.host.robots.poses.rotations import angle_deg, product, reversed_rotation, turned, wrapped_deg

MISS_PART_MAX: Final = 0.15
"""Largest miss of the wrist's axes as a fraction of the arm's size; the iteration still converges."""
_TILT_MAX: Final = 0.05
"""Sine of the largest angle between axes 2 and 3."""
_CROSSED_LEAST: Final = 0.1
"""Sine of the least angle between neighbouring axes of the wrist; below it they meet in no point."""
_ROUNDS: Final = 4
_SLACK: Final = 10.0
"""Distance out of the neighbour's reach that is tried, in misses; the arm itself may reach further."""
_THERE: Final = 1e-3
"""Distance in mm and degrees within which joints count as being at a pose."""
_SAME_DEG: Final = 1e-4
"""Distance of all joints below which two solutions are the same."""


@lru_cache(maxsize=16)
def neighbour_of(axes: ArmAxes, size_mm: float) -> SphericalWrist | None:
    """Return the closed form of the arm with wrist axes moved to one point; None for an arm without one."""
    if len(axes.slides) != 6 or any(axes.slides):
        return None
    k = axes.directions
    crossed = np.linalg.norm(np.cross(k[[0, 3, 4]], k[[1, 4, 5]]), axis=1).min()
    if crossed < _CROSSED_LEAST or np.linalg.norm(np.cross(k[1], k[2])) > _TILT_MAX:
        return None
    miss_part = wrist_miss_mm(axes) / size_mm
    if miss_part > MISS_PART_MAX:
        return None
    wrist_mm = (nearest_points(axes, 3, 4)[1] + nearest_points(axes, 5, 4)[1]) / 2.0
    directions, points_mm = k.copy(), axes.points_mm.copy()
    directions[2] = k[1] if k[1] @ k[2] > 0.0 else -k[1]
    points_mm[3:] = wrist_mm
    near = ArmAxes(directions, points_mm, axes.slides, axes.home_mm, axes.home_rotation)
    return None if why_not(near) else closed_form(near, _SLACK * miss_part)


@dataclass(frozen=True, slots=True, eq=False)
class OffsetWrist:
    """Inverse of an arm with a neighbour in closed form.

    Attributes:
        form: the neighbour.
        numeric: the numeric inverse of the arm itself.
        own: the arm with its base at the station's origin.
    """

    form: SphericalWrist
    numeric: NumericInverse
    own: Screws

    def find(
        self, names: Sequence[str], poses: FloatArray, local: FloatArray, standing: FloatArray
    ) -> list[tuple[str, Solved, Found]]:
        """Return, for each branch by name, the neighbour's solutions and the joints of the arm.

        If the present joints have the pose already, they are the solution of their branch, even near a singularity,
        where an iteration may go astray. Joints that are not found, or that belong to another of the branches, are NaN.

        Args:
            names: names of branches.
            poses: shape (n, 7).
            local: the poses in the base's frame with all held joints at 0.
            standing: shape (n, joints), the present joints.
        """
        free = list(self.numeric.free)
        present = np.where(self._stand_at(poses, standing), self.form.names_of(np.deg2rad(standing[:, free])), "")
        solved = [self.form.solve(local, self.form.signs[name], np.deg2rad(standing[:, free])) for name in names]
        found = []
        for name, neighbours in zip(names, solved, strict=True):
            starts = self._starts(neighbours, local, name, standing[:, free])
            starts[present == name] = standing[present == name][:, free]
            found.append(self._refined(poses, standing, starts))
        for each, stands in zip(found, _of_own_branch(self.form, names, found, free), strict=True):
            each.joints[~stands] = np.nan
        return list(zip(names, solved, found, strict=True))

    def _stand_at(self, poses: FloatArray, standing: FloatArray) -> BoolArray:
        """Return, of shape (n,), whether the present joints already have the pose."""
        present = self.numeric.screws.forward(standing)
        off_mm, off_deg = np.abs(present[:, :3] - poses[:, :3]).max(axis=1), angle_deg(present[:, 3:], poses[:, 3:])
        return np.asarray((off_mm < _THERE) & (off_deg < _THERE))

    def _starts(self, own: Solved, local: FloatArray, name: str, near: FloatArray) -> FloatArray:
        """Return starts near the arm's joints, of shape (n, 6), in degrees, from the neighbour's; NaN without any."""
        joints, wanted, solved = np.rad2deg(own.joints), local, own
        every = np.zeros((len(local), len(self.numeric.slides)))
        for _ in range(_ROUNDS):
            every[:, self.numeric.free] = np.rad2deg(solved.joints)
            tool = self.own.forward(every)
            back = reversed_rotation(tool[:, 3:])
            to_go, to_turn = turned(local[:, :3] - tool[:, :3], back), product(back, local[:, 3:])
            wanted = np.column_stack([wanted[:, :3] + turned(to_go, wanted[:, 3:]), product(wanted[:, 3:], to_turn)])
            solved = self.form.solve(wanted, self.form.signs[name], np.deg2rad(near))
            found = np.isfinite(solved.joints[:, 0])
            joints[found] = np.rad2deg(solved.joints[found])
        return np.asarray(joints)

    def _refined(self, poses: FloatArray, standing: FloatArray, starts: FloatArray) -> Found:
        """Return the solutions from starts of the free joints, of shape (n, 6); NaN where the iteration fails."""
        joints, some = standing.copy(), np.isfinite(starts[:, 0])
        joints[:, self.numeric.free] = starts
        off_mm, off_deg = np.full((2, len(poses)), np.nan)
        joints[some], off_mm[some], off_deg[some] = self.numeric.near(poses[some], joints[some])
        found = Found(joints, off_mm, off_deg)
        joints[~found.solved] = np.nan
        return found


def _of_own_branch(form: SphericalWrist, names: Sequence[str], found: Sequence[Found], free: list[int]) -> BoolArray:
    """Return, of shape (branches, n), which solutions belong to their branch.

    Where branches meet, several starts give one solution. It counts once, for the branch that its own shape names, or
    else for the first.
    """
    joints = np.stack([each.joints[:, free] for each in found])
    own = np.array([form.names_of(np.deg2rad(each)) for each in joints]) == np.array(names)[:, np.newaxis]
    stands: BoolArray = np.asarray(np.isfinite(joints).all(axis=2))
    for first, second in combinations(range(len(names)), 2):
        apart = np.abs(wrapped_deg(joints[first] - joints[second])).max(axis=1)
        same = stands[first] & stands[second] & (apart < _SAME_DEG)
        first_loses = own[second] & ~own[first]
        stands[first] &= ~(same & first_loses)
        stands[second] &= ~(same & ~first_loses)
    return stands
