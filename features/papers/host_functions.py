"""The classroom paper's functions for host programs: joints for a point, for each arm, with a flag each.

The paper has `robot_forward(theta) -> ok, point` and `robot_inverse(point, angle) -> left joints, left_in_workspace,
right joints, right_in_workspace`. They work for every SCARA with a lift and a tool that turns.

Source: X. Yao, Y. Pan, Y. Gao, "Research and Implementation of SCARA Manipulator Control Algorithm in Experimental
Teaching", 2017, DOI 10.3969/j.issn.1000-386x.2017.06.019.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics, within_limits
from steptwin.host.robots.robot import Robot

PAPERS_ROBOT: Final = "teaching-scara"


@dataclass(frozen=True, slots=True)
class ArmSolution:
    """One arm's joints for a point.

    Attributes:
        joints: positions in mm and degrees, in the robot's order; NaN where the point is out of reach.
        in_workspace: whether the arm reaches the point within all limits.
        reason: why it does not; None if it does.
    """

    joints: tuple[float, ...]
    in_workspace: bool
    reason: str | None


def forward(joints: Sequence[float], robot: Robot | None = None) -> tuple[bool, tuple[float, float, float, float]]:
    """Return whether joints, in mm and degrees, are within their limits, and the tool's x, y, z in mm and phi in deg.

    Raises:
        InputError: there are too few or too many joints.
    """
    robot = robot or load_robot(PAPERS_ROBOT)
    if len(joints) != len(robot.joints):
        raise InputError(f"joints: {len(joints)} values for the {len(robot.joints)} joints of {robot.name}")
    row = np.array([joints], dtype=np.float64)
    x_mm, y_mm, z_mm, phi_deg = make_kinematics(robot).forward(row)[0].tolist()
    return bool(within_limits(robot.joints, row)[0]), (x_mm, y_mm, z_mm, phi_deg)


def inverse(
    x_mm: float,
    y_mm: float,
    elbow: str,
    z_mm: float | None = None,
    phi_deg: float = 0.0,
    robot: Robot | None = None,
) -> ArmSolution:
    """Return the joints of one arm, `left` or `right`, for a point.

    Args:
        x_mm: x of the tool.
        y_mm: y of the tool.
        elbow: side of the elbow, seen from the shoulder along the line to the wrist.
        z_mm: height of the tool; by default its height at the robot's home.
        phi_deg: attitude of the tool.
        robot: another robot than the paper's.

    Raises:
        InputError: there is no such side.
    """
    robot = robot or load_robot(PAPERS_ROBOT)
    kinematics = make_kinematics(robot)
    if elbow not in kinematics.branches:
        raise unknown("elbow:", elbow, kinematics.branches)
    home = np.array(robot.home)
    height_mm = float(kinematics.forward(home[np.newaxis])[0, 2]) if z_mm is None else z_mm
    branch = kinematics.solve(np.array([[x_mm, y_mm, height_mm, phi_deg]]), elbow, home)
    return ArmSolution(tuple((branch.joints[0] + 0.0).tolist()), bool(branch.reachable[0]), branch.reason(0))
