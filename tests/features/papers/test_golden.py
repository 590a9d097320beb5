"""Golden joints and poses, forward and inverse."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.features.papers.hybrid_arm import AssemblyMode
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.switches import JointSwitches
from tests.features.papers.golden import (
    BEYOND_TH1,
    CUBIC,
    FIVE_POINTS,
    QA_LEFT_RAD,
    QA_RAD,
    QB_LEFT_RAD,
    QB_RAD,
    STATIC,
    TABLES,
    Golden,
    Numbers,
    rows,
)
from tests.features.papers.mechanisms import BY_NAME, HYBRID, LAB, TEACHING, hybrid_arm


def identity(golden: Golden) -> str:
    return f"{golden.robot} {golden.branch} {golden.joints}"


@pytest.mark.parametrize("golden", STATIC, ids=identity)
def test_forward(golden: Golden) -> None:
    pose = BY_NAME[golden.robot].kinematics.forward(np.array([golden.joints]))[0]
    assert pose == pytest.approx(golden.pose, abs=1e-9)


@pytest.mark.parametrize("golden", [*TABLES, BEYOND_TH1], ids=identity)
def test_forward_of_rounded_joints(golden: Golden) -> None:
    """5e-10 degrees in each of two joints are 1.4e-8 mm at the end of the longest arm."""
    pose = BY_NAME[golden.robot].kinematics.forward(np.array([golden.joints]))[0]
    assert pose == pytest.approx(golden.pose, abs=1.5e-8)


@pytest.mark.parametrize("golden", [*STATIC, *TABLES], ids=identity)
def test_inverse(golden: Golden) -> None:
    kinematics = BY_NAME[golden.robot].kinematics
    branch = kinematics.solve(np.array([golden.pose]), golden.branch, near=np.array(golden.joints))
    assert branch.joints[0] == pytest.approx(golden.joints, abs=1e-6)
    assert branch.reason(0) is None


def test_a_pose_that_only_one_elbow_reaches() -> None:
    left = BY_NAME[BEYOND_TH1.robot].kinematics.solve(np.array([BEYOND_TH1.pose]), BEYOND_TH1.branch)
    assert left.joints[0] == pytest.approx(BEYOND_TH1.joints, abs=1e-6)
    assert left.reachable.tolist() == [False]
    assert left.reason(0) == "th1: -147.8 deg is outside -130..130 deg, by 17.8 deg"


@pytest.mark.parametrize(("lower_deg", "reachable"), [(-147.796, True), (-147.795, False)])
def test_the_limit_that_it_names_would_do(lower_deg: float, reachable: bool) -> None:
    robot = BY_NAME[BEYOND_TH1.robot].robot
    joints = tuple(
        replace(joint, lower=lower_deg, switches=JointSwitches(), homing=None) if joint.name == "th1" else joint
        for joint in robot.joints
    )
    left = make_kinematics(replace(robot, joints=joints)).solve(np.array([BEYOND_TH1.pose]), BEYOND_TH1.branch)
    assert left.reachable.tolist() == [reachable]


@pytest.mark.parametrize("row", rows(CUBIC))
def test_the_classroom_robots_cubic(row: Numbers) -> None:
    th1, th2, th4, x_mm, y_mm = row
    pose = TEACHING.kinematics.forward(np.array([[th1, th2, 0.0, th4]]))[0]
    assert pose == pytest.approx([x_mm, y_mm, -40.0, th1 + th2 + th4], abs=1.5e-8)


@pytest.mark.parametrize(("right_rad", "left_rad"), [(QA_RAD, QA_LEFT_RAD), (QB_RAD, QB_LEFT_RAD)], ids=["qa", "qb"])
def test_the_classroom_robots_points_by_both_elbows(right_rad: Numbers, left_rad: Numbers) -> None:
    """qa is 0.01 degrees from singular."""
    right_deg = np.insert(np.rad2deg(right_rad), 2, 0.0)
    left_deg = np.insert(np.rad2deg(left_rad), 2, 0.0)
    right, left = TEACHING.kinematics.inverse(TEACHING.kinematics.forward(right_deg[np.newaxis]))
    assert right.joints[0] == pytest.approx(right_deg, abs=1e-6)
    assert left.joints[0] == pytest.approx(left_deg, abs=1e-6)


@pytest.mark.parametrize(
    ("joints", "z2_mm", "z3_mm"),
    [
        ((0, 0, 0, 0), 0.0, 316.227766017),
        ((30, 50, -50, 10), 98.742088291, 296.226264872),
        ((-90, -200, -100, 45), -98.742088291, 146.226264872),
    ],
)
def test_the_hybrid_arms_platform(joints: Numbers, z2_mm: float, z3_mm: float) -> None:
    variables = HYBRID.kinematics.dh_variables(np.array([joints]))
    assert variables["z2"] == pytest.approx([z2_mm], abs=1e-9)
    assert variables["z3"] == pytest.approx([z3_mm], abs=1e-9)


@pytest.mark.parametrize("row", rows(FIVE_POINTS))
def test_the_pose_of_the_wrong_assembly_mode(row: Numbers) -> None:
    th1, *sliders_mm, rho_mm, z_mm = row[3:]
    pose = hybrid_arm().forward_as(np.array([[th1, *sliders_mm, -th1]]), AssemblyMode.BELOW)[0]
    assert np.hypot(pose[0], pose[1]) == pytest.approx(rho_mm, abs=1e-6)
    assert pose[2:] == pytest.approx([z_mm, 0.0], abs=1e-6)


def test_the_laboratory_robots_monte_carlo() -> None:
    """100 000 samples: all positions of the first joint are drawn first, then those of the second one, and so on."""
    generator = np.random.default_rng(1)
    joints = np.column_stack([generator.uniform(joint.lower, joint.upper, 100_000) for joint in LAB.robot.joints])
    poses = LAB.kinematics.forward(joints)
    radius_mm = np.hypot(poses[:, 0], poses[:, 1])
    assert [radius_mm.min(), radius_mm.max()] == pytest.approx([338.099917, 800.0], abs=1e-6)
