"""Paths for these tests: chains of straight legs of the joints, and chains of lines of the tool."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from steptwin.features.fastest.corners import JointLeg, ToolLeg
from steptwin.features.fastest.pieces import FollowedPath
from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.motions.tool_move import present_branch
from steptwin.host.planning.motions.whole import Pace
from steptwin.host.planning.paths import straight
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot

FREE: Final = Pace()


def joint_legs(robot: Robot, corners: FloatArray, pace: Pace = FREE) -> list[JointLeg]:
    """Return the straight legs through positions of the joints, of shape (corners, joints)."""
    return [JointLeg(robot, start, goal, pace) for start, goal in pairwise(corners)]


def tool_legs(robot: Robot, start: FloatArray, ways_mm: Sequence[Sequence[float]], pace: Pace = FREE) -> list[ToolLeg]:
    """Return lines of the tool from joints on, each by a way in mm, the orientation kept."""
    kinematics = make_kinematics(robot)
    branch, joints, legs = present_branch(robot, start), start, []
    pose = kinematics.forward(start[np.newaxis])[0]
    for way_mm in ways_mm:
        goal = pose.copy()
        goal[:3] += way_mm
        path = straight(kinematics.task, tuple(pose.tolist()), tuple(goal.tolist()))
        legs.append(ToolLeg(FollowedPath.along(robot, path, branch, joints), pace))
        pose, joints = goal, legs[-1].followed.end
    return legs
