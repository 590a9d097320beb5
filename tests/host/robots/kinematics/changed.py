"""Robots with other dimensions, and differences of poses."""

from dataclasses import replace

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.robot import Robot


def with_geometry(robot: Robot, **dimensions: float) -> Robot:
    """Return a robot with some dimensions changed."""
    return replace(robot, geometry={**robot.geometry, **dimensions})


def pose_errors(found: FloatArray, poses: FloatArray) -> FloatArray:
    """Return the differences of two arrays of poses, in mm and degrees, without full turns."""
    errors = found - poses
    errors[:, 3] = (errors[:, 3] + 180.0) % 360.0 - 180.0
    return np.abs(errors)
