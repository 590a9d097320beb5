"""Simulate the measurements of a calibration: random poses, the actual tool, and a measuring device's noise."""

from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import MEASUREMENTS_MAX
from steptwin.host.robots.calibration.measurements import Measurements
from steptwin.host.robots.kinematics.chain import Chain
from steptwin.host.robots.robot import Robot

_JOINT_DECIMALS: Final = 3
"""Decimals of a joint position, as files of measurements have them."""

NOISE_MAX_MM: Final = 10.0
"""Largest noise: a measuring device with more measures nothing."""


def simulate_measurements(robot: Robot, poses: int, noise_mm: float, seed: int) -> Measurements:
    """Return measurements of the actual tool, with the errors in the robot's file, at uniformly random joints.

    Args:
        robot: the robot, whose joints stay within their limits.
        poses: number of poses.
        noise_mm: standard deviation of each measured coordinate, normally distributed.
        seed: seed of joints and noise; the same seed gives the same measurements.

    Raises:
        InputError: the robot is no DH chain, or a number is out of range.
    """
    if not 1 <= poses <= MEASUREMENTS_MAX:
        raise InputError(f"poses={poses}: is outside 1..{MEASUREMENTS_MAX}")
    if not 0.0 <= noise_mm <= NOISE_MAX_MM:
        raise InputError(f"noise_mm={noise_mm:g}: is outside 0..{NOISE_MAX_MM:g} mm")
    if seed < 0:
        raise InputError(f"seed={seed}: is below 0")
    random = np.random.default_rng(seed)
    joints = random_joints(robot, poses, random)
    positions_mm = Chain.of(robot).poses(joints)[:, :3]
    return Measurements.of(joints, positions_mm + random.normal(0.0, noise_mm, positions_mm.shape))


def random_joints(robot: Robot, count: int, random: np.random.Generator) -> FloatArray:
    """Return joint positions of shape (count, joints), uniformly random within the limits, in whole thousandths."""
    lower, upper = (np.array(ends) for ends in zip(*((each.lower, each.upper) for each in robot.joints), strict=True))
    drawn = np.round(random.uniform(lower, upper, (count, len(lower))), _JOINT_DECIMALS)
    return np.clip(drawn, lower, upper)
