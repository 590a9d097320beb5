"""Measure how many poses a second the kinematics compute, beside numpy's sine of as many values."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import load_robot, robot_names
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot

BATCH = 8192
REPEATS = 50


@dataclass(frozen=True)
class KinematicsFigure:
    """One row of the table: the best of REPEATS runs."""

    robot: str
    way: str
    branches: int
    """Number of solutions for each pose; 1 for forward kinematics."""
    poses_per_s: float
    sin_ratio: float
    """Time divided by that of as many sines as joint values are read or, over all branches, written."""


def figures() -> list[KinematicsFigure]:
    """Measure forward and inverse kinematics of every robot."""
    return [figure for name in robot_names() for figure in measure(load_robot(name))]


def measure(robot: Robot) -> list[KinematicsFigure]:
    """Measure one robot with poses that it reaches."""
    kinematics = make_kinematics(robot)
    joints = _reached(robot)
    poses = kinematics.forward(joints)
    branches = len(kinematics.branches)
    return [
        _figure(robot, "forward", 1, joints, lambda: kinematics.forward(joints)),
        _figure(robot, "inverse", branches, np.tile(joints, branches), lambda: kinematics.inverse(poses, joints)),
    ]


def _reached(robot: Robot) -> FloatArray:
    """Return random joint positions within the limits whose poses the first branch reaches."""
    kinematics = make_kinematics(robot)
    lower, upper = [joint.lower for joint in robot.joints], [joint.upper for joint in robot.joints]
    joints = np.random.default_rng(1).uniform(lower, upper, (4 * BATCH, len(lower)))
    branch = kinematics.solve(kinematics.forward(joints), kinematics.branches[0], joints)
    return joints[np.logical_and.reduce([constraint.kept for constraint in branch.mechanism])][:BATCH]


def _figure(
    robot: Robot, way: str, branches: int, values: FloatArray, calculate: Callable[[], object]
) -> KinematicsFigure:
    sines = np.empty_like(values)
    angles = np.deg2rad(values)
    sin_s, taken_s = _best_s(lambda: np.sin(angles, out=sines), calculate)
    return KinematicsFigure(robot.name, way, branches, BATCH / taken_s, taken_s / sin_s)


def _best_s(*calculations: Callable[[], object]) -> list[float]:
    """Return each calculation's shortest time; they take turns, so that a slow moment of the machine affects all."""
    best_s = [float("inf")] * len(calculations)
    for _ in range(REPEATS):
        for which, calculate in enumerate(calculations):
            started = time.perf_counter()
            calculate()
            best_s[which] = min(best_s[which], time.perf_counter() - started)
    return best_s
