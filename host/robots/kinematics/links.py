"""The parts of an arm as lines in space, for pictures.

The column is on the ground (z = 0, or the lowest position of the tool) or on the slides. Positions of slides and the
thickness of a machine are not known: the rail is drawn behind the arm.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray

if TYPE_CHECKING:
    from steptwin.host.robots.kinematics.scara import Scara


SLIDE_PART: Final = 0.05
"""Drawn length of a part that slides vertically, as a fraction of the arm's reach."""

HAND_PART: Final = 0.08
"""Drawn length of the hand, which shows the tool's attitude, as a fraction of the arm's reach."""


class Role(StrEnum):
    """Role of a part: guide, slide on a guide, link between two joints, or tool.

    The other roles are no bodies: the hand shows the direction of the tool; axis is a joint's axis; x, y and z are the
    axes of a frame.
    """

    GUIDE = "guide"
    SLIDE = "slide"
    LINK = "link"
    TOOL = "tool"
    HAND = "hand"
    AXIS = "axis"
    X = "x"
    Y = "y"
    Z = "z"


@dataclass(frozen=True, slots=True, eq=False)
class ArmPart:
    """One part of a mechanism at n instants.

    Attributes:
        name: name of the part.
        role: its role.
        points_mm: shape (n, points, 3), ends of its straight pieces.
    """

    name: str
    role: Role
    points_mm: FloatArray


def line(name: str, role: Role, *points_mm: FloatArray) -> ArmPart:
    """Return the part through points, each of shape (n, 3), or of shape (3,) for a fixed point."""
    return ArmPart(name, role, np.stack(np.broadcast_arrays(*points_mm), axis=-2))


def point(x_mm: FloatArray | float, y_mm: FloatArray | float, z_mm: FloatArray | float) -> FloatArray:
    """Return points of shape (n, 3); coordinates that are numbers are the same at all instants."""
    return np.stack(np.broadcast_arrays(x_mm, y_mm, z_mm), axis=-1).astype(np.float64)


def slide(name: str, middle_mm: FloatArray, reach_mm: float) -> ArmPart:
    """Return a part that slides along the vertical, around its middle, of shape (n, 3)."""
    half_mm = np.array([0.0, 0.0, SLIDE_PART * reach_mm / 2.0])
    return line(name, Role.SLIDE, middle_mm - half_mm, middle_mm + half_mm)


def tool(wrist_mm: FloatArray, poses: FloatArray, reach_mm: float) -> tuple[ArmPart, ArmPart]:
    """Return the hand and the tool, from the wrist vertically to the tip's height and horizontally to the tip.

    Args:
        wrist_mm: shape (n, 3), position of the wrist on the last link.
        poses: shape (n, 4).
        reach_mm: reach of the arm.
    """
    tips_mm, attitude_rad = poses[:, :3], np.deg2rad(poses[:, 3])
    ahead = point(np.cos(attitude_rad), np.sin(attitude_rad), 0.0)
    below_wrist_mm = point(wrist_mm[:, 0], wrist_mm[:, 1], tips_mm[:, 2])
    return (
        line("hand", Role.HAND, tips_mm, tips_mm + HAND_PART * reach_mm * ahead),
        line("tool", Role.TOOL, wrist_mm, below_wrist_mm, tips_mm),
    )


BEHIND_PART: Final = 0.6
"""Drawn distance of the slides' mast behind the arm's axis, as a fraction of the arm's reach."""


def solid_parts(scara: "Scara", joints: FloatArray) -> tuple[ArmPart, ...]:
    """Return the parts with known positions: column, both links and the tool, without rail and mast.

    Joints have the shape (n, joints).
    """
    return tuple(part for part in scara.links(joints) if part.name in _SOLID or part.name.startswith(_COLUMN))


_COLUMN: Final = "column"
_SOLID: Final = ("first link", "second link", "tool")


def scara_links(scara: "Scara", joints: FloatArray) -> tuple[ArmPart, ...]:
    """Return the parts for joints of shape (n, joints), from the base to the tool; the last point is the tool's tip."""
    shoulder_rad = np.deg2rad(joints[:, scara.shoulder] + scara.heading_deg)
    second_rad = shoulder_rad + np.deg2rad(joints[:, scara.elbow])
    foot_mm = np.zeros((len(joints), 3))
    for column, coordinate in scara.slides:
        foot_mm[:, coordinate] += joints[:, column]
    shoulder_mm = foot_mm + point(0.0, 0.0, scara.base_mm + _lifted_mm(scara, joints))
    elbow_mm = shoulder_mm + scara.arm.l1_mm * _towards(shoulder_rad)
    raised_mm = elbow_mm + point(0.0, 0.0, scara.offset_mm)
    wrist_mm = raised_mm + scara.arm.l2_mm * _towards(second_rad)
    return (
        *_guides(scara, foot_mm),
        *_column(scara, foot_mm, shoulder_mm),
        line("first link", Role.LINK, shoulder_mm, elbow_mm),
        line("second link", Role.LINK, *([elbow_mm] * bool(scara.offset_mm)), raised_mm, wrist_mm),
        *tool(wrist_mm, scara.forward_from_base(joints), scara.arm.reach_mm[1]),
    )


def _towards(angle_rad: FloatArray) -> FloatArray:
    return point(np.cos(angle_rad), np.sin(angle_rad), 0.0)


def _lifts_arm(scara: "Scara") -> bool:
    """Return whether the lift is before the shoulder in the chain, so it lifts the links."""
    return scara.lift is not None and scara.lift < scara.shoulder


def _lifted_mm(scara: "Scara", joints: FloatArray) -> FloatArray | float:
    return scara.lift_sign * joints[:, scara.lift] if scara.lift is not None and _lifts_arm(scara) else 0.0


def _guides(scara: "Scara", foot_mm: FloatArray) -> tuple[ArmPart, ...]:
    """Return the rail on the ground, the mast that moves on it, and the bracket on the mast that carries the arm."""
    if not scara.slides:
        return ()
    travels = {coordinate: scara.limits[column] for column, coordinate in scara.slides}
    along, up = travels[0], travels[2]
    behind_mm = -BEHIND_PART * scara.arm.reach_mm[1]
    mast_mm = point(foot_mm[:, 0], behind_mm, foot_mm[:, 2])
    lowest_mm, highest_mm = (point(foot_mm[:, 0], behind_mm, end_mm) for end_mm in (up.lower, up.upper))
    rail_mm = (np.broadcast_to([end_mm, behind_mm, up.lower], foot_mm.shape) for end_mm in (along.lower, along.upper))
    return (
        line(f"rail {along.name}", Role.GUIDE, *rail_mm),
        line(f"mast {up.name}", Role.GUIDE, lowest_mm, highest_mm),
        slide(f"slide {up.name}", mast_mm, scara.arm.reach_mm[1]),
        line("bracket", Role.LINK, mast_mm, foot_mm),
    )


def _column(scara: "Scara", foot_mm: FloatArray, shoulder_mm: FloatArray) -> tuple[ArmPart, ...]:
    """Return the column, and the slide on it that carries the arm if the lift lifts the arm."""
    lift = None if scara.lift is None else scara.limits[scara.lift]
    lifted_mm = [0.0] if lift is None else sorted(scara.lift_sign * end_mm for end_mm in (lift.lower, lift.upper))
    bottom_mm = 0.0 if scara.slides else min(0.0, scara.height_mm + lifted_mm[0])
    bottom = foot_mm + point(0.0, 0.0, bottom_mm)
    if lift is None or not _lifts_arm(scara):
        return (line("column", Role.GUIDE, bottom, shoulder_mm),)
    top = foot_mm + point(0.0, 0.0, scara.base_mm + lifted_mm[-1])
    return (
        line(f"column {lift.name}", Role.GUIDE, bottom, top),
        slide(f"slide {lift.name}", shoulder_mm, scara.arm.reach_mm[1]),
    )
