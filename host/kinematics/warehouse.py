"""The warehouse robot: two slides carry an arm with its lift first, then three parallel rotary joints.

Modified (Craig) DH parameters alpha, a, d, theta of the arm: (0, 0, L1, th1), (0, L2, 0, th2), (0, L3, 0, th3),
(0, L5, -L4, 0). From them, with the slides parallel to the axes of the arm's base:

    phi = th1 + th2 + th3                    y = L2 sin th1 + L3 sin(th1 + th2) + L5 sin phi
    z = sz + L1 - L4                         x = sx + L2 cos th1 + L3 cos(th1 + th2) + L5 cos phi

Source: A. Jiang, L. Guo, X. Tan, "Development of Prototype of a New Intelligent Warehouse Robot", 2019,
DOI 10.3969/j.issn.1009-9492.2019.05.018, with its inverse corrected: it takes the wrist's direction from an arc
cosine, which loses the sign of y, and gives one elbow only.
"""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from host.kinematics.angles import wrapped_deg
from host.kinematics.base import Branch, Constraint, joint_constraints, read_geometry, require_joints
from host.kinematics.planar2r import Elbow, Planar2R
from host.robot import Joint, Robot, Unit
from host.trajectory import FloatArray

JOINTS: Final = {
    "sx": Unit.MM,
    "sz": Unit.MM,
    "L1": Unit.MM,
    "th1": Unit.DEG,
    "th2": Unit.DEG,
    "th3": Unit.DEG,
}
SX, SZ, L1, TH1, TH2, TH3 = range(6)
"""The joints' columns."""


@dataclass(frozen=True, slots=True)
class WarehouseGeometry:
    """The dimensions in a robot's file: shoulder to elbow, elbow to wrist, arm down to tool, wrist to tool."""

    L2_mm: float
    L3_mm: float
    L4_mm: float
    L5_mm: float


@dataclass(frozen=True, slots=True)
class WarehouseScara:
    """The mechanism.

    Attributes:
        arm: the links L2 and L3, from shoulder to wrist.
        L4_mm: how far the tool is below the arm.
        L5_mm: from wrist to tool.
        limits: the joints sx, sz, L1, th1, th2, th3, asked only to say whether a pose is reachable.
    """

    arm: Planar2R
    L4_mm: float
    L5_mm: float
    limits: tuple[Joint, ...]

    @classmethod
    def of(cls, robot: Robot) -> Self:
        """From a robot's file.

        Raises:
            InputError: its dimensions or joints are not this mechanism's.
        """
        require_joints(robot, JOINTS)
        geometry = read_geometry(WarehouseGeometry, robot)
        return cls(Planar2R(geometry.L2_mm, geometry.L3_mm), geometry.L4_mm, geometry.L5_mm, robot.joints)

    def forward(self, joints: FloatArray) -> FloatArray:
        """Poses of shape (n, 4) from joints of shape (n, 6)."""
        attitude_deg = joints[:, TH1] + joints[:, TH2] + joints[:, TH3]
        attitude_rad = np.deg2rad(attitude_deg)
        x_mm, y_mm = self.arm.forward(np.deg2rad(joints[:, TH1]), np.deg2rad(joints[:, TH2]))
        return np.column_stack(
            [
                joints[:, SX] + x_mm + self.L5_mm * np.cos(attitude_rad),
                y_mm + self.L5_mm * np.sin(attitude_rad),
                joints[:, SZ] + joints[:, L1] - self.L4_mm,
                wrapped_deg(attitude_deg),
            ]
        )

    def inverse(self, poses: FloatArray, near: FloatArray | None = None) -> tuple[Branch, ...]:
        """The branches `right` and `left` for poses of shape (n, 4); the slides stay where `near` has them, or at 0."""
        return tuple(self._branch(poses, elbow, near) for elbow in Elbow)

    def joints_at(self, poses: FloatArray, elbow: Elbow, near: FloatArray | None = None) -> FloatArray:
        """One branch without a judgement: shape (n, 6), angles in (-180, 180], NaN where out of the arm's reach."""
        joints = np.zeros((len(poses), len(JOINTS)))
        if near is not None:
            joints[:, [SX, SZ]] = near[..., [SX, SZ]]
        th1_rad, th2_rad = self.arm.inverse(*self._wrist(poses, joints), elbow)
        joints[:, L1] = poses[:, 2] - joints[:, SZ] + self.L4_mm
        joints[:, TH1] = wrapped_deg(np.rad2deg(th1_rad))
        joints[:, TH2] = np.rad2deg(th2_rad)
        joints[:, TH3] = wrapped_deg(poses[:, 3] - joints[:, TH1] - joints[:, TH2])
        return joints

    def joint_velocities(self, joints: FloatArray, tool_velocities: FloatArray) -> FloatArray:
        """Shape (n, 6) from joints of shape (n, 6) and pose derivatives of shape (n, 4); the slides stand still."""
        attitude_rad = np.deg2rad(joints[:, TH1] + joints[:, TH2] + joints[:, TH3])
        turning_mm_s = self.L5_mm * np.deg2rad(tool_velocities[:, 3])
        w1_rad_s, w2_rad_s = self.arm.joint_velocities(
            np.deg2rad(joints[:, TH1]),
            np.deg2rad(joints[:, TH2]),
            tool_velocities[:, 0] + turning_mm_s * np.sin(attitude_rad),
            tool_velocities[:, 1] - turning_mm_s * np.cos(attitude_rad),
        )
        velocities = np.zeros_like(joints)
        velocities[:, L1] = tool_velocities[:, 2]
        velocities[:, TH1] = np.rad2deg(w1_rad_s)
        velocities[:, TH2] = np.rad2deg(w2_rad_s)
        velocities[:, TH3] = tool_velocities[:, 3] - velocities[:, TH1] - velocities[:, TH2]
        return velocities

    def _branch(self, poses: FloatArray, elbow: Elbow, near: FloatArray | None) -> Branch:
        joints = self.joints_at(poses, elbow, near)
        return Branch(elbow.value, joints, (self._reach(poses, joints), *joint_constraints(self.limits, joints)))

    def _reach(self, poses: FloatArray, joints: FloatArray) -> Constraint:
        wrist_mm = np.hypot(*self._wrist(poses, joints))
        nearest_mm, farthest_mm = self.arm.reach_mm
        kept = ~np.isnan(joints[:, TH2])
        return Constraint("out of reach: shoulder to wrist", "mm", wrist_mm, nearest_mm, farthest_mm, kept)

    def _wrist(self, poses: FloatArray, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The wrist's x and y in mm as seen from the shoulder, wherever the slide sx has it."""
        attitude_rad = np.deg2rad(poses[:, 3])
        x_mm = poses[:, 0] - joints[:, SX] - self.L5_mm * np.cos(attitude_rad)
        y_mm = poses[:, 1] - self.L5_mm * np.sin(attitude_rad)
        return x_mm, y_mm
