"""Lines in pictures beside the bodies of an arm: joint axes, and frames of base, joints and tool.

A joint's axis is the z axis of its frame in the DH table, in the joint's positive direction. A drawn slide has its axis
at its drawing, because the table may shift it sideways. Joints without a DH row, as in a parallel mechanism or a
machine without a tool, have the axis of their drawn guide.
"""

from collections.abc import Iterable
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.dh import Convention
from steptwin.host.robots.kinematics.kinds import make_kinematics
from steptwin.host.robots.kinematics.links import ArmPart, Role, line
from steptwin.host.robots.robot import Robot

AXIS_PART: Final = 0.16
"""Drawn length of an axis to each side of its joint, as a fraction of the machine's size at home."""
FRAME_PART: Final = 0.09
"""Drawn length of the axes of a frame, as a fraction of the machine's size at home."""
FRAME_ROLES: Final = (Role.X, Role.Y, Role.Z)


class Skeleton:
    """The drawing of a robot. Joints have the shape (n, joints).

    Attributes:
        robot: the robot.
        size_mm: longest side of its bounding box at home, without guides, which may be far longer; at least 1.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._kinematics = make_kinematics(robot)
        home = self._kinematics.links(np.array([robot.home]))
        bodies = [part.points_mm[0] for part in home if part.role is not Role.GUIDE]
        self.size_mm: float = max(1.0, float(np.ptp(np.vstack(bodies), axis=0).max()))
        rows = self._kinematics.dh.rows
        self._joints = [i for i, row in enumerate(rows) if row.theta_deg.variable or row.d_mm.variable]

    def whole(self, joints: FloatArray) -> tuple[ArmPart, ...]:
        """Return the bodies, then the joints' axes, then the frames."""
        parts, placed = self._kinematics.links(joints), self._placed(joints)
        return (*parts, *self._axes(parts, placed), *self._frames(placed))

    def axes(self, joints: FloatArray) -> tuple[ArmPart, ...]:
        """Return a line `axis NAME` for each joint, in the robot's order.

        It points in the joint's positive direction, for a rotary joint by the right-hand rule.
        """
        return self._axes(self._kinematics.links(joints), self._placed(joints))

    def frames(self, joints: FloatArray) -> tuple[ArmPart, ...]:
        """Return lines along x, y and z of the frames of the base, each joint in the DH table, and the tool."""
        return self._frames(self._placed(joints))

    def _placed(self, joints: FloatArray) -> FloatArray:
        """Return the frames of the base and behind each row of the table, shape (rows + 1, n, 4, 4)."""
        placed = self._kinematics.dh.frames(self._kinematics.dh_variables(joints))
        return np.broadcast_to(placed, (len(placed), len(joints), 4, 4))

    def _axes(self, parts: tuple[ArmPart, ...], placed: FloatArray) -> tuple[ArmPart, ...]:
        known = self._axes_of_table(placed)
        half_mm = AXIS_PART * self.size_mm
        axes = []
        for name in self.robot.joint_names:
            drawn = _drawn(parts, name)
            place_mm, direction = known[name] if name in known else _along(parts, name)
            if drawn is not None:
                place_mm = drawn.points_mm.mean(axis=1)
            ends_mm = place_mm - half_mm * direction, place_mm + half_mm * direction
            axes.append(line(f"axis {name}", Role.AXIS, *ends_mm))
        return tuple(axes)

    def _axes_of_table(self, placed: FloatArray) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Return a point and the direction, each of shape (n, 3), of each joint that is a variable of the table."""
        table, axes = self._kinematics.dh, {}
        for i in self._joints:
            row, frame = table.rows[i], placed[i + 1 if table.convention is Convention.MODIFIED else i]
            for parameter in (row.d_mm, row.theta_deg):
                if parameter.variable in self.robot.joint_names:
                    axes[parameter.variable] = frame[:, :3, 3], parameter.sign * frame[:, :3, 2]
        return axes

    def _frames(self, placed: FloatArray) -> tuple[ArmPart, ...]:
        behind = {"base": 0} | {f"row {i + 1}": i + 1 for i in self._joints} | {"tool": len(placed) - 1}
        ends = placed[..., :3, 3:] + FRAME_PART * self.size_mm * placed[..., :3, :3]
        return tuple(
            ArmPart(f"{role} of {name}", role, np.stack([placed[row, :, :3, 3], ends[row, :, :, k]], axis=1))
            for name, row in behind.items()
            for k, role in enumerate(FRAME_ROLES)
        )


def _drawn(parts: Iterable[ArmPart], name: str) -> ArmPart | None:
    """Return the drawn part of a joint; None if only the table gives its position."""
    return next((part for part in parts if part.role is Role.SLIDE and part.name.endswith(f" {name}")), None) or next(
        (part for part in parts if part.name in (f"beam {name}", f"post {name}")), None
    )


def _along(parts: Iterable[ArmPart], name: str) -> tuple[FloatArray, FloatArray]:
    """Return the middle and the direction of the guide with a joint's name."""
    guide = next(part for part in parts if part.role is Role.GUIDE and part.name.endswith(f" {name}"))
    way_mm = guide.points_mm[:, -1] - guide.points_mm[:, 0]
    return guide.points_mm.mean(axis=1), way_mm / np.linalg.norm(way_mm, axis=-1, keepdims=True)
