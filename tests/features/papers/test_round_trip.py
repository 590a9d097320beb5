"""Inverse and forward undo each other, on random poses of every mechanism, by every branch."""

import numpy as np
import pytest

from steptwin.features.papers.hybrid_arm import AssemblyMode, HybridArm, WorkingMode
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics import Branch
from tests.features.papers.mechanisms import (
    ALL,
    HYBRID,
    Mechanism,
    each_mechanism,
    each_scara,
    hybrid_arm,
    own_solutions,
    singularity_measure,
)
from tests.host.robots.kinematics.changed import pose_errors

POSES = 10_000


def platform_mm(poses: FloatArray) -> FloatArray:
    """Return the hybrid arm's z2."""
    return np.asarray(np.hypot(poses[:, 0], poses[:, 1]) - 400.0)


def is_above(poses: FloatArray, mode: WorkingMode) -> FloatArray:
    """Return +1 or -1: in mixed modes the platform is above the sliders' line on the side of the lower slider."""
    left, right = mode.signs
    return np.full(len(poses), float(left)) if left == right else right * np.sign(platform_mm(poses))


def taken(mechanism: Mechanism, poses: FloatArray, branch: Branch) -> FloatArray:
    """Return the poses of a branch's joints; the hybrid arm's in the assembly mode of the branch at each pose."""
    arm = mechanism.kinematics
    if not isinstance(arm, HybridArm):
        return arm.forward(branch.joints)
    above, below = (arm.forward_as(branch.joints, mode) for mode in AssemblyMode)
    return np.where(is_above(poses, WorkingMode(branch.name))[:, np.newaxis] > 0, above, below)


@pytest.mark.parametrize(
    ("mechanism", "name"),
    [pytest.param(each, name, id=f"{each.name} {name}") for each in ALL for name in each.kinematics.branches],
)
def test_forward_undoes_inverse(mechanism: Mechanism, name: str) -> None:
    """The hybrid arm's mixed modes are singular at z2 = 0, where rounding errors grow without bound."""
    joints = mechanism.random_joints(POSES + 200, seed=4)
    poses = mechanism.kinematics.forward(joints)
    if name in ("(+,-)", "(-,+)"):
        joints, poses = joints[np.abs(platform_mm(poses)) > 1.0], poses[np.abs(platform_mm(poses)) > 1.0]
    branch = mechanism.kinematics.solve(poses, name, near=joints)
    assert len(poses) >= POSES
    assert pose_errors(taken(mechanism, poses, branch), poses).max() < 1e-9


@each_mechanism
def test_each_pose_is_found_again_by_its_own_branch(mechanism: Mechanism) -> None:
    """Rounding errors grow near a singularity; multiplied by its measure they are bounded."""
    joints = mechanism.random_joints(POSES, seed=5)
    found, reachable = own_solutions(mechanism, joints)
    assert len(joints) == POSES
    assert np.all(reachable)
    errors = np.abs(found - joints).max(axis=1)
    assert np.all(errors * singularity_measure(mechanism.kinematics, joints) < 1e-9)


@each_mechanism
def test_an_attitude_is_in_one_circle(mechanism: Mechanism) -> None:
    """Attitudes are in (-180, 180] for every turn of the tool; the postures' attitudes are exact."""
    attitudes = mechanism.kinematics.forward(mechanism.random_joints(1000, seed=9))[:, 3]
    assert np.all((attitudes > -180.0) & (attitudes <= 180.0))
    tool = 5 if mechanism.name == "warehouse-scara" else 3
    turning = -1 if mechanism.tool_down else 1
    at_zero_deg = mechanism.kinematics.forward(mechanism.placed(tool, 0.0))[0, 3]
    for half_turn_deg in (-180.0, 180.0):
        joints = mechanism.placed(tool, turning * (half_turn_deg - at_zero_deg))
        assert mechanism.kinematics.forward(joints)[0, 3] == 180.0


@each_mechanism
def test_all_branches_are_solved_at_once_as_one_by_one(mechanism: Mechanism) -> None:
    joints = mechanism.random_joints(100, seed=6)
    poses = mechanism.kinematics.forward(joints)
    branches = mechanism.kinematics.inverse(poses, joints)
    assert tuple(branch.name for branch in branches) == mechanism.kinematics.branches
    for branch in branches:
        alone = mechanism.kinematics.solve(poses, branch.name, joints)
        assert alone.joints.tolist() == branch.joints.tolist()


@each_scara
def test_the_elbow_bends_as_its_branch_says(mechanism: Mechanism) -> None:
    joints = mechanism.random_joints(1000, seed=7)
    right, left = mechanism.kinematics.inverse(mechanism.kinematics.forward(joints), joints)
    elbow = mechanism.scara.elbow
    assert np.all(right.joints[:, elbow] >= 0)
    assert left.joints[:, elbow].tolist() == (-right.joints[:, elbow]).tolist()


@pytest.mark.parametrize("mode", WorkingMode)
def test_the_hybrid_arm_reaches_a_pose_in_its_own_assembly_mode_only(mode: WorkingMode) -> None:
    poses = HYBRID.kinematics.forward(HYBRID.random_joints(1000, seed=8))
    branch = HYBRID.kinematics.solve(poses, mode.value)
    assembly = branch.mechanism[1]
    assert assembly.values.tolist() == is_above(poses, mode).tolist()
    assert assembly.kept.tolist() == (is_above(poses, mode) > 0).tolist()


def test_the_reason_for_the_wrong_assembly_mode() -> None:
    branch = hybrid_arm().solve(np.array([[400.0, 0.0, 600.0, 0.0]]), "(-,-)")
    words = "the machine is assembled with its platform above its sliders' line; this takes it to the other side"
    assert branch.reason(0) == words


@each_mechanism
def test_only_the_turning_joint_changes_with_the_attitude(mechanism: Mechanism) -> None:
    """By not a bit do other joints and the mechanism's constraints; the warehouse's tool is beside the wrist's axis."""
    arm, turning = mechanism.kinematics, mechanism.kinematics.turning
    assert (turning is None) == (mechanism.name == "warehouse-scara")
    if turning is None:
        return
    poses = arm.forward(mechanism.random_joints(500, seed=11))
    for branch, turned in zip(arm.inverse(poses), arm.inverse(poses + np.array([0.0, 0.0, 0.0, 77.0])), strict=True):
        changed = ~((branch.joints == turned.joints) | np.isnan(branch.joints)).all(axis=0)
        assert np.flatnonzero(changed).tolist() == [turning]
        assert np.array_equal(branch.reachable_but_for(turning), turned.reachable_but_for(turning))
