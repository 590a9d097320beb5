"""Lines that pictures draw beside the bodies of an arm: the axis of each joint, and frames of base, joints and tool.

A joint's axis is the z axis of its frame in the DH table, in the direction in which the joint counts. A slide that is
drawn has its axis there, since a table may shift it sideways. Joints that no table knows, as those of a parallel
mechanism or of a machine without a tool, have the axis of the guide on which they are drawn.
"""

from collections.abc import Iterable
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.dh import Convention
from steptwin.host.robots.kinematics.kinds import make_kinematics
from steptwin.host.robots.kinematics.links import ArmPart, Role, line
from steptwin.host.robots.robot import Robot

AXIS_PART: Final = 0.11
"""Length drawn of an axis to either side of its joint, as a part of the machine's size at home."""
FRAME_PART: Final = 0.09
"""Length drawn of the axes of a frame, as a part of the machine's size at home."""
FRAME_ROLES: Final = (Role.X, Role.Y, Role.Z)


def size_mm(robot: Robot) -> float:
    """Return the longest side of what a machine takes at home, without guides, which may be far longer, at least 1."""
    parts = make_kinematics(robot).links(np.array([robot.home]))
    bodies = [part.points_mm[0] for part in parts if part.role is not Role.GUIDE]
    return max(1.0, float(np.ptp(np.vstack(bodies), axis=0).max()))


def joint_axes(robot: Robot, joints: FloatArray) -> tuple[ArmPart, ...]:
    """Return a line `axis NAME` for each joint, in the robot's order, for joints of shape (n, joints).

    It goes through the joint in the direction in which it counts, or turns by the right hand's rule.
    """
    kinematics = make_kinematics(robot)
    parts, known = kinematics.links(joints), _axes_of_table(robot, joints)
    half_mm = AXIS_PART * size_mm(robot)
    axes = []
    for name in robot.joint_names:
        drawn = _drawn(parts, name)
        place_mm, direction = known[name] if name in known else _along(parts, name)
        if drawn is not None:
            place_mm = drawn.points_mm.mean(axis=1)
        axes.append(line(f"axis {name}", Role.AXIS, place_mm - half_mm * direction, place_mm + half_mm * direction))
    return tuple(axes)


def frames(robot: Robot, joints: FloatArray) -> tuple[ArmPart, ...]:
    """Return lines along x, y and z of each frame: the base's, the one of each joint in the DH table, and the tool's.

    Joints have the shape (n, joints).
    """
    kinematics = make_kinematics(robot)
    table = kinematics.dh
    moving = [i for i, row in enumerate(table.rows) if row.theta_deg.variable or row.d_mm.variable]
    behind = {"base": 0} | {f"joint {i + 1}": moving[i] + 1 for i in range(len(moving))} | {"tool": len(table.rows)}
    every = table.frames(kinematics.dh_variables(joints))
    every = np.broadcast_to(every, (len(every), len(joints), 4, 4))
    length_mm = FRAME_PART * size_mm(robot)
    return tuple(
        line(f"{role} of {name}", role, every[row, :, :3, 3], every[row, :, :3, 3] + length_mm * every[row, :, :3, k])
        for name, row in behind.items()
        for k, role in enumerate(FRAME_ROLES)
    )


def _axes_of_table(robot: Robot, joints: FloatArray) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return a place and the direction, each of shape (n, 3), of each joint that is a variable of the DH table."""
    kinematics = make_kinematics(robot)
    table, axes = kinematics.dh, {}
    every = table.frames(kinematics.dh_variables(joints))
    for i, row in enumerate(table.rows):
        frame = every[i + 1 if table.convention is Convention.MODIFIED else i]
        for parameter in (row.d_mm, row.theta_deg):
            if parameter.variable in robot.joint_names:
                axes[parameter.variable] = frame[:, :3, 3], parameter.sign * frame[:, :3, 2]
    return axes


def _drawn(parts: Iterable[ArmPart], name: str) -> ArmPart | None:
    """Return the part on which a joint slides or is; None if the table alone says where it is."""
    return next((part for part in parts if part.role is Role.SLIDE and part.name.endswith(f" {name}")), None) or next(
        (part for part in parts if part.name in (f"beam {name}", f"post {name}")), None
    )


def _along(parts: Iterable[ArmPart], name: str) -> tuple[FloatArray, FloatArray]:
    """Return the middle and the direction of the guide that carries a joint's name."""
    guide = next(part for part in parts if part.role is Role.GUIDE and part.name.endswith(f" {name}"))
    way_mm = guide.points_mm[:, -1] - guide.points_mm[:, 0]
    return guide.points_mm.mean(axis=1), way_mm / np.linalg.norm(way_mm, axis=-1, keepdims=True)
