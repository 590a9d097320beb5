"""The parts of a SCARA as lines in space: guides, column, both links and the tool.

The column stands on the ground, at z = 0 or as far below it as the tool goes, or on the slides. Where slides are and
how thick a machine is, no dimension says: the rail is drawn behind the arm.
"""

from typing import TYPE_CHECKING, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.links import Link, Role, line, point, slide, tool

if TYPE_CHECKING:
    from steptwin.host.robots.kinematics.scara import Scara

BEHIND_PART: Final = 0.6
"""Distance at which the mast of slides is drawn behind the arm's axis, as a fraction of the arm's reach."""


def solid_parts(scara: "Scara", joints: FloatArray) -> tuple[Link, ...]:
    """Return the parts whose places the dimensions say: column, both links and the tool; rail and mast are drawn only.

    Joints have the shape (n, joints).
    """
    parts = scara_links(scara, joints)
    return tuple(part for part in parts if part.name in _SOLID or part.name.startswith(_COLUMN))


_COLUMN: Final = "column"
_SOLID: Final = ("first link", "second link", "tool")


def scara_links(scara: "Scara", joints: FloatArray) -> tuple[Link, ...]:
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
        *tool(wrist_mm, scara.forward(joints), scara.arm.reach_mm[1]),
    )


def _towards(angle_rad: FloatArray) -> FloatArray:
    return point(np.cos(angle_rad), np.sin(angle_rad), 0.0)


def _lifts_arm(scara: "Scara") -> bool:
    """Return whether the lift comes before the shoulder in the chain, so that it lifts the links."""
    return scara.lift is not None and scara.lift < scara.shoulder


def _lifted_mm(scara: "Scara", joints: FloatArray) -> FloatArray | float:
    return scara.lift_sign * joints[:, scara.lift] if scara.lift is not None and _lifts_arm(scara) else 0.0


def _guides(scara: "Scara", foot_mm: FloatArray) -> tuple[Link, ...]:
    """Return the rail on the ground, the mast that travels on it, and the bracket on the mast that bears the arm."""
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


def _column(scara: "Scara", foot_mm: FloatArray, shoulder_mm: FloatArray) -> tuple[Link, ...]:
    """Return the column, and the slide on it that bears the arm if the lift lifts the arm."""
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
