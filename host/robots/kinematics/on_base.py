"""Conversion of poses between the frames of the station and of the base, for mechanisms with a SCARA's task.

The formulas of a mechanism are in the frame of its base. Users give and get poses in the frame of the station:


    S_T T = S_0T 0_T T        S_0T = Trans(x, y, z) Rz(phi)
"""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.base import Branch, KeepsBranch
from steptwin.host.robots.kinematics.dh import DhTable
from steptwin.host.robots.kinematics.links import ArmPart
from steptwin.host.robots.poses import SCARA, Task
from steptwin.host.robots.poses.base_frame import STATION, BaseFrame
from steptwin.host.robots.poses.rotations import wrapped_deg


@dataclass(frozen=True, slots=True, kw_only=True)
class OnBase(KeepsBranch):
    """A mechanism's kinematics in the frame of the station, from its formulas in the frame of the base.

    Attributes:
        dh: the mechanism as a DH table, with the base's position in the station.
        base: position of the base in the station.
        slides: pairs of a joint's column and the coordinate of the base's frame along which it shifts the whole arm: 0
            for x or 2 for z.
    """

    dh: DhTable
    base: BaseFrame = STATION
    slides: tuple[tuple[int, int], ...] = ()

    def on(self, base: BaseFrame) -> Self:
        """Return the mechanism with its base at a place in the station."""
        return replace(self, base=base, dh=replace(self.dh, base=base))

    @property
    def task(self) -> Task:
        """A SCARA's: the tool is upright."""
        return SCARA

    @property
    @abstractmethod
    def branches(self) -> tuple[str, ...]:
        """Names of the branches of the inverse kinematics, the usual one first."""

    @abstractmethod
    def forward_from_base(self, joints: FloatArray) -> FloatArray:
        """Return poses of shape (n, 4) in the base's frame for joints of shape (n, joints)."""

    @abstractmethod
    def solve_from_base(self, poses: FloatArray, branch: str, near: FloatArray | None) -> Branch:
        """Return one branch for poses of shape (n, 4) in the base's frame; otherwise like `solve`."""

    @abstractmethod
    def velocities_from_base(self, joints: FloatArray, tool_velocities: FloatArray) -> FloatArray:
        """Return joint velocities for pose derivatives in the base's frame; otherwise like `joint_velocities`."""

    @abstractmethod
    def links_from_base(self, joints: FloatArray) -> tuple[ArmPart, ...]:
        """Return the parts to draw, in the base's frame, for joints of shape (n, joints)."""

    def forward(self, joints: FloatArray) -> FloatArray:
        """Return poses of shape (n, 4) for joints of shape (n, joints)."""
        return self.in_station(self.forward_from_base(joints))

    def inverse(self, poses: FloatArray, near: FloatArray | None = None) -> tuple[Branch, ...]:
        """Return every branch for poses of shape (n, 4)."""
        return tuple(self.solve(poses, branch, near) for branch in self.branches)

    def solve(self, poses: FloatArray, branch: str, near: FloatArray | None = None) -> Branch:
        """Return one branch, by its name, for poses of shape (n, 4)."""
        if self.base != STATION:
            turned = self._turned_back(poses - np.array([self.base.x_mm, self.base.y_mm, self.base.z_mm, 0.0]))
            turned[:, 3] -= self.base.phi_deg
            poses = turned
        return self.solve_from_base(poses, branch, near)

    def joint_velocities(self, joints: FloatArray, tool_velocities: FloatArray) -> FloatArray:
        """Return joint velocities for joints (n, joints) and pose derivatives (n, 4); slides do not move."""
        return self.velocities_from_base(joints, self._turned_back(tool_velocities))

    def links(self, joints: FloatArray) -> tuple[ArmPart, ...]:
        """Return the parts to draw for joints of shape (n, joints), from the base to the tool."""
        parts = self.links_from_base(joints)
        return tuple(replace(part, points_mm=self.base.in_station(part.points_mm)) for part in parts)

    def axis_mm(self, joints: FloatArray) -> tuple[float, float]:
        """Return x and y of the arm's first axis, the centre of radii, at joints of shape (joints,)."""
        along_mm = sum((float(joints[column]) for column, coordinate in self.slides if coordinate == 0), 0.0)
        x_mm, y_mm, _ = self.base.in_station(np.array([along_mm, 0.0, 0.0])).tolist()
        return x_mm, y_mm

    def in_station(self, poses: FloatArray) -> FloatArray:
        """Convert poses of shape (n, 4) from the base's frame to the station's."""
        if self.base == STATION:
            return poses
        return np.column_stack([self.base.in_station(poses[:, :3]), wrapped_deg(poses[:, 3] + self.base.phi_deg)])

    def _turned_back(self, vectors: FloatArray) -> FloatArray:
        """Rotate vectors of shape (n, 4), whose first three columns are coordinates, from station to base."""
        if self.base == STATION:
            return vectors
        return np.column_stack([vectors[:, :3] @ self.base.matrix[:3, :3], vectors[:, 3]])
