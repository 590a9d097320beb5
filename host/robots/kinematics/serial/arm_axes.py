"""The axes of an arm's joints at zero, in the frame of its base: all that the closed form needs to know of it."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.dh import Convention, DhTable
from steptwin.host.robots.poses.base_frame import STATION


@dataclass(frozen=True, slots=True, eq=False)
class ArmAxes:
    """The axes of a chain's joints with all joints at 0.

    Attributes:
        directions: shape (joints, 3), unit vectors.
        points_mm: shape (joints, 3), a point on each axis.
        slides: true for each joint that slides along its axis instead of turning about it.
        home_mm: shape (3,), the tool's place.
        home_rotation: shape (3, 3), the tool's axes as columns.
    """

    directions: FloatArray
    points_mm: FloatArray
    slides: tuple[bool, ...]
    home_mm: FloatArray
    home_rotation: FloatArray


@lru_cache(maxsize=16)
def axes_of(table: DhTable, joints: tuple[str, ...]) -> ArmAxes:
    """Return the axes of a DH table whose variables are among the joints, in the joints' order."""
    at_zero = {name: np.zeros(1) for name in joints}
    frames = DhTable(table.convention, table.rows, STATION).frames(at_zero)[:, 0]
    behind = table.convention is Convention.MODIFIED  # a modified row's joint turns about the z axis behind the row
    found: dict[str, tuple[FloatArray, FloatArray, bool]] = {}
    for i, row in enumerate(table.rows):
        frame = frames[i + behind]
        for parameter, slides in ((row.theta_deg, False), (row.d_mm, True)):
            if parameter.variable:
                found[parameter.variable] = parameter.sign * frame[:3, 2], frame[:3, 3], slides
    axes, tool = [found[name] for name in joints], frames[-1]
    directions, points_mm = (np.array([axis[i] for axis in axes]) for i in (0, 1))
    return ArmAxes(directions, points_mm, tuple(axis[2] for axis in axes), tool[:3, 3], tool[:3, :3])
