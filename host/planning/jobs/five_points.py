"""The hybrid arm visits five tool poses, with a pause at each.

Source: H. Zhou, four-DOF hybrid handling robot; the paper's poses are lost, these are assumed.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs.fitting import HYBRID_RADIUS_MM, hybrid_scale
from steptwin.host.planning.jobs.job import Job
from steptwin.host.planning.jobs.options import number
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.motions.following import follow
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.robot import Robot

POSES: Final = (
    (400.0, 0.0, 600.0, 0.0),
    (350.0, 150.0, 500.0, 0.0),
    (300.0, -250.0, 650.0, 0.0),
    (-200.0, 350.0, 550.0, 0.0),
    (480.0, 120.0, 700.0, 0.0),
)
"""Tool poses: x, y, z in mm and the attitude in degrees."""

_MIDDLE_MM: Final = 600.0
"""Height of the poses from which the others keep their distance in proportion to the sliders' stroke."""

OPERATING_MODE: Final = "(+,+)"


@dataclass(frozen=True, slots=True)
class FivePointsOptions:
    """The options: the pause at each pose."""

    pause_s: float = number(0.5, 0.001, 60.0, "s")


def five_points(robot: Robot, options: FivePointsOptions) -> Trajectory:
    """Return joint moves from the first pose to the fifth; raise InputError if a pose is out of reach."""
    order = np.arange(len(POSES), dtype=np.float64)
    first, *others = follow(robot, five_poses(robot), order, OPERATING_MODE, np.array(robot.home))
    moves = Composer(robot, first)
    moves.pause(options.pause_s)
    for joints in others:
        moves.go(joints)
        moves.pause(options.pause_s)
    return moves.sequence()


def five_poses(robot: Robot) -> FloatArray:
    """Return the poses, of shape (5, 4), which grow and move with the arm's dimensions."""
    grown, radial, vertical, rise_mm = hybrid_scale(robot)
    poses = np.array(POSES)
    radii_mm = np.hypot(poses[:, 0], poses[:, 1])
    poses[:, :2] *= (grown * (radial + (1.0 - radial) * HYBRID_RADIUS_MM / radii_mm))[:, np.newaxis]
    poses[:, 2] = _MIDDLE_MM + rise_mm + vertical * (poses[:, 2] - _MIDDLE_MM)
    return poses


FIVE_POINTS: Final = Job("five-points", "visit five tool poses with a pause at each", FivePointsOptions, five_points)
