"""Fit a paper's motion to another robot of the same kind: each is 1 or 0 apart from the paper's for its own robot."""

from collections.abc import Callable
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics import HybridArm, Scara, make_kinematics
from steptwin.host.robots.robot import Robot


def scara_reach_mm(robot: Robot) -> float:
    """Return the greatest distance of a SCARA's wrist from its shoulder; 0 for another mechanism."""
    kinematics = make_kinematics(robot)
    return kinematics.arm.reach_mm[1] if isinstance(kinematics, Scara) else 0.0


def in_reach(length_mm: float, paper_reach_mm: float) -> Callable[[Robot], float]:
    """Return a length as a part of a SCARA's reach, given for the reach of the paper's robot."""
    return lambda robot: length_mm * (scara_reach_mm(robot) / paper_reach_mm)


def in_reach_at_most(length_mm: float, paper_reach_mm: float) -> Callable[[Robot], float]:
    """Return the same for a length that a larger robot does not extend."""
    return lambda robot: length_mm * min(scara_reach_mm(robot) / paper_reach_mm, 1.0)


def fitted(robot: Robot, joints: FloatArray) -> FloatArray:
    """Return joints of shape (joints,), each at the nearest position within its limits."""
    lower, upper = ([getattr(joint, bound) for joint in robot.joints] for bound in ("lower", "upper"))
    return np.clip(joints, lower, upper)


HYBRID_RADIUS_MM: Final = 400.0
HYBRID_Z2_MAX_MM: Final = 150.0
HYBRID_STROKE_MM: Final = 500.0
HYBRID_REST_MM: Final = 280.0 + (350.0**2 - 150.0**2) ** 0.5
"""The tool's radius with the platform in the middle, the platform's way to either side, the sliders' stroke, and the
tool's height with the sliders at 0, of the arm for whose dimensions the poses of the jobs are given."""


def hybrid_scale(robot: Robot) -> tuple[float, float, float, float]:
    """Return how poses of the hybrid arm fit another one.

    These are the part by which radii grow, the part of the radial and of the vertical distances from the middle that
    remains, and the tool's rise with the sliders at 0, in mm.
    """
    arm = make_kinematics(robot)
    if not isinstance(arm, HybridArm):
        return 1.0, 1.0, 1.0, 0.0
    grown = arm.radius_mm / HYBRID_RADIUS_MM
    radial = min((arm.z2_max_mm / arm.radius_mm) / (HYBRID_Z2_MAX_MM / HYBRID_RADIUS_MM), 1.0)
    sliders = [robot.joint(name) for name in ("Z5", "Z6")]
    lower, upper = max(slider.lower for slider in sliders), min(slider.upper for slider in sliders)
    vertical = min((upper - lower) / HYBRID_STROKE_MM, 1.0)
    rest_mm = arm.height_mm + (arm.sliders.L_mm**2 - arm.sliders.h_mm**2) ** 0.5
    return grown, radial, vertical, rest_mm - HYBRID_REST_MM + (lower + upper) / 2.0
