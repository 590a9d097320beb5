"""The arm's parts as lines in space: what pictures, animations and the panel draw of a mechanism."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray

SLIDE_PART: Final = 0.05
"""Length drawn of a part that slides along the vertical, as a fraction of the arm's reach."""

HAND_PART: Final = 0.08
"""Length of the hand as a fraction of the arm's reach. The hand is only drawn: it shows the tool's attitude."""


class Role(StrEnum):
    """What a part does: it guides others, slides on a guide, is a link between two joints, or belongs to the tool."""

    GUIDE = "guide"
    SLIDE = "slide"
    LINK = "link"
    TOOL = "tool"


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """One part of a mechanism at n instants.

    Attributes:
        name: what it is, in a few words.
        role: what it does.
        points_mm: shape (n, points, 3), the ends of its straight pieces in the world frame.
    """

    name: str
    role: Role
    points_mm: FloatArray


def line(name: str, role: Role, *points_mm: FloatArray) -> Link:
    """Return the part through points, each of shape (n, 3), or of shape (3,) for one that stands still."""
    return Link(name, role, np.stack(np.broadcast_arrays(*points_mm), axis=-2))


def point(x_mm: FloatArray | float, y_mm: FloatArray | float, z_mm: FloatArray | float) -> FloatArray:
    """Return points of shape (n, 3); coordinates that are numbers are the same at all instants."""
    return np.stack(np.broadcast_arrays(x_mm, y_mm, z_mm), axis=-1).astype(np.float64)


def slide(name: str, middle_mm: FloatArray, reach_mm: float) -> Link:
    """Return a part that slides along the vertical, around its middle, of shape (n, 3)."""
    half_mm = np.array([0.0, 0.0, SLIDE_PART * reach_mm / 2.0])
    return line(name, Role.SLIDE, middle_mm - half_mm, middle_mm + half_mm)


def tool(wrist_mm: FloatArray, poses: FloatArray, reach_mm: float) -> tuple[Link, Link]:
    """Return the hand and then the tool, from the wrist down or up to the tip's height and out to the tip.

    Args:
        wrist_mm: shape (n, 3), where the tool leaves the last link.
        poses: shape (n, 4).
        reach_mm: reach of the arm.
    """
    tips_mm, attitude_rad = poses[:, :3], np.deg2rad(poses[:, 3])
    ahead = point(np.cos(attitude_rad), np.sin(attitude_rad), 0.0)
    below_wrist_mm = point(wrist_mm[:, 0], wrist_mm[:, 1], tips_mm[:, 2])
    return (
        line("hand", Role.TOOL, tips_mm, tips_mm + HAND_PART * reach_mm * ahead),
        line("tool", Role.TOOL, wrist_mm, below_wrist_mm, tips_mm),
    )
