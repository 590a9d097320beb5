"""The hybrid arm visits five tool poses on its helix, with a pause at each.

Source: H. Zhou, four-DOF hybrid handling robot. Its five poses are lost; since it compares them with the simulation of
the helix, they lie on the helix here: after every fifth of its way.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs.helix import OPERATING_MODE, HelixCurve, helix_poses
from steptwin.host.planning.jobs.job import Job
from steptwin.host.planning.jobs.options import number, parse_options
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.motions.following import follow
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.robot import Robot

POINTS: Final = 5


@dataclass(frozen=True, slots=True)
class FivePointsOptions(HelixCurve):
    """The options: the helix and the pause at each pose."""

    pause_s: float = number(0.5, 0.001, 60.0, "s")


def five_points(robot: Robot, options: FivePointsOptions) -> Trajectory:
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
