"""The mechanisms for tests of all kinematics: the five robots, and the calibration robot with its tool up."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import pytest

from steptwin.features.papers.hybrid_arm import HybridArm
from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import Kinematics, Scara, make_kinematics
from steptwin.host.robots.robot import Robot
from tests.host.robots.kinematics.changed import with_geometry


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A robot with its kinematics.

    Attributes:
        name: Name for test ids.
        robot: The robot.
        kinematics: Kinematics under test.
        tool_down: True if the attitude is psi of R = Rz(psi) Rx(180), false if it is phi of R = Rz(phi).
        posture: Joints of the usual branch, far from every limit and singularity.
    """

    name: str
    robot: Robot
    kinematics: Kinematics
    tool_down: bool
    posture: tuple[float, ...]

    @property
    def scara(self) -> Scara:
        """Return a SCARA's kinematics, with the attributes that only a SCARA has."""
        if not isinstance(self.kinematics, Scara):
            raise TypeError(self.name)
        return self.kinematics

    def random_joints(self, count: int, seed: int) -> FloatArray:
        """Draw joints within the limits; the hybrid arm's only with the tool 250 to 550 mm from its waist."""
        lower = [joint.lower for joint in self.robot.joints]
        upper = [joint.upper for joint in self.robot.joints]
        joints = np.random.default_rng(seed).uniform(lower, upper, (3 * count, len(lower)))
        if isinstance(self.kinematics, HybridArm):
            poses = self.kinematics.forward(joints)
            joints = joints[np.abs(np.hypot(poses[:, 0], poses[:, 1]) - 400.0) < 150.0]
        return joints[:count]

    def placed(self, axis: int, position: float) -> FloatArray:
        """Return the posture, of shape (1, joints), with one joint moved; the two sliders move together."""
        joints = np.array([self.posture])
        if isinstance(self.kinematics, HybridArm) and axis in (1, 2):
            joints[:, 1:3] = 0.8 * position
        joints[0, axis] = position
        return joints

    def own_branch(self, joints: FloatArray) -> str:
        """Return the branch of a single row of joints."""
        if isinstance(self.kinematics, Scara):
            return "right" if joints[0, self.kinematics.elbow] >= 0 else "left"
        return "(+,+)"


def mechanism(name: str, tool_down: bool, *posture: float) -> Mechanism:
    """Return the mechanism of one of the five robots."""
    robot = load_robot(name)
    return Mechanism(name, robot, make_kinematics(robot), tool_down, posture)


def tool_up(calibration: Mechanism) -> Mechanism:
    """Return the calibration robot with its tool up."""
    robot = with_geometry(calibration.robot, alpha3_deg=0.0)
    return Mechanism(f"{calibration.name}-up", robot, make_kinematics(robot), False, calibration.posture)


LAB: Final = mechanism("lab-scara", True, 100.0, 20.0, 60.0, 10.0)
WAREHOUSE: Final = mechanism("warehouse-scara", False, 500.0, 300.0, 100.0, 10.0, 90.0, 20.0)
TEACHING: Final = mechanism("teaching-scara", False, 10.0, 60.0, 20.0, 15.0)
CALIBRATION: Final = mechanism("calibration-scara", True, 10.0, 60.0, 50.0, 15.0)
CALIBRATION_UP: Final = tool_up(CALIBRATION)
HYBRID: Final = mechanism("hybrid-arm", False, 20.0, 30.0, -10.0, 15.0)

SCARAS: Final = (LAB, WAREHOUSE, TEACHING, CALIBRATION, CALIBRATION_UP)
ALL: Final = (*SCARAS, HYBRID)
BY_NAME: Final = {each.name: each for each in ALL}

each_mechanism = pytest.mark.parametrize("mechanism", ALL, ids=lambda each: each.name)
each_scara = pytest.mark.parametrize("mechanism", SCARAS, ids=lambda each: each.name)


def hybrid_arm() -> HybridArm:
    """Return the hybrid arm's kinematics, with the methods that only it has."""
    arm = HYBRID.kinematics
    if not isinstance(arm, HybridArm):
        raise TypeError(HYBRID.name)
    return arm


def own_solutions(mechanism: Mechanism, joints: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the joints that the inverse finds for the joints' poses, each by its own branch, and whether reachable."""
    kinematics = mechanism.kinematics
    branches = kinematics.inverse(kinematics.forward(joints), joints)
    which = np.where(joints[:, kinematics.elbow] >= 0, 0, 1) if isinstance(kinematics, Scara) else 0
    rows = np.arange(len(joints))
    found = np.stack([branch.joints for branch in branches])[which, rows]
    return found, np.stack([branch.reachable for branch in branches])[which, rows]


def singularity_measure(kinematics: Kinematics, joints: FloatArray) -> FloatArray:
    """Return, of shape (n,), the distance of joints from the nearest singularity, from 0 to 1."""
    values = [constraint.values for constraint in kinematics.singularities(joints)]
    return np.asarray(np.minimum.reduce(values))
