"""Tell whether the tool stays on its path when all joints move in proportion."""

from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.paths import ToolPath
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot

_ALONG: Final = 20
"""Places at which a motion straight in joint space is compared with the tool's path."""
_ON_PATH: Final = 1e-3
"""Distance in mm or degrees from the tool's path: less than a step of any axis, more than rounding at a singularity."""


def is_straight_in_joints(robot: Robot, path: ToolPath, start: FloatArray, goal: FloatArray) -> bool:
    """Return whether the tool stays on its path from one joint position to another, each of shape (joints,)."""
    parts = np.linspace(0.0, 1.0, _ALONG + 1)
    kinematics = make_kinematics(robot)
    poses = kinematics.forward(start + parts[:, np.newaxis] * (goal - start))
    off = poses - path.poses(parts * path.length_mm)
    off[:, 3] = 0.0 if kinematics.attitude_follows else (off[:, 3] + 180.0) % 360.0 - 180.0
    return bool(np.abs(off).max() < _ON_PATH)
