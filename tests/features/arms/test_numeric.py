"""The inverse of chains without a closed form: from near joints, from anywhere, and why there is none."""

import numpy as np
import pytest

from steptwin.features.arms.spherical_wrist import NAMES
from steptwin.host.robots import read_robot
from steptwin.host.robots.kinematics.base import joint_constraints
from steptwin.host.robots.kinematics.serial.levenberg import PLACE_OFF_MM, TURN_OFF_DEG, Found, NumericInverse
from steptwin.host.robots.kinematics.serial.serial_chain import NEAREST, SerialChain
from steptwin.host.robots.poses.base_frame import BaseFrame
from steptwin.host.robots.robot import Robot
from tests.features.arms.arms import AR4_LIMITS, AR4_ROWS, arm, chain_text, dh_entries, kinematics_of, random_joints

SPREAD_DEG = 3.0
"""Standard deviation of a near start."""


def five_axes() -> Robot:
    """The AR4 without its last joint, the shape of the Moveo: its tool is told a direction."""
    more = "tool = { xyz_mm = [0, 41, 0], rpy_deg = [-90, 0, 0] }"
    return read_robot(chain_text(dh_entries(AR4_ROWS[:5]), AR4_LIMITS[:5], more=more))


def missing_wrist() -> Robot:
    """The AR4 with axis 5 beside axis 4: no closed form."""
    rows = list(AR4_ROWS)
    rows[4] = (0.0, 90.0, 0.0, 1.774)
    return read_robot(chain_text(dh_entries(rows), AR4_LIMITS))


def three_joints() -> Robot:
    return read_robot(chain_text(dh_entries(AR4_ROWS[:3]), AR4_LIMITS[:3], more="tool = { xyz_mm = [200, 0, 0] }"))


def sliding() -> Robot:
    """A slide, then two joints."""
    rows = {
        "L": "slides = true, theta_deg = 0.0, alpha_deg = 0.0, d_mm = 100.0, a_mm = 0.0",
        "A": "theta_deg = 0.0, alpha_deg = 0.0, d_mm = 0.0, a_mm = 50.0",
        "B": "theta_deg = 0.0, alpha_deg = 90.0, d_mm = 0.0, a_mm = 200.0",
    }
    more = "tool = { xyz_mm = [150, 0, 0] }"
    return read_robot(chain_text(rows, [(0.0, 200.0), (-90.0, 90.0), (10.0, 90.0)], more=more))


@pytest.mark.parametrize("make", [five_axes, missing_wrist, three_joints, sliding])
def test_from_a_near_start(make) -> None:  # type: ignore[no-untyped-def]
    """At least 99 % are solved, whatever the chain; and those to the tolerance."""
    robot = make()
    kinematics, joints = kinematics_of(robot), random_joints(robot, 1000)
    assert kinematics.branches == (NAMES if make is missing_wrist else (NEAREST,))
    poses = kinematics.forward(joints)
    start = joints + np.random.default_rng(3).normal(0.0, SPREAD_DEG, joints.shape)
    found = kinematics.numeric.near(poses, start)
    assert found.solved.mean() >= 0.99
    back = kinematics.forward(found.joints[found.solved])
    assert np.linalg.norm((back - poses[found.solved])[:, :3], axis=1).max() <= PLACE_OFF_MM
    assert kinematics.task.off_deg(back, poses[found.solved]).max() <= TURN_OFF_DEG


@pytest.mark.parametrize("name", ["AR4", "PAROL6"])
def test_the_numeric_inverse_of_arms_with_a_closed_form(name: str) -> None:
    joints = random_joints(arm(name), 1000)
    kinematics = kinematics_of(arm(name))
    start = joints + np.random.default_rng(3).normal(0.0, SPREAD_DEG, joints.shape)
    assert kinematics.numeric.near(kinematics.forward(joints), start).solved.mean() >= 0.99


@pytest.mark.slow
@pytest.mark.parametrize("make", [five_axes, missing_wrist, three_joints, sliding])
def test_from_anywhere(make) -> None:  # type: ignore[no-untyped-def]
    robot = make()
    kinematics, joints = kinematics_of(robot), random_joints(robot, 100)
    home = np.tile(robot.home, (100, 1))
    assert kinematics.numeric.anywhere(kinematics.forward(joints), home).solved.all()


def test_the_tasks_of_few_joints() -> None:
    assert [kinematics_of(make()).task.name for make in (five_axes, missing_wrist, three_joints)] == [
        "direction",
        "pose",
        "position",
    ]


def test_why_it_is_numeric() -> None:
    assert kinematics_of(missing_wrist()).inverse_words == (
        "numeric, from the branches of an arm whose wrist's axes meet: axes 4, 5 and 6 miss one point by 1.77 mm"
    )
    assert kinematics_of(five_axes()).inverse_words.endswith("the tool is told a direction")
    assert kinematics_of(arm("AR4")).inverse_words.startswith("in closed form")


@pytest.mark.slow
def test_out_of_reach_says_by_how_much() -> None:
    kinematics = kinematics_of(three_joints())
    pose = kinematics.forward(np.array([[0.0, 0.0, 0.0]])) + np.array([1000.0, 0.0, 0.0])
    solved = kinematics.solve(pose, NEAREST, np.zeros(3))
    assert not solved.reachable[0]
    reason = str(solved.reason(0))
    assert reason.startswith("no joints found for it: the nearest ones miss it by ")
    assert reason.endswith(" mm")


def test_velocities_are_differences() -> None:
    for robot in (five_axes(), missing_wrist(), arm("AR4"), three_joints(), sliding()):
        kinematics, joints = kinematics_of(robot), random_joints(robot, 50, seed=4)
        rates = np.random.default_rng(5).uniform(-10.0, 10.0, joints.shape)
        step_s = 1e-5
        before, after = (kinematics.forward(joints + sign * step_s * rates) for sign in (-1, 1))
        tool = np.zeros((50, kinematics.task.rates))
        tool[:, :3] = (after - before)[:, :3] / (2 * step_s)
        if not kinematics.task.is_flat:
            turns = [kinematics.task.turn_between_deg(a[3:], b[3:]) for a, b in zip(before, after, strict=True)]
            tool[:, 3:] = np.array(turns) / (2 * step_s)
        regular = np.all([each.kept for each in kinematics.singularities(joints)], axis=0)
        found = kinematics.joint_velocities(joints, tool)
        assert found[regular] == pytest.approx(rates[regular], abs=2e-2)


def test_a_joint_that_is_held_stays() -> None:
    """An AR4 on a slide: seven joints, the slide stays where it stands."""
    rows = {"S": "slides = true, theta_deg = 90.0, alpha_deg = 90.0, d_mm = 0.0, a_mm = 0.0", **dh_entries(AR4_ROWS)}
    robot = read_robot(chain_text(rows, [(-500.0, 500.0), *AR4_LIMITS], more='held = ["S"]'))
    kinematics, joints = kinematics_of(robot), random_joints(robot, 200)
    assert kinematics.has_closed_form
    off = [np.abs(each.joints - joints).max(axis=1) for each in kinematics.inverse(kinematics.forward(joints), joints)]
    assert np.nanmin(off, axis=0).max() < 1e-6
    limits = joint_constraints(robot.joints, joints)
    assert np.all([each.kept for each in limits])


def test_a_random_start_counts_if_place_and_turn_together_are_nearer(monkeypatch: pytest.MonkeyPatch) -> None:
    """The near start has the place exactly, but is turned by 90 degrees; the random one has both within tolerance."""
    first, second = np.zeros((1, 6)), np.ones((1, 6))
    turned = Found(first, np.zeros(1), np.array([90.0]))
    results = iter((turned, Found(second, np.array([PLACE_OFF_MM / 2]), np.zeros(1))))
    monkeypatch.setattr(NumericInverse, "near", lambda *_: next(results))
    found = kinematics_of(missing_wrist()).numeric.anywhere(np.zeros((1, 7)), first)
    assert found.solved.all()
    assert found.joints.tolist() == second.tolist()


def test_the_opposite_direction_is_not_the_direction() -> None:
    """Told to point backwards, the tool is half a turn off, not at the goal."""
    robot = five_axes()
    kinematics, joints = kinematics_of(robot), random_joints(robot, 500)
    poses = kinematics.forward(joints)
    poses[:, 3:] *= -1.0
    found = kinematics.numeric.near(poses, joints)
    off_deg = kinematics.task.off_deg(kinematics.forward(found.joints), poses)
    assert np.all(off_deg[found.solved] <= TURN_OFF_DEG)


@pytest.mark.slow
@pytest.mark.parametrize(("make", "most"), [(five_axes, 8), (three_joints, 4), (sliding, 2)])
def test_further_solutions(make, most: int) -> None:  # type: ignore[no-untyped-def]
    """Each is another one, has the pose, and comes in the order of its joints."""
    robot = make()
    kinematics, joints = kinematics_of(robot), random_joints(robot, 10, seed=7)
    for joint in joints:
        pose = kinematics.forward(joint[np.newaxis])
        nearest, *further = kinematics.inverse(pose, joint)
        assert nearest.joints[0] == pytest.approx(joint, abs=1e-6)
        assert [branch.name for branch in further] == [f"solution-{i + 1}" for i in range(len(further))]
        found = np.stack([branch.joints[0] for branch in (nearest, *further)])
        assert 1 <= len(found) <= most
        back = kinematics.forward(found)
        assert np.linalg.norm((back - pose)[:, :3], axis=1).max() <= PLACE_OFF_MM
        assert kinematics.task.off_deg(back, np.tile(pose, (len(found), 1))).max() <= TURN_OFF_DEG
        apart = np.abs(found[:, np.newaxis] - found).max(axis=2) + 1e9 * np.eye(len(found))
        assert apart.min() > 1e-4
        order = [tuple(row) for row in np.round(found[1:], 3).tolist()]
        assert order == sorted(order)


def test_the_three_joints_have_their_elbow_up_and_down_and_their_back_turned() -> None:
    """An arm of three joints reaches a place with its face or its back to it, with the elbow up or down."""
    kinematics = kinematics_of(three_joints())
    joints = np.array([[20.0, 30.0, -40.0]])
    branches = kinematics.inverse(kinematics.forward(joints), joints[0])
    turned = sorted(round(float(branch.joints[0, 0])) for branch in branches)
    assert turned in ([20, 20], [-160, -160, 20, 20])


@pytest.mark.slow
def test_the_wrists_speeds_are_those_of_the_whole_jacobian() -> None:
    """In closed form, arm and wrist one after the other, the speeds are those of all six equations together."""
    for name in ("AR4", "PAROL6", "Thor", "Dummy"):
        kinematics, joints = kinematics_of(arm(name)), random_joints(arm(name), 500, seed=8)
        assert kinematics.form is not None
        joints = joints[np.min(kinematics.form.measures(np.deg2rad(joints)), axis=0) > 0.05]
        tool = np.random.default_rng(9).normal(0.0, 30.0, (len(joints), 6))
        whole = SerialChain.joint_velocities(kinematics, joints, tool)
        assert kinematics.joint_velocities(joints, tool) == pytest.approx(whole, rel=1e-8, abs=1e-7)


def test_a_held_joint_and_a_turned_base_change_no_speeds() -> None:
    rows = {"S": "theta_deg = 10.0, alpha_deg = 20.0, d_mm = 30.0, a_mm = 40.0", **dh_entries(AR4_ROWS)}
    robot = read_robot(chain_text(rows, [(-90.0, 90.0), *AR4_LIMITS], more='held = ["S"]'))
    kinematics, joints = kinematics_of(robot).on(BaseFrame(100.0, 200.0, 300.0, 40.0)), random_joints(robot, 200)
    tool = np.random.default_rng(9).normal(0.0, 30.0, (len(joints), 6))
    assert kinematics.form is not None
    whole = SerialChain.joint_velocities(kinematics, joints, tool)
    clear = np.min(kinematics.form.measures(np.deg2rad(joints[:, 1:])), axis=0) > 0.05
    assert kinematics.joint_velocities(joints, tool)[clear] == pytest.approx(whole[clear], rel=1e-8, abs=1e-7)


def test_joints_within_their_limits_come_before_nearer_ones() -> None:
    """From a start with the elbow up Newton's method keeps it so, beyond J3's 52 deg; the arm can have it down."""
    robot = three_joints()
    kinematics, joints = kinematics_of(robot), np.array([[20.0, 30.0, -60.0]])
    pose = kinematics.forward(joints)
    beyond = next(branch.joints[0] for branch in kinematics.inverse(pose, joints[0]) if branch.joints[0, 2] > 52.0)
    start = beyond + np.array([0.0, 0.0, 5.0])
    assert kinematics.numeric.near(pose, start[np.newaxis]).joints[0] == pytest.approx(beyond, abs=1e-6)
    solved = kinematics.solve(pose, NEAREST, start)
    limits = joint_constraints(robot.joints, beyond[np.newaxis])
    assert not np.all([each.kept for each in limits])
    assert solved.reachable[0]
    assert np.linalg.norm((kinematics.forward(solved.joints) - pose)[0, :3]) <= PLACE_OFF_MM


@pytest.mark.slow
def test_joints_beyond_their_limits_are_told_if_there_are_no_others() -> None:
    kinematics = kinematics_of(three_joints())
    pose = kinematics.forward(np.array([[20.0, 95.0, 10.0]]))
    solved = kinematics.solve(pose, NEAREST, np.array([20.0, 90.0, 10.0]))
    assert solved.reason(0) == "J2: 95.0 deg is outside -42..90 deg, by 5 deg"
