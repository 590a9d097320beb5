"""The warehouse robot's slides, which a pose does not determine."""

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics import Branch
from tests.features.papers.mechanisms import WAREHOUSE


def right_of(*pose: float, near: FloatArray | None = None) -> Branch:
    return WAREHOUSE.kinematics.solve(np.array([pose]), "right", near)


def test_the_slides_shift_the_pose() -> None:
    joints = WAREHOUSE.random_joints(1000, seed=3)
    resting = joints.copy()
    resting[:, :2] = 0.0
    shift = np.column_stack([joints[:, 0], np.zeros(1000), joints[:, 1], np.zeros(1000)])
    expected = WAREHOUSE.kinematics.forward(resting) + shift
    assert np.abs(WAREHOUSE.kinematics.forward(joints) - expected).max() < 1e-9


def test_the_slides_stay_as_in_near() -> None:
    pose = (1275.0, 169.903810568, 560.0, 90.0)
    held = right_of(*pose, near=np.array([1000.0, 500.0, 77.0, 77.0, 77.0, 77.0]))
    assert held.joints[0] == pytest.approx([1000, 500, 100, 0, 60, 30], abs=1e-6)
    assert str(right_of(*pose).reason(0)).startswith("shoulder to wrist")  # with the slides at 0 it is reachable


def test_each_pose_has_its_own_slides() -> None:
    joints = WAREHOUSE.random_joints(1000, seed=4)
    poses = WAREHOUSE.kinematics.forward(joints)
    for branch in WAREHOUSE.kinematics.inverse(poses, joints):
        assert branch.joints[:, :2].tolist() == joints[:, :2].tolist()


def test_a_slide_held_beyond_its_limit() -> None:
    near = np.array([2001.0, 0, 100, 0, 60, 30])
    reason = right_of(2275.0, 169.903810568, 60.0, 90.0, near=near).reason(0)
    assert reason == "sx: 2001.0 mm is outside 0..2000 mm, by 1 mm"


def test_each_pose_has_its_own_reason() -> None:
    branch = WAREHOUSE.kinematics.solve(np.array([[275.0, 100, 60, 90], [500, 0, 60, 0], [275, 100, 0, 90]]), "right")
    assert branch.reachable.tolist() == [True, False, False]
    assert branch.reason(0) is None
    assert str(branch.reason(1)).startswith("shoulder to wrist")
    assert str(branch.reason(2)).startswith("L1")


def test_the_last_joint_reaches_every_angle() -> None:
    """It wraps into (-180, 180], since its limits are the whole circle."""
    poses = np.column_stack([np.tile([[275.0, 0.0, 60.0]], (361, 1)), np.arange(-180.0, 181.0)])
    branch = WAREHOUSE.kinematics.solve(poses, "right")
    reached = np.isfinite(branch.joints[:, 5])
    th3 = next(limit for limit in branch.limits if limit.quantity == "th3:")
    assert th3.kept[reached].all()
    assert np.all((branch.joints[reached, 5] > -180.0) & (branch.joints[reached, 5] <= 180.0))
