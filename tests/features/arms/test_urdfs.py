"""The makers' published URDFs, multiplied out here by scipy's rotations, beside the robot files that StepTwin brings.

Sources: annin_ar4_description/urdf/ar_macro.xacro of ycheng517/ar4_ros_driver at ff1c63f with config/mk3.yaml;
parol6/urdf_model/urdf/PAROL6.urdf of PCrnjak/PAROL6-python-API at 829c2c7; thor.urdf.xacro of AngelLM/Thor-ROS
at e11a56b. Lengths there are in m.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import load_robot
from tests.features.arms.arms import kinematics_of, random_joints

Joint = tuple[Sequence[float], Sequence[float], Sequence[float]]
"""Origin's xyz and rpy, and the axis."""

PI: Final = np.pi
_Z, _BACK, _X = (0, 0, 1), (0, 0, -1), (1, 0, 0)
AR4: Final[tuple[Joint, ...]] = (
    ((0, 0, 0), (PI, 0, 0), _Z),
    ((0, 0.0642, -0.16977), (PI / 2, 0, -PI / 2), _BACK),
    ((0, -0.305, 0.007), (0, 0, PI), _BACK),
    ((0, 0, 0), (PI / 2, 0, -PI / 2), _BACK),
    ((0, 0, -0.22263), (PI, 0, -PI / 2), _X),
    ((0, 0, 0.041), (0, 0, PI), _Z),
)
"""With pi for 3.1416 and pi / 2 for 1.5708."""
PAROL6: Final[tuple[Joint, ...]] = (
    ((0, 0, 0.1105), (0, 0, 0), _Z),
    ((0.0234207210610375, 0, 0), (-1.5707963267949, 0, 0), _Z),
    ((0.18, 0, 0), (3.14159265358979, 0, 0), _Z),
    ((-0.0435, 0.17635, 0), (1.5707963267949, 0, 0), _Z),
    ((0, 0, 0), (-1.5707963267949, 0, 0), _Z),
    ((0, 0.037, 0), (1.5707963267949, 0, 0), _Z),
)
THOR: Final[tuple[Joint, ...]] = (
    ((0, 0, 0.099), (0, 0, 0), _Z),
    ((0, 0, 0.103), (0, 0, 0), _X),
    ((0, 0, 0.16), (0, 0, 0), _X),
    ((0, 0, 0.0895), (0, 0, 0), _Z),
    ((0, 0, 0.1045), (0, 0, 0), _X),
    ((0, 0, 0.0135), (0, 0, 0), _Z),
)
QUARTER: Final = Rotation.from_euler("z", 90, degrees=True)
"""The AR4's URDF is turned by it against the DH table, at its base and at its flange."""
OTHER_WAY: Final = np.array([-1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
"""Joint 1 of the AR4's URDF counts clockwise from above."""
GRIPPER_MM: Final = np.array([-45.25, 0.0, -25.8])
"""From flange L6 of the PAROL6's URDF to the end of its DH table, the gripper's tip, which is turned over about x."""


def flange(chain: Sequence[Joint], joints_deg: FloatArray) -> tuple[FloatArray, Rotation]:
    """The places of a URDF's last link in mm for joints of shape (n, 6), and how it is turned."""
    place, turned = np.zeros((len(joints_deg), 3)), Rotation.identity(len(joints_deg))
    for (xyz, rpy, axis), angles_deg in zip(chain, joints_deg.T, strict=True):
        place = place + turned.apply(1000.0 * np.array(xyz, dtype=float))
        turned = turned * Rotation.from_euler("xyz", rpy) * Rotation.from_rotvec(np.outer(angles_deg, axis), True)
    return place, turned


def apart(theirs: tuple[FloatArray, Rotation], poses: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How far poses of ours are from theirs, in mm and rad."""
    place, turned = theirs
    off_rad = np.asarray((turned.inv() * Rotation.from_quat(poses[:, 3:])).magnitude())
    return np.linalg.norm(place - poses[:, :3], axis=1), off_rad


@pytest.mark.parametrize("shift_mm", [0.0, 7.0])
def test_the_ar4_without_and_with_the_seven_mm(shift_mm: float) -> None:
    """Without the sideways 7 mm at joint 3 it is the DH table's arm; with them the tool is 7 mm elsewhere, always."""
    robot = load_robot("ar4-mk3")
    xyz, rpy, axis = AR4[2]
    chain = (*AR4[:2], ((*xyz[:2], shift_mm / 1000.0), rpy, axis), *AR4[3:])
    joints = random_joints(robot, 500)
    place, turned = flange(chain, OTHER_WAY * joints)
    off_mm, off_rad = apart((QUARTER.apply(place), QUARTER * turned * QUARTER), kinematics_of(robot).forward(joints))
    assert off_mm == pytest.approx(shift_mm, abs=1e-9)
    assert off_rad.max() < 1e-12


def test_the_parol6_up_to_its_gripper() -> None:
    """The URDF's 23.4207 mm are 23.42 mm in the DH table: 0.0007 mm, which its axes double."""
    robot = load_robot("parol6")
    joints = random_joints(robot, 500)
    place, turned = flange(PAROL6, joints)
    tip = place + turned.apply(GRIPPER_MM), turned * Rotation.from_euler("x", 180, degrees=True)
    off_mm, off_rad = apart(tip, kinematics_of(robot).forward(joints))
    assert 0.0006 < off_mm.max() < 0.0015
    assert off_rad.max() < 1e-12


def test_thor_up_to_its_gripper_s_base() -> None:
    robot = load_robot("thor")
    joints = random_joints(robot, 500)
    place, turned = flange(THOR, joints)
    tip = place + turned.apply([0.0, 0.0, 43.0]), turned
    off_mm, off_rad = apart(tip, kinematics_of(robot).forward(joints))
    assert off_mm.max() < 1e-9
    assert off_rad.max() < 1e-12
