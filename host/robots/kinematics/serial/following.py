"""Solve the joints of a chain along a path of its tool."""

from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.robots.kinematics.serial.levenberg import Found, NumericInverse

_ANCHORS: Final = 50
"""Spacing in poses of the anchors of a path, which are solved one after the other; then those between them."""


def find_along(numeric: NumericInverse, poses: FloatArray, near: FloatArray) -> Found:
    """Return joints along a path that begins near joints of shape (joints,), without jumps of whole turns.

    Anchor poses are solved one after the other. The poses between them start from interpolated joints.
    """
    places = np.unique(np.append(np.arange(0, len(poses), _ANCHORS), len(poses) - 1))
    anchors, last = np.empty((len(places), len(near))), np.array(near[np.newaxis], dtype=np.float64)
    for row, place in enumerate(places):
        check_planning_time()
        last = numeric.near(poses[place : place + 1], last).joints
        anchors[row] = last[0]
    starts = np.column_stack([np.interp(np.arange(len(poses)), places, column) for column in anchors.T])
    return find_near(numeric, poses, starts)


def find_near(numeric: NumericInverse, poses: FloatArray, guides: FloatArray) -> Found:
    """Return joints at poses of a path, from guides of shape (n, joints), in the turns nearest to the guides."""
    found = numeric.near(poses, guides)
    return found._replace(joints=np.where(numeric.slides, found.joints, turned_to(guides, found.joints)))


def turned_to(guides: FloatArray, joints: FloatArray) -> FloatArray:
    """Return joints, in degrees, in the turns nearest to guides."""
    return np.asarray(joints + 360.0 * np.round((guides - joints) / 360.0))
