"""The laboratory robot draws an Archimedean spiral of three turns about a vertical axis, rising, in 377 points.

    u_k = 0.05 k, k = 0..376        x = x0 + 5 u cos u        y = y0 + 5 u sin u        z = z0 + rise(u)

Source: H. Wang, B. Yin, R. Luo, X. Wang, "Mechanism design and kinematics analysis of 4-dof SCARA robot system",
J. Mechanical & Electrical Engineering 36(12), 2019, 1320-1324. It gives the rise as "pitch pi" without a unit: law A
takes it as pi mm per turn, u/2, law B as pi mm per radian, pi u. z0 and the time per point are not given, but assumed.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np

from steptwin.features.papers.scaling import in_reach, in_station
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.planning.jobs.job import Job
from steptwin.host.planning.jobs.options import number
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.sampled import c2_spline
from steptwin.host.planning.motions.tool_move import follow
from steptwin.host.robots.kinematics import Elbow
from steptwin.host.robots.robot import Robot

POINTS: Final = 377
STEP_RAD: Final = 0.05
MM_PER_RAD: Final = 5.0


_REACH_MM: Final = 800.0
"""Reach of the paper's arm."""
_START_PART: Final = 0.6
"""Fraction of the lift's stroke where the spiral begins: 150 of the paper's 250 mm."""


def _start_mm(robot: Robot) -> float:
    lift = robot.joint("d1")
    return lift.lower + _START_PART * (lift.upper - lift.lower) - float(robot.geometry["d5_mm"])


_START: Final = (in_reach(-300.0, _REACH_MM), in_reach(400.0, _REACH_MM), _start_mm)
"""Start of the spiral from the robot's base, x, y and z."""


class ZLaw(Enum):
    """The law of the spiral's rise."""

    A = "A"
    B = "B"

    @property
    def mm_per_rad(self) -> float:
        """Rise per radian of u."""
        return 0.5 if self is ZLaw.A else np.pi


@dataclass(frozen=True, slots=True)
class SpiralOptions:
    """Options: rise, tool's attitude, elbow's side, time between points, start and growth of the spiral.

    Start and growth are the paper's for its arm, and scaled for others.
    """

    z_law: ZLaw = ZLaw.A
    psi_deg: float = number(0.0, -180.0, 180.0, "deg")
    elbow: Elbow = Elbow.RIGHT
    point_s: float = number(0.05, 0.001, 10.0, "s")
    x_mm: float = number(-300.0, -2000.0, 2000.0, "mm", in_station(0, *_START))
    y_mm: float = number(400.0, -2000.0, 2000.0, "mm", in_station(1, *_START))
    z_mm: float = number(0.0, -2000.0, 2000.0, "mm", in_station(2, *_START))
    mm_per_rad: float = number(MM_PER_RAD, 0.01, 100.0, "mm/rad", in_reach(MM_PER_RAD, _REACH_MM))


def spiral(robot: Robot, options: SpiralOptions) -> Motion:
    """Return a C2 spline in the joints through the points; raise InputError if the arm does not reach them."""
    t_s = np.arange(POINTS) * whole_ms("point_s", options.point_s) / 1000
    joints = follow(robot, spiral_poses(options), t_s, options.elbow.value, np.array(robot.home))
    return c2_spline(robot.joint_names, t_s, joints)


def spiral_poses(options: SpiralOptions) -> FloatArray:
    """Return the points, of shape (377, 4)."""
    u = STEP_RAD * np.arange(POINTS)
    return np.column_stack(
        [
            options.x_mm + options.mm_per_rad * u * np.cos(u),
            options.y_mm + options.mm_per_rad * u * np.sin(u),
            options.z_mm + options.z_law.mm_per_rad * u,
            np.full(POINTS, options.psi_deg),
        ]
    )


SPIRAL: Final = Job("spiral", "an Archimedean spiral of three turns through 377 points", SpiralOptions, spiral)
