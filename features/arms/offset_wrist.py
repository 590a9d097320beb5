"""Arms of six rotary joints whose wrist's axes miss one point: the eight branches of a neighbour lead to theirs.

The neighbour is the same arm with axes 4, 5 and 6 shifted until they meet, and axis 3 turned parallel to axis 2. It has
a closed form N. The arm's own tool is at A(q) = N(q) C(q), where C hardly changes with q, so that

    X_0 = T        q_i = N^-1(X_i) on one branch        X_i+1 = X_i A(q_i)^-1 T

comes nearer to the pose T by about the miss as a part of the arm's size with each round. Newton's method does the rest.
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
"""Part of the arm's size by which the wrist's axes may miss one point: the rounds still come nearer."""
_TILT_MAX: Final = 0.05
"""Sine of the angle by which axis 3 may be turned from axis 2."""
_CROSSED_LEAST: Final = 0.1
"""Sine of the angle that neighbouring axes of the wrist have at least: otherwise there is no point where they meet."""
_ROUNDS: Final = 4
_SLACK: Final = 10.0
"""Part of its size by which the neighbour may be out of reach, in misses: the arm itself may reach what it does not."""
_THERE: Final = 1e-3
"""Distance in mm and degrees from a pose up to which joints stand there."""
_SAME_DEG: Final = 1e-4
"""Distance of all joints below which two solutions are one."""


@lru_cache(maxsize=16)
def neighbour_of(axes: ArmAxes, size_mm: float) -> SphericalWrist | None:
    """Return the closed form of the arm whose wrist's axes meet in a point; None for an arm without one."""
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
    """The inverse of an arm whose neighbour has a closed form.

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
        """Return, for each branch by its name, the neighbour's own solutions, and the joints of the arm.

        Joints that have a pose already are what their branch has, also near a singularity, where a start may mislead.
        Joints that are not found, or that stand for another one of the branches, are NaN.

        Args:
            names: names of branches.
            poses: shape (n, 7).
            local: the same in the base's frame, as if the joints that are held were at 0.
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
        for each, stands in zip(found, _told_apart(self.form, names, found, free), strict=True):
            each.joints[~stands] = np.nan
        return list(zip(names, solved, found, strict=True))

    def _stand_at(self, poses: FloatArray, standing: FloatArray) -> BoolArray:
        """Return, of shape (n,), whether the present joints have the pose already."""
        present = self.numeric.screws.forward(standing)
        off_mm, off_deg = np.abs(present[:, :3] - poses[:, :3]).max(axis=1), angle_deg(present[:, 3:], poses[:, 3:])
        return np.asarray((off_mm < _THERE) & (off_deg < _THERE))

    def _starts(self, own: Solved, local: FloatArray, name: str, near: FloatArray) -> FloatArray:
        """Return joints near the arm's, of shape (n, 6), in degrees, from the neighbour's; NaN where it has none."""
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
        """Return the joints to which starts of the free ones, of shape (n, 6), lead; NaN where they lead nowhere."""
        joints, some = standing.copy(), np.isfinite(starts[:, 0])
        joints[:, self.numeric.free] = starts
        off_mm, off_deg = np.full((2, len(poses)), np.nan)
        joints[some], off_mm[some], off_deg[some] = self.numeric.near(poses[some], joints[some])
        found = Found(joints, off_mm, off_deg)
        joints[~found.solved] = np.nan
        return found


def _told_apart(form: SphericalWrist, names: Sequence[str], found: Sequence[Found], free: list[int]) -> BoolArray:
    """Return, of shape (branches, n), which solutions stand for their branch.

    Where branches meet several starts lead to one solution. It counts once: for the branch whose name its own shape
    has, or else for the first.
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
