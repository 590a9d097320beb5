"""The names of branches follow from the arm's shape, and singular cases have the solutions that they should have."""

import numpy as np
import pytest

from steptwin.features.arms.spherical_wrist import NAMES
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.poses.rotations import angle_deg
from tests.features.arms.arms import TEXTS, arm, kinematics_of, random_joints


@pytest.mark.parametrize("name", TEXTS)
def test_the_eight_names_differ_and_keep_the_shape(name: str) -> None:
    """Each pose's solution under a name is on that branch by its own joints, and all eight differ."""
    kinematics = kinematics_of(arm(name))
    assert kinematics.branches == NAMES
    assert kinematics.form is not None
    branches = kinematics.inverse(kinematics.forward(random_joints(arm(name), 300)))
    whole = np.flatnonzero(np.all([np.isfinite(branch.joints).all(axis=1) for branch in branches], axis=0))
    assert whole.size > 150
    for row in whole:
        shapes = [kinematics.form.name_of(np.deg2rad(branch.joints[row])) for branch in branches]
        assert shapes == list(NAMES)


def test_the_ar4_at_rest_is_in_front_with_its_elbow_up() -> None:
    kinematics = kinematics_of(arm("AR4"))
    assert kinematics.form is not None
    for joints, name in (
        ([0, 0, 0, 0, 45, 0], "front-up-noflip"),
        ([0, 0, 0, 0, -45, 0], "front-up-flip"),
        ([90, 0, 0, 0, 45, 0], "front-up-noflip"),
        ([0, -42, -70, 0, 45, 0], "rear-down-noflip"),
        ([170, -15, -172, 7, -24, 174], "rear-up-flip"),
        ([0, 75, 161, 7, -20, 7], "front-down-flip"),
    ):
        assert kinematics.form.name_of(np.deg2rad(np.array(joints, dtype=float))) == name


def reached(name: str, pose: FloatArray, near: FloatArray) -> int:
    """The number of branches whose joints all exist; each must lead back to the pose."""
    kinematics = kinematics_of(arm(name))
    count = 0
    for branch in kinematics.inverse(pose, near):
        if np.isfinite(branch.joints).all():
            back = kinematics.forward(branch.joints)
            assert np.linalg.norm(back[0, :3] - pose[0, :3]) < 1e-8
            assert angle_deg(back[0, 3:], pose[0, 3:]) < 1e-6
            count += 1
    return count


class TestSingular:
    def test_stretched_wrist(self) -> None:
        """q5 = 0: q4 stays where the arm stands, and q6 makes up for it."""
        kinematics = kinematics_of(arm("AR4"))
        joints = np.array([[10.0, -9.0, 18.0, 25.0, 0.0, 15.0]])
        near = np.array([0.0, 0.0, 0.0, 77.0, 0.0, 0.0])
        assert reached("AR4", kinematics.forward(joints), near) == 8
        solved = kinematics.solve(kinematics.forward(joints), "front-up-noflip", near).joints[0]
        assert solved == pytest.approx([10.0, -9.0, 18.0, 77.0, 0.0, -37.0], abs=1e-9)

    def test_stretched_elbow(self) -> None:
        """The forearm in line with the upper arm: the elbow's two branches are one."""
        kinematics = kinematics_of(arm("AR4"))
        joints = np.array([[10.0, 20.0, 0.0, 25.0, 40.0, 15.0]])
        assert kinematics.form is not None
        upper, fore = kinematics.form.lengths_mm
        joints[0, 2] = np.rad2deg(kinematics.form._elbow_rad)  # noqa: SLF001
        pose = kinematics.forward(joints)
        assert (upper, fore) == pytest.approx((305.0, 222.63))
        up, down = (kinematics.solve(pose, f"front-{elbow}-noflip").joints[0] for elbow in ("up", "down"))
        assert up == pytest.approx(down, abs=1e-5)
        assert kinematics.singularities(joints)[1].values[0] == pytest.approx(0.0, abs=1e-9)

    def test_wrist_on_axis_1(self) -> None:
        """A wrist above the base's axis can be reached from all sides: q1 stays where the arm stands."""
        kinematics = kinematics_of(arm("Thor"))
        joints = np.array([[30.0, 40.0, 0.0, 10.0, 20.0, 5.0]])
        upper, fore = 160.0, 194.0
        bend = -40.0 - np.rad2deg(np.arcsin(upper * np.sin(np.deg2rad(40.0)) / fore))
        joints[0, 2] = bend
        near = np.array([30.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        pose = kinematics.forward(joints)
        assert kinematics.singularities(joints)[0].values[0] == pytest.approx(0.0, abs=1e-9)
        solved = [branch.joints[0] for branch in kinematics.inverse(pose, near)]
        assert min(np.abs(each - joints[0]).max() for each in solved if np.isfinite(each).all()) < 1e-6

    @pytest.mark.parametrize("name", TEXTS)
    def test_no_branch_out_of_reach_has_joints(self, name: str) -> None:
        kinematics = kinematics_of(arm(name))
        pose = np.array([[5000.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
        for branch in kinematics.inverse(pose):
            assert np.isnan(branch.joints).all()
            assert not branch.reachable[0]
            assert str(branch.reason(0)).startswith("shoulder to wrist ")


def test_turns_beyond_a_circle() -> None:
    """The Dummy's sixth joint has four turns: it takes the one nearest to where it stands."""
    kinematics = kinematics_of(arm("Dummy"))
    joints = np.array([[10.0, 20.0, 100.0, 25.0, 40.0, 15.0]])
    for turns in (-1, 0, 1):
        near = joints[0] + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 360.0 * turns])
        found = kinematics.inverse(kinematics.forward(joints), near)
        assert min(np.abs(branch.joints[0] - near).max() for branch in found) < 1e-9


def test_limits_are_the_reason() -> None:
    kinematics = kinematics_of(arm("AR4"))
    pose = kinematics.forward(np.array([[-9.686, -8.991, 18.549, 7.965, 22.667, -6.458]]))
    reasons = {branch.name: branch.reason(0) for branch in kinematics.inverse(pose)}
    assert reasons["front-up-noflip"] is None
    assert reasons["front-down-noflip"] == "J3: 161.5 deg is outside -89..52 deg, by 110 deg"
