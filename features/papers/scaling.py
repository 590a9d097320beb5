"""Fit the jobs of papers to robots of other sizes: joints within their limits, lengths in proportion."""

from collections.abc import Callable

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics import Elbow, Scara, make_kinematics
from steptwin.host.robots.robot import Robot


def with_elbow(robot: Robot, joints: FloatArray, elbow: Elbow) -> FloatArray:
    """Return joints of shape (joints,) with the same tool pose and slides as the given ones, and this elbow."""
    kinematics = make_kinematics(robot)
    solved: FloatArray = kinematics.solve(kinematics.forward(joints[np.newaxis]), elbow.value, joints).joints[0]
    return solved


def scara_reach_mm(robot: Robot) -> float:
    """Return the greatest distance of a SCARA's wrist from its shoulder; 0 for another mechanism."""
    kinematics = make_kinematics(robot)
    return kinematics.arm.reach_mm[1] if isinstance(kinematics, Scara) else 0.0


def in_reach(length_mm: float, paper_reach_mm: float) -> Callable[[Robot], float]:
    """Return a length scaled by a SCARA's reach, from the paper's robot."""
    return lambda robot: length_mm * (scara_reach_mm(robot) / paper_reach_mm)


def in_reach_at_most(length_mm: float, paper_reach_mm: float) -> Callable[[Robot], float]:
    """Return a length scaled by a SCARA's reach, at most the given one."""
    return lambda robot: length_mm * min(scara_reach_mm(robot) / paper_reach_mm, 1.0)


def in_station(axis: int, *place: Callable[[Robot], float]) -> Callable[[Robot], float]:
    """Return a function for x, y or z, by number, of a place from the base in the station's frame."""
    return lambda robot: float(robot.base.in_station(np.array([each(robot) for each in place]))[axis])


def fitted(robot: Robot, joints: FloatArray) -> FloatArray:
    """Return joints of shape (joints,), each limited to its range."""
    lower, upper = ([getattr(joint, bound) for joint in robot.joints] for bound in ("lower", "upper"))
    return np.clip(joints, lower, upper)
