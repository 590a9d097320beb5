"""The hybrid arm draws a helix of four turns in 80 s and 240 steps, its joints on Akima splines through the samples.

    X = 350 + 80 cos w        Y = 150 + 80 sin w        Z = 500 + 60 w / (2 pi)        w from 0 to 8 pi

Source: H. Zhou, four-DOF hybrid handling robot: duration, steps and Akima's splines are the paper's. The size is
illegible in the available copy and is assumed. So are the five poses. The paper takes arbitrary ones and compares them
with its simulation along the helix; here they are on the helix, a fifth of its length apart.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.features.papers.hybrid_arm import HybridArm
from steptwin.features.papers.scaling import in_station
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs.job import Job
from steptwin.host.planning.jobs.options import number, parse_options
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.motions.sampled import akima_spline
from steptwin.host.planning.motions.tool_move import follow
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot

OPERATING_MODE: Final = "(+,+)"
"""Working mode of the machine: both sliders below the platform."""

SAMPLES: Final = 241
TURNS: Final = 4
RADIUS_MM: Final = 80.0
RISE_MM_PER_TURN: Final = 60.0
CENTRE_MM: Final = (350.0, 150.0, 500.0)


HYBRID_RADIUS_MM: Final = 400.0
HYBRID_Z2_MAX_MM: Final = 150.0
HYBRID_STROKE_MM: Final = 500.0
HYBRID_REST_MM: Final = 280.0 + (350.0**2 - 150.0**2) ** 0.5
"""Dimensions of the reference arm of the jobs' poses: radius of the tool with the platform in the middle, travel of the
platform to each side, stroke of the sliders, and height of the tool with the sliders at 0.
"""


def hybrid_scale(robot: Robot) -> tuple[float, float, float, float]:
    """Return the scale of poses from the reference hybrid arm to this one.

    It has the factor of radii, the factors of radial and vertical distances from the middle, and the tool's rise with
    the sliders at 0, in mm.
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


def _radius_mm(robot: Robot) -> float:
    grown, radial, _, _ = hybrid_scale(robot)
    return RADIUS_MM * grown * radial


def _rise_mm(robot: Robot) -> float:
    return RISE_MM_PER_TURN * hybrid_scale(robot)[2]


def _bottom_mm(robot: Robot) -> float:
    """The helix keeps its middle, 120 mm above its bottom, at the same fraction of the sliders' stroke."""
    _, _, vertical, rise_mm = hybrid_scale(robot)
    return CENTRE_MM[2] + rise_mm + (1.0 - vertical) * RISE_MM_PER_TURN * TURNS / 2.0


_CENTRE: Final = (
    lambda robot: CENTRE_MM[0] * hybrid_scale(robot)[0],
    lambda robot: CENTRE_MM[1] * hybrid_scale(robot)[0],
    _bottom_mm,
)
"""Centre of the helix from the robot's base: x, y and the height of its start."""


@dataclass(frozen=True, slots=True)
class HelixCurve:
    """The helix: centre, height of its start, radius, pitch and number of turns.

    The default place and size scale with the arm's dimensions.
    """

    x_mm: float = number(CENTRE_MM[0], -5000.0, 5000.0, "mm", in_station(0, *_CENTRE))
    y_mm: float = number(CENTRE_MM[1], -5000.0, 5000.0, "mm", in_station(1, *_CENTRE))
    z_mm: float = number(CENTRE_MM[2], -5000.0, 5000.0, "mm", in_station(2, *_CENTRE))
    radius_mm: float = number(RADIUS_MM, 1.0, 1000.0, "mm", _radius_mm)
    rise_mm: float = number(RISE_MM_PER_TURN, 0.0, 500.0, "mm per turn", _rise_mm)
    turns: int = number(TURNS, 1, 100, "turns")


@dataclass(frozen=True, slots=True)
class HelixOptions(HelixCurve):
    """Options of the helix: the curve, its duration and the number of its samples."""

    duration_s: float = number(80.0, 1.0, 3600.0, "s")
    samples: int = number(SAMPLES, 3, 10001, "samples")


def helix(robot: Robot, options: HelixOptions) -> Motion:
    """Return the helix as Akima's splines in the joints, from rest to rest.

    PVT points are at whole milliseconds, but a step lasts 80 s / 240. So each sample is at the nearest whole
    millisecond, with the helix's pose of that time.

    Raises:
        InputError: the mechanism does not reach the helix, or there are more samples than milliseconds.
    """
    end_ms, steps = whole_ms("duration_s", options.duration_s), options.samples - 1
    if steps > end_ms:
        raise InputError(
            f"option samples: {options.samples} in {end_ms} ms are more than one each ms; {end_ms + 1} passes"
        )
    t_s = np.round(np.arange(steps + 1) * end_ms / steps) / 1000
    joints = follow(robot, helix_poses(t_s / t_s[-1], options), t_s, OPERATING_MODE, np.array(robot.home))
    return akima_spline(robot.joint_names, t_s, joints)


def helix_poses(part: FloatArray, curve: HelixCurve) -> FloatArray:
    """Return poses, of shape (n, 4), at fractions of the helix, of shape (n,), from 0 to 1."""
    w = 2.0 * np.pi * curve.turns * part
    return np.column_stack(
        [
            curve.x_mm + curve.radius_mm * np.cos(w),
            curve.y_mm + curve.radius_mm * np.sin(w),
            curve.z_mm + curve.rise_mm * curve.turns * part,
            np.zeros(len(part)),
        ]
    )


HELIX: Final = Job("helix", "a helix on Akima splines through samples, four turns by default", HelixOptions, helix)


POINTS: Final = 5


@dataclass(frozen=True, slots=True)
class FivePointsOptions(HelixCurve):
    """Options: the helix and the pause at each pose."""

    pause_s: float = number(0.5, 0.001, 60.0, "s")


def five_points(robot: Robot, options: FivePointsOptions) -> Motion:
    """Return joint moves from the first pose to the fifth; raise InputError if a pose is out of reach."""
    order = np.arange(POINTS, dtype=np.float64)
    first, *others = follow(robot, five_poses(robot, options), order, OPERATING_MODE, np.array(robot.home))
    moves = Composer(robot, first)
    moves.pause(options.pause_s)
    for joints in others:
        moves.go(joints)
        moves.pause(options.pause_s)
    return moves.sequence()


def five_poses(robot: Robot, options: FivePointsOptions | None = None) -> FloatArray:
    """Return the poses, of shape (5, 4), by default those of the robot's default options."""
    return helix_poses(np.arange(POINTS) / POINTS, options or parse_options(FivePointsOptions, {}, robot))


FIVE_POINTS: Final = Job(
    "five-points", "visit five tool poses on the helix with a pause at each", FivePointsOptions, five_points
)
