"""EAIK finds the branches of 1000 random poses of each arm, and no others: it shares no code with ours.

D. Ostermeier, J. Külz, M. Althoff, "Automatic geometric decomposition for analytical inverse kinematics", 2025.
"""

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.serial.chain_geometry import axes_of
from steptwin.host.robots.poses.rotations import angle_deg, matrix
from tests.features.arms.arms import arm, kinematics_of, random_joints

SAME_RAD = 1e-5
"""Largest difference of a joint by which two solutions are the same: near a singularity both are that far off."""
OTHER = {"ar4-mk3": 0, "parol6": 2, "thor": 0, "Dummy": 0}
"""Poses of which EAIK gives a least-squares solution instead: those of the PAROL6's elbow at the edge of its reach."""

hp = pytest.importorskip("eaik.IK_HP", reason="EAIK is not installed: no other inverse to compare the branches with")


def theirs(name: str, poses: FloatArray) -> list[FloatArray]:
    """EAIK's solutions, each of shape (branches, 6), in rad."""
    kinematics = kinematics_of(arm(name))
    axes = axes_of(kinematics.dh, arm(name).joint_names)
    points = np.vstack([np.zeros(3), axes.points_mm, axes.home_mm])
    robot = hp.HPRobot(axes.directions, np.diff(points, axis=0))
    found = []
    for pose in poses:
        target = np.eye(4)
        target[:3, :3], target[:3, 3] = matrix(pose[3:]) @ axes.home_rotation.T, pose[:3]
        solution = robot.IK(target)
        exact = ~np.array(solution.is_LS, dtype=bool)
        found.append(np.array(solution.Q)[exact].reshape(-1, 6))
    return found


@pytest.mark.parametrize("name", OTHER)
def test_every_branch_and_no_other(name: str) -> None:
    joints = random_joints(arm(name), 1000)
    kinematics = kinematics_of(arm(name))
    poses = kinematics.forward(joints)
    branches = kinematics.inverse(poses)
    ours = np.deg2rad(np.stack([branch.joints for branch in branches], axis=1))
    unlike = 0
    for pose, every, other in zip(poses, ours, theirs(name, poses), strict=True):
        own = every[np.isfinite(every).all(axis=1)]
        if len(own) != len(other):
            unlike += 1
            continue
        apart = np.abs((own[:, np.newaxis] - other + np.pi) % (2.0 * np.pi) - np.pi).max(axis=2)
        assert apart.min(axis=0).max() < SAME_RAD, pose
        assert apart.min(axis=1).max() < SAME_RAD, pose
    assert unlike <= OTHER[name]
    for branch in branches:
        solved = np.isfinite(branch.joints).all(axis=1)
        back = kinematics.forward(branch.joints[solved])
        assert np.linalg.norm(back[:, :3] - poses[solved, :3], axis=1).max() < 1e-9
        assert angle_deg(back[:, 3:], poses[solved, 3:]).max() < 1e-7


@pytest.mark.parametrize("name", OTHER)
def test_the_joints_themselves_are_among_them(name: str) -> None:
    joints = random_joints(arm(name), 1000, seed=2)
    kinematics = kinematics_of(arm(name))
    branches = kinematics.inverse(kinematics.forward(joints), joints)
    off = np.stack([np.abs(branch.joints - joints).max(axis=1) for branch in branches])
    assert np.nanmin(off, axis=0).max() < 1e-6
