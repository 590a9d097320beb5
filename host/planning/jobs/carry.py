"""The classroom robot carries a part from one taught point to another, all joints by one polynomial of time.

Source: X. Yao, Y. Pan, Y. Gao, "Research and Implementation of SCARA Manipulator Control Algorithm in Experimental
Teaching", 2017, DOI 10.3969/j.issn.1000-386x.2017.06.019: the points and the duration. Its text uses the cubic, its
figures probably show the quintic.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np

from steptwin.host.planning.jobs.fitting import fitted
from steptwin.host.planning.jobs.job import Job
from steptwin.host.planning.jobs.options import joint_position, number
from steptwin.host.planning.laws import Cubic, Law, Quintic
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.robot import Robot

START_RAD: Final = (-0.000062, 0.000178, 0.0, -0.000117)
GOAL_RAD: Final = (-0.522315, 1.504080, 0.0, -0.981765)
"""qa and qb of the paper: th1, th2, d3, th4, with d3 = 0; a joint with narrower limits stops at them."""


class Polynomial(Enum):
    """The kind of the time law."""

    CUBIC = "cubic"
    QUINTIC = "quintic"

    def lasting(self, duration_s: float) -> Law:
        """Return the law from 0 to 1."""
        return Cubic(1.0, duration_s) if self is Polynomial.CUBIC else Quintic(1.0, duration_s)


@dataclass(frozen=True, slots=True)
class CarryOptions:
    """The options: the time law, the depth at which a part is gripped and released, and the number of repetitions.

    With a depth of 0 the arm only goes from point to point, as in the paper's experiment. Otherwise it lowers the
    gripper at the start and closes it, and opens it at the goal.
    """

    law: Polynomial = Polynomial.CUBIC
    duration_s: float = number(1.0, 0.01, 60.0, "s")
    depth_mm: float = joint_position(0.0, "d3")
    repetitions: int = number(1, 1, 1000, "times")


def carry(robot: Robot, options: CarryOptions) -> Trajectory:
    """Return the motion from qa to qb, and back before each repetition; raise InputError if a gripper is missing."""
    start, goal = (fitted(robot, np.rad2deg(point)) for point in (START_RAD, GOAL_RAD))
    law = options.law.lasting(options.duration_s)
    moves = Composer(robot, start)
    for repetition in range(options.repetitions):
        if repetition:
            moves.go_by(law, start)
        _grip(moves, options.depth_mm, close=True)
        moves.go_by(law, goal)
        _grip(moves, options.depth_mm, close=False)
    return moves.sequence()


def _grip(moves: Composer, depth_mm: float, *, close: bool) -> None:
    up_mm = float(moves.joints[moves.robot.joint_names.index("d3")])
    if depth_mm:
        moves.go_some({"d3": depth_mm})
        moves.switch("gripper", on=close)
        moves.go_some({"d3": up_mm})


CARRY: Final = Job(
    "carry", "from one taught point to another, picking and placing if depth_mm is not 0", CarryOptions, carry
)
