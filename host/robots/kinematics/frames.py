"""Frames in space as papers print them, [n o a p]: three columns of direction cosines and the position in mm."""

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.base import Kinematics
from steptwin.host.robots.kinematics.dh import DhTable


def tool_frames(kinematics: Kinematics, joints: FloatArray) -> FloatArray:
    """Return the tool's homogeneous transforms in the world frame for joints of shape (n, joints), shape (n, 4, 4).

    Its columns are n, o and a, the tool's x, y and z axes, and p, its position. They are the product of the DH table's
    links (`dh`), and NaN where the mechanism cannot be assembled.
    """
    return kinematics.dh.transforms(kinematics.dh_variables(joints))


def link_frames(kinematics: Kinematics, joints: FloatArray) -> FloatArray:
    """Return the transform of each row of the DH table relative to the row before, shape (rows, n, 4, 4)."""
    table, variables = kinematics.dh, kinematics.dh_variables(joints)
    return np.stack([DhTable(table.convention, (row,)).transforms(variables) for row in table.rows])
