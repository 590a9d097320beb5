"""Arms whose wrist's axes miss one point: their branches by name, held against solutions from random starts."""

import numpy as np
import pytest

from steptwin.features.arms.offset_wrist import MISS_PART_MAX
from steptwin.features.arms.spherical_wrist import NAMES
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import read_robot
from steptwin.host.robots.kinematics.base import Branch
from steptwin.host.robots.kinematics.serial.levenberg import PLACE_OFF_MM, TURN_OFF_DEG
from steptwin.host.robots.robot import Robot
from tests.features.arms.arms import (
    AR4_LIMITS,
    AR4_ROWS,
    chain_text,
    dh_entries,
    kinematics_of,
    random_joints,
    same_turn,
)

_X, _Y = "axis = [1, 0, 0]", "axis = [0, 1, 0]"
ARCTOS = {
    "J1": "xyz_mm = [0, 0.529, 111]",
    "J2": f"xyz_mm = [-57.13, -20.885, 178.378], {_X}",
    "J3": "xyz_mm = [100.13, 1.311, 261.007], axis = [-1, 0, 0]",
    "J4": f"xyz_mm = [-42.999, -139.695, 21.705], {_Y}",
    "J5": "xyz_mm = [-39.012, -121.187, -1.774], axis = [-1, 0, 0]",
    "J6": f"xyz_mm = [39.204, -33.835, 0], {_Y}",
}
"""Joint origins and axes of arctos_urdf.urdf (jetta18/ArctosGuiPython, commit 5407173), an export of Fusion."""
ARCTOS_LIMITS = ((-168, 168), (-51, 109), (-36, 83), (-168, 168), (-143, 143), (-168, 168))


def arctos() -> Robot:
    return read_robot(chain_text(ARCTOS, ARCTOS_LIMITS, "urdf"))


def offset_ar4(offset_mm: float) -> Robot:
    """The AR4 with axis 5 beside axis 4."""
    rows = list(AR4_ROWS)
    rows[4] = (0.0, 90.0, 0.0, offset_mm)
    return read_robot(chain_text(dh_entries(rows), AR4_LIMITS))


def solutions(branches: tuple[Branch, ...], row: int) -> FloatArray:
    """The joints of a pose that exist, shape (k, 6)."""
    every = np.stack([branch.joints[row] for branch in branches])
    return np.asarray(every[np.isfinite(every).all(axis=1)])


def test_a_few_poses_have_their_solutions_and_the_present_joints_among_them() -> None:
    """What `TestBranches` tries at length."""
    kinematics, joints = kinematics_of(arctos()), random_joints(arctos(), 20)
    poses = kinematics.forward(joints)
    branches = kinematics.inverse(poses, joints)
    assert kinematics.branches == NAMES
    assert np.nanmin([np.abs(branch.joints - joints).max(axis=1) for branch in branches], axis=0).max() < 1e-6
    for branch in branches:
        found = np.isfinite(branch.joints).all(axis=1)
        off = kinematics.forward(branch.joints[found]) - poses[found]
        assert np.linalg.norm(off[:, :3], axis=1).max(initial=0.0) <= PLACE_OFF_MM


@pytest.mark.slow
@pytest.mark.parametrize("robot", [arctos(), offset_ar4(1.774), offset_ar4(40.0)], ids=["Arctos", "1.8 mm", "40 mm"])
class TestBranches:
    def test_the_eight_names(self, robot: Robot) -> None:
        kinematics = kinematics_of(robot)
        assert kinematics.branches == NAMES
        assert not kinematics.has_closed_form
        assert kinematics.inverse_words.startswith("numeric, from the branches of an arm whose wrist's axes meet: ")

    def test_every_solution_has_its_pose(self, robot: Robot) -> None:
        kinematics, poses = kinematics_of(robot), kinematics_of(robot).forward(random_joints(robot, 300))
        for branch in kinematics.inverse(poses):
            found = np.isfinite(branch.joints).all(axis=1)
            assert np.array_equal(found, np.logical_and.reduce([each.kept for each in branch.mechanism]))
            back = kinematics.forward(branch.joints[found])
            assert np.linalg.norm((back - poses[found])[:, :3], axis=1).max() <= PLACE_OFF_MM
            assert kinematics.task.off_deg(back, poses[found]).max() <= TURN_OFF_DEG

    def test_the_present_joints_are_among_them(self, robot: Robot) -> None:
        """Of each pose, also near singularities, and on the branch that their own shape has."""
        kinematics, joints = kinematics_of(robot), random_joints(robot, 1000)
        off = [
            np.abs(branch.joints - joints).max(axis=1)
            for branch in kinematics.inverse(kinematics.forward(joints), joints)
        ]
        assert np.nanmin(off, axis=0).max() < 1e-6

    def test_from_afar_they_are_found_away_from_singularities(self, robot: Robot) -> None:
        kinematics, joints = kinematics_of(robot), random_joints(robot, 500)
        assert kinematics.neighbour is not None
        clear = np.min(kinematics.neighbour.measures(np.deg2rad(joints)), axis=0) > 0.2
        branches = kinematics.inverse(kinematics.forward(joints[clear]))
        off = [np.abs(same_turn(branch.joints - joints[clear])).max(axis=1) for branch in branches]
        assert clear.sum() > 100
        assert np.mean(np.nanmin(off, axis=0) < 1e-6) > 0.99

    def test_no_other_solutions_from_random_starts(self, robot: Robot) -> None:
        """48 random starts lead to no joints that have no name, and miss few that have one."""
        kinematics, joints = kinematics_of(robot), random_joints(robot, 40, seed=5)
        assert kinematics.neighbour is not None
        measures = np.min(kinematics.neighbour.measures(np.deg2rad(joints)), axis=0)
        joints = joints[measures > 0.2]
        poses = kinematics.forward(joints)
        branches, strange, named = kinematics.inverse(poses), 0, 0
        for row, pose in enumerate(poses):
            own = solutions(branches, row)
            numeric = kinematics.numeric
            others = numeric.solutions(pose, np.zeros(6), np.full(6, 1e9))
            apart = np.abs(same_turn(own[:, np.newaxis] - others)).max(axis=2)
            strange += int((apart.min(axis=0) > 1e-3).sum())
            named += len(own)
        assert len(poses) > 5
        assert named >= 4 * len(poses)
        assert strange <= 0.02 * named


def test_beyond_a_part_of_its_size_a_miss_leaves_no_names() -> None:
    """The AR4's rows are 802.4 mm and the miss together: 141 mm are 14.9 % of them, 143 mm 15.1 %."""
    size_mm = 169.77 + 64.2 + 305.0 + 222.63 + 41.0
    for miss_mm, names in ((141.0, 8), (143.0, 1)):
        assert (miss_mm / (size_mm + miss_mm) < MISS_PART_MAX) is (names == 8)
        assert len(kinematics_of(offset_ar4(miss_mm)).branches) == names


def test_out_of_reach() -> None:
    kinematics = kinematics_of(arctos())
    pose = np.array([[5000.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    for branch in kinematics.inverse(pose):
        assert np.isnan(branch.joints).all()
        assert str(branch.reason(0)).startswith("shoulder to wrist ")


@pytest.mark.slow
def test_one_branch_is_the_same_as_among_all() -> None:
    kinematics = kinematics_of(arctos())
    poses = kinematics.forward(random_joints(arctos(), 50))
    for branch in kinematics.inverse(poses):
        assert kinematics.solve(poses, branch.name).joints == pytest.approx(branch.joints, abs=1e-9, nan_ok=True) or (
            np.isnan(branch.joints).any()
        )


def test_on_a_path_it_is_told_where_the_branch_changes() -> None:
    """The wrist's bend goes through 0: no joint jumps, and the name changes there."""
    kinematics = kinematics_of(offset_ar4(0.1))
    assert kinematics.neighbour is not None
    joints = np.tile([0.0, 10.0, -20.0, 0.0, 0.0, 0.0], (401, 1))
    joints[:, 4] = np.linspace(20.0, -20.0, 401)
    solved = kinematics.along(kinematics.forward(joints), "front-up-noflip", joints[0])
    assert solved.name == "front-up-noflip"
    assert solved.joints == pytest.approx(joints, abs=1e-3)
    assert [name for _, name in solved.changes] == ["front-up-flip"]
    assert joints[solved.changes[0][0], 4] == pytest.approx(0.0, abs=0.5)
