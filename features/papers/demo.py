"""The calibration robot moves all joints at once, by a cubic of time.

Its paper (ICMEMTC 2016, Atlantis Press, from p. 918) has no experiment: the move is an assumption.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.features.papers.scaling import fitted
from steptwin.host.planning.jobs.job import Job
from steptwin.host.planning.jobs.options import number
from steptwin.host.planning.laws import Cubic
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.joint_move import joint_move
from steptwin.host.robots.robot import Robot

START: Final = (0.0, 0.0, 0.0, 0.0)
GOAL: Final = (60.0, -45.0, 100.0, 90.0)
"""th1, th2 in degrees, d3 in mm, th4 in degrees; limited to the joints' ranges."""


@dataclass(frozen=True, slots=True)
class DemoOptions:
    """Options of the demo."""

    duration_s: float = number(2.0, 0.01, 60.0, "s")


def demo(robot: Robot, options: DemoOptions) -> Motion:
    """Return the move; raise InputError if the duration is not a whole number of milliseconds."""
    start, goal = (tuple(fitted(robot, np.array(point)).tolist()) for point in (START, GOAL))
    return joint_move(robot.joint_names, start, goal, Cubic(1.0, options.duration_s))


DEMO: Final = Job("demo", "all joints at once by a cubic of time", DemoOptions, demo)
