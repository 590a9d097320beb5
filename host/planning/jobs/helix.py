"""The hybrid arm draws a helix of four turns in 80 s and 240 steps, its joints on Akima splines through the samples.

    X = 350 + 80 cos w        Y = 150 + 80 sin w        Z = 500 + 60 w / (2 pi)        w from 0 to 8 pi

Source: H. Zhou, four-DOF hybrid handling robot: duration, steps and Akima's splines are the paper's; the helix' size is
lost and assumed.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import whole_ms
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


@dataclass(frozen=True, slots=True)
class HelixOptions:
    """How long it takes."""

    duration_s: float = number(80.0, 1.0, 3600.0, "s")


def helix(robot: Robot, options: HelixOptions) -> Trajectory:
    """Akima's splines in the joints, from rest to rest.

    A step lasts 80 s / 240, which is no whole number of milliseconds, but PVT points are: each sample is taken at the
    nearest whole one, and is where the helix is at that time.

    Raises:
        InputError: a duration that is not a whole number of milliseconds, or too short for the joints.
    """
    end_ms = whole_ms("duration_s", options.duration_s)
    t_s = np.round(np.arange(STEPS + 1) * end_ms / STEPS) / 1000
    joints = follow(robot, helix_poses(t_s / t_s[-1]), t_s, OPERATING_MODE, np.array(robot.home))
    return Sampled.akima(robot.joint_names, t_s, joints)


def helix_poses(part: FloatArray) -> FloatArray:
    """Poses, shape (n, 4), at parts of shape (n,) of the way, from 0 to 1."""
    w = 2.0 * np.pi * TURNS * part
    x_mm, y_mm, z_mm = CENTRE_MM
    return np.column_stack(
        [
            x_mm + RADIUS_MM * np.cos(w),
            y_mm + RADIUS_MM * np.sin(w),
            z_mm + RISE_MM_PER_TURN * TURNS * part,
            np.zeros(len(part)),
        ]
    )


HELIX: Final = Job("helix", "a helix of four turns on Akima splines through 241 samples", HelixOptions, helix)
