"""The hybrid arm visits five tool poses, with a pause at each.

Source: H. Zhou, four-DOF hybrid handling robot; the paper's poses are lost, these are assumed.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

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

OPERATING_MODE: Final = "(+,+)"


@dataclass(frozen=True, slots=True)
class FivePointsOptions:
    """The options: the pause at each pose."""

    pause_s: float = number(0.5, 0.001, 60.0, "s")


def five_points(robot: Robot, options: FivePointsOptions) -> Trajectory:
    """Return joint moves from the first pose to the fifth; raise InputError if a pose is out of reach."""
    order = np.arange(len(POSES), dtype=np.float64)
    first, *others = follow(robot, np.array(POSES), order, OPERATING_MODE, np.array(robot.home))
    moves = Composer(robot, first)
    moves.pause(options.pause_s)
    for joints in others:
        moves.go(joints)
        moves.pause(options.pause_s)
    return moves.sequence()


FIVE_POINTS: Final = Job("five-points", "visit five tool poses with a pause at each", FivePointsOptions, five_points)
