"""Joint positions with the elbow on a given side, at the same tool pose."""

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics import Elbow, make_kinematics
from steptwin.host.robots.robot import Robot


def with_elbow(robot: Robot, joints: FloatArray, elbow: Elbow) -> FloatArray:
    """Return joints of shape (joints,) with the same tool pose and slides as the given ones, and this elbow."""
    kinematics = make_kinematics(robot)
    solved: FloatArray = kinematics.solve(kinematics.forward(joints[np.newaxis]), elbow.value, joints).joints[0]
    return solved
