"""The parts to draw of a chain: lines along the common normals and axes of its DH table."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.dh import Convention, DhTable
from steptwin.host.robots.kinematics.links import ArmPart, Role, line
from steptwin.host.robots.kinematics.serial.levenberg import PLACE_OFF_MM

_HAND_PART: Final = 0.08
"""Length drawn of the tool's z axis, as a part of the arm's size."""


def chain_parts(dh: DhTable, joints: Mapping[str, FloatArray], size_mm: float) -> tuple[ArmPart, ...]:
    """Return a part from each joint to the next, the tool's z axis, and the tool from the last joint to its tip.

    `joints` are positions of shape (n,) by the names of the table's variables, along the chain.
    """
    frames, names = dh.frames(joints), list(joints)
    corners = [frames[0][:, :3, 3]]
    parts: list[ArmPart] = []
    for i, row in enumerate(dh.rows):
        corners += _corners(dh.convention, frames[i], frames[i + 1], row.a_mm)
        if row.theta_deg.variable or row.d_mm.variable:
            slides = bool(row.d_mm.variable)
            parts.append(line(f"to {names.pop(0)}", Role.GUIDE if not parts or slides else Role.LINK, *corners))
            corners = corners[-1:]
    tip_mm = frames[-1][:, :3, 3]
    hand = line("hand", Role.HAND, tip_mm, tip_mm + _HAND_PART * size_mm * frames[-1][:, :3, 2])
    return (*parts, hand, line("tool", Role.TOOL, *corners, *([tip_mm] if len(corners) == 1 else [])))


def _corners(convention: Convention, before: FloatArray, behind: FloatArray, a_mm: float) -> list[FloatArray]:
    """Return the corner of a row's link, where the common normal meets the axis, and its end, each of shape (n, 3)."""
    start, end = before[:, :3, 3], behind[:, :3, 3]
    modified = convention is Convention.MODIFIED
    corner = start + a_mm * before[:, :3, 0] if modified else end - a_mm * behind[:, :3, 0]
    return [point for point, last in ((corner, start), (end, corner)) if np.abs(point - last).max() > PLACE_OFF_MM]
