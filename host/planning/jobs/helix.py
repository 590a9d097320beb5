"""The hybrid arm draws a helix of four turns in 80 s and 240 steps, its joints on Akima splines through the samples.

    X = 350 + 80 cos w        Y = 150 + 80 sin w        Z = 500 + 60 w / (2 pi)        w from 0 to 8 pi

Source: H. Zhou, four-DOF hybrid handling robot: duration, steps and Akima's splines are the paper's. The size is lost;
this one is assumed.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.planning.jobs.fitting import hybrid_scale
from steptwin.host.planning.jobs.five_points import OPERATING_MODE
from steptwin.host.planning.jobs.job import Job
from steptwin.host.planning.jobs.options import number
from steptwin.host.planning.motions.following import follow
from steptwin.host.planning.motions.sampled import Sampled
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.robot import Robot

STEPS: Final = 240
TURNS: Final = 4
RADIUS_MM: Final = 80.0
RISE_MM_PER_TURN: Final = 60.0
CENTRE_MM: Final = (350.0, 150.0, 500.0)


def _radius_mm(robot: Robot) -> float:
    grown, radial, _, _ = hybrid_scale(robot)
    return RADIUS_MM * grown * radial


def _rise_mm(robot: Robot) -> float:
    return RISE_MM_PER_TURN * hybrid_scale(robot)[2]


def _bottom_mm(robot: Robot) -> float:
    """The helix keeps its middle, 120 mm above its bottom, at the same part of the sliders' stroke."""
    _, _, vertical, rise_mm = hybrid_scale(robot)
    return CENTRE_MM[2] + rise_mm + (1.0 - vertical) * RISE_MM_PER_TURN * TURNS / 2.0


@dataclass(frozen=True, slots=True)
class HelixOptions:
    """The options of the helix; its place and size grow and move with the arm's dimensions."""

    duration_s: float = number(80.0, 1.0, 3600.0, "s")
    x_mm: float = number(CENTRE_MM[0], -5000.0, 5000.0, "mm", lambda robot: CENTRE_MM[0] * hybrid_scale(robot)[0])
    y_mm: float = number(CENTRE_MM[1], -5000.0, 5000.0, "mm", lambda robot: CENTRE_MM[1] * hybrid_scale(robot)[0])
    z_mm: float = number(CENTRE_MM[2], -5000.0, 5000.0, "mm", _bottom_mm)
    radius_mm: float = number(RADIUS_MM, 1.0, 1000.0, "mm", _radius_mm)
    rise_mm: float = number(RISE_MM_PER_TURN, 0.0, 500.0, "mm per turn", _rise_mm)


def helix(robot: Robot, options: HelixOptions) -> Trajectory:
    """Return the helix as Akima's splines in the joints, from rest to rest.

    PVT points are at whole milliseconds, but a step lasts 80 s / 240. So each sample is taken at the nearest whole
    millisecond and holds the helix's pose of that time. Raise InputError if the mechanism does not reach the helix.
    """
    end_ms = whole_ms("duration_s", options.duration_s)
    t_s = np.round(np.arange(STEPS + 1) * end_ms / STEPS) / 1000
    joints = follow(robot, helix_poses(t_s / t_s[-1], options), t_s, OPERATING_MODE, np.array(robot.home))
    return Sampled.akima(robot.joint_names, t_s, joints)


def helix_poses(part: FloatArray, options: HelixOptions) -> FloatArray:
    """Return poses, of shape (n, 4), at parts of the way, of shape (n,), from 0 to 1."""
    w = 2.0 * np.pi * TURNS * part
    return np.column_stack(
        [
            options.x_mm + options.radius_mm * np.cos(w),
            options.y_mm + options.radius_mm * np.sin(w),
            options.z_mm + options.rise_mm * TURNS * part,
            np.zeros(len(part)),
        ]
    )


HELIX: Final = Job("helix", "a helix of four turns on Akima splines through 241 samples", HelixOptions, helix)
