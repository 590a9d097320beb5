"""Compute joint positions, and which of them are known, from what the axes say."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from steptwin.host.robots.robot import Robot


class JointPosition(NamedTuple):
    """A joint's position in mm or degrees, and whether it counts from the joint's zero."""

    position: float
    known: bool


def joint_positions(robot: Robot, units: Sequence[int], known: Sequence[bool]) -> list[JointPosition]:
    """Return each joint's position from the positions of all axes, in wire units.

    A joint's position is known if that of each axis is known on which it depends.
    """
    positions = robot.to_positions(np.array(units)).tolist()
    return [
        JointPosition(position, all(known[axis] for axis in robot.coupling.axes_of(joint)))
        for joint, position in enumerate(positions)
    ]
