"""The makers' numbers: stored poses, and the same tables multiplied out by Corke's toolbox."""

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import load_robot, read_robot
from steptwin.host.robots.poses.rotations import angle_deg, of_matrix, of_rotation_vector, of_rpy_deg
from steptwin.host.robots.robot import Robot
from tests.features.arms.arms import AR4_ROWS, DUMMY_ROWS, PAROL6_ROWS, TEXTS, arm, kinematics_of, random_joints

STORED = np.array([[-9.686, -8.991, 18.549, 7.965, 22.667, -6.458]])
"""Joints that AR4's hmi/defaults.json stores, beside the pose."""


@pytest.mark.parametrize("robot", [arm("AR4"), load_robot("ar4-mk3")], ids=["test's", "brought"])
def test_the_ar4s_stored_pose(robot: Robot) -> None:
    pose = kinematics_of(robot).forward(STORED)[0]
    assert pose[:3] == pytest.approx([267.292, -43.401, 412.343], abs=5e-4)
    assert angle_deg(pose[3:], of_rotation_vector(np.array([-1.927, 121.621, 9.454])[::-1])) < 2e-3
    assert angle_deg(pose[3:], of_rpy_deg(np.array([175.5, 57.9, 168.6]))) < 0.1


@pytest.mark.parametrize("name", ["PAROL6", "parol6"])
def test_the_parol6_at_its_stand_by_joints(name: str) -> None:
    """90 -90 180 0 0 180 deg: the upper arm upright, the forearm level along y, the gripper 45.25 mm below it."""
    pose = kinematics_of(arm(name)).forward(np.array([[90.0, -90.0, 180.0, 0.0, 0.0, 180.0]]))[0]
    assert pose[:3] == pytest.approx([0.0, 23.42 + 176.35 + 62.8, 110.5 + 180.0 + 43.5 - 45.25], abs=1e-9)


@pytest.mark.parametrize(
    ("name", "rows", "modified"),
    [
        ("AR4", AR4_ROWS, True),
        ("ar4-mk3", AR4_ROWS, True),
        ("PAROL6", PAROL6_ROWS, False),
        ("parol6", PAROL6_ROWS, False),
        ("Dummy", DUMMY_ROWS, False),
    ],
)
def test_against_the_toolbox(name: str, rows: tuple[tuple[float, ...], ...], modified: bool) -> None:
    toolbox = pytest.importorskip("roboticstoolbox")
    revolute = toolbox.RevoluteMDH if modified else toolbox.RevoluteDH
    links = [revolute(d=d, a=a, alpha=np.deg2rad(al), offset=np.deg2rad(th)) for th, al, d, a in rows]
    joints = random_joints(arm(name), 200)
    theirs: FloatArray = np.array(toolbox.DHRobot(links).fkine(np.deg2rad(joints)).A)
    ours = kinematics_of(arm(name)).forward(joints)
    assert ours[:, :3] == pytest.approx(theirs[:, :3, 3], abs=1e-9)
    assert angle_deg(ours[:, 3:], of_matrix(theirs[:, :3, :3])).max() < 1e-12


@pytest.mark.parametrize(("name", "height_mm"), [("Thor", 569.5), ("thor", 612.5)])
def test_thor_stretched_straight_up(name: str, height_mm: float) -> None:
    """Up to its flange, and up to the base of its gripper."""
    pose = kinematics_of(arm(name)).forward(np.zeros((1, 6)))[0]
    assert pose == pytest.approx([0.0, 0.0, height_mm, 0.0, 0.0, 0.0, 1.0])


def test_thors_wrist_is_moved_as_its_maker_moves_it() -> None:
    """thor_interface.cpp: motors at art5 + 2 art6 and -art5 + 2 art6, in degrees, with art5 = -J5."""
    robot = load_robot("thor")
    joints = random_joints(robot, 20)
    axes = robot.coupling.to_axes(joints)
    art5, art6 = -joints[:, 4], joints[:, 5]
    assert robot.axis_names == ("J1", "J2", "J3", "J4", "J5", "J6", "J2b")
    assert axes[:, 5] == pytest.approx(art5 + 2.0 * art6)
    assert axes[:, 4] == pytest.approx(-art5 + 2.0 * art6)
    assert axes[:, 6] == pytest.approx(joints[:, 1])


def test_frames_at_both_ends() -> None:
    """The base turned over hangs the arm from the ceiling; the tool is longer by its frame."""
    ends = (
        "base = { xyz_mm = [100, 0, 900], rpy_deg = [180, 0, 0] }\ntool = { xyz_mm = [0, 0, 50], rpy_deg = [0, 90, 0] }"
    )
    for notation in ("modified-dh", "standard-dh"):
        text = TEXTS["AR4" if notation == "modified-dh" else "PAROL6"]
        plain, turned = read_robot(text), read_robot(text.replace('-dh"\n', f'-dh"\n{ends}\n'))
        joints = random_joints(plain, 50)
        before = kinematics_of(plain).dh.transforms(kinematics_of(plain).dh_variables(joints))
        after = kinematics_of(turned).dh.transforms(kinematics_of(turned).dh_variables(joints))
        base, tool = (
            np.diag([1.0, -1.0, -1.0, 1.0]),
            np.array([[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 50.0], [0, 0, 0, 1]]),
        )
        base[:3, 3] = [100.0, 0.0, 900.0]
        assert after == pytest.approx(base @ before @ tool, abs=1e-9)
