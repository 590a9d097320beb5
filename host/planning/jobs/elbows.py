"""Joint positions with the other elbow: the same tool pose, reached from the other side."""

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics import Elbow, make_kinematics
from steptwin.host.robots.robot import Robot


def with_elbow(robot: Robot, joints: FloatArray, elbow: Elbow) -> FloatArray:
    """Joints of shape (joints,) that take the tool where the given ones take it, slides as they are."""
    kinematics = make_kinematics(robot)
    solved: FloatArray = kinematics.solve(kinematics.forward(joints[np.newaxis]), elbow.value, joints).joints[0]
    return solved
