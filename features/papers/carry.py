"""The classroom robot carries a part between two points, all joints by one polynomial of time.

The points are the paper's presets, qa and qb, or a user's x and y.

Source: X. Yao, Y. Pan, Y. Gao, "Research and Implementation of SCARA Manipulator Control Algorithm in Experimental
Teaching", 2017, DOI 10.3969/j.issn.1000-386x.2017.06.019: the points, the duration and the cubic of its simulation. In
its test of the real arm the acceleration is also 0 at both ends, as in the quintic.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np

from steptwin.features.papers.scaling import fitted, with_elbow
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs.job import Job
from steptwin.host.planning.jobs.options import Point, joint_position, number, point
from steptwin.host.planning.laws import Cubic, Law, Quintic
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.robots.kinematics import Elbow, make_kinematics
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.workspace.nearest_pose import passing_text

START_RAD: Final = (-0.000062, 0.000178, 0.0, -0.000117)
GOAL_RAD: Final = (-0.522315, 1.504080, 0.0, -0.981765)
"""qa and qb, the paper's preset points: th1, th2, d3, th4, with d3 = 0; limited to the joints' ranges."""


KIND: Final = "teaching-scara"
"""Kind of mechanism with this job."""
START: Final = "qa"
GOAL: Final = "qb"
"""Names of the presets in options, and of spots with parts."""


class Polynomial(Enum):
    """The kind of the time law."""

    CUBIC = "cubic"
    QUINTIC = "quintic"

    def lasting(self, duration_s: float) -> Law:
        """Return the law from 0 to 1."""
        return Cubic(1.0, duration_s) if self is Polynomial.CUBIC else Quintic(1.0, duration_s)


@dataclass(frozen=True, slots=True)
class CarryOptions:
    """Options: both points, the elbow's side, the time law, the depth of the grip and the number of repetitions.

    The cubic is the law of the paper's simulation; the quintic has zero acceleration at both ends, as its test. A given
    point has the presets' lift and attitude 0. With a depth of 0 the arm only moves between the points, as in the
    paper's experiment. Otherwise it lowers the gripper at the start and closes it, and opens it at the goal.
    """

    from_: Point = point(START)
    to: Point = point(GOAL)
    elbow: Elbow = Elbow.RIGHT
    law: Polynomial = Polynomial.CUBIC
    duration_s: float = number(1.0, 0.01, 60.0, "s")
    depth_mm: float = joint_position(0.0, "d3")
    repetitions: int = number(1, 1, 1000, "times")


def carry(robot: Robot, options: CarryOptions) -> Motion:
    """Return the motion from point to point, and back before each repetition.

    Raises:
        InputError: a point is out of reach with this elbow, or the robot has no gripper.
    """
    start = _joints(robot, "from", options.from_, START_RAD, options.elbow)
    goal = _joints(robot, "to", options.to, GOAL_RAD, options.elbow)
    law = options.law.lasting(options.duration_s)
    moves = Composer(robot, start)
    for repetition in range(options.repetitions):
        if repetition:
            moves.go_by(law, start)
        _grip(moves, options.depth_mm, close=True)
        moves.go_by(law, goal)
        _grip(moves, options.depth_mm, close=False)
    return moves.sequence()


def _joints(robot: Robot, name: str, place: Point, preset_rad: tuple[float, ...], elbow: Elbow) -> FloatArray:
    """Return the joints, of shape (4,), at a point or at its preset."""
    preset = fitted(robot, np.rad2deg(preset_rad))
    if place is None:
        return preset if elbow is Elbow.RIGHT else with_elbow(robot, preset, elbow)
    kinematics = make_kinematics(robot)
    x_mm, y_mm = place
    pose = (x_mm, y_mm, float(kinematics.forward(preset[np.newaxis])[0, 2]), 0.0)
    branches = {branch.name: branch for branch in kinematics.inverse(np.array([pose]), preset)}
    found = branches.pop(elbow.value)
    if found.reachable[0]:
        joints: FloatArray = found.joints[0]
        return joints
    other = next((branch.name for branch in branches.values() if branch.reachable[0]), None)
    passing = f"; elbow={other} reaches it" if other else passing_text(robot, pose, preset, elbow.value)
    raise InputError(f"option {name}: {x_mm:g},{y_mm:g} is out of reach: {found.reason(0)}{passing}")


def _grip(moves: Composer, depth_mm: float, *, close: bool) -> None:
    up_mm = float(moves.joints[moves.robot.joint_names.index("d3")])
    if depth_mm:
        moves.go_some({"d3": depth_mm})
        moves.switch("gripper", on=close)
        moves.go_some({"d3": up_mm})


CARRY: Final = Job("carry", "from one point to another, picking and placing if depth_mm is not 0", CarryOptions, carry)
