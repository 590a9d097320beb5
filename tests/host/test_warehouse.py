"""The warehouse robot's kinematics: golden poses, modified DH written anew, both elbows, velocities, and reasons."""

import dataclasses

import numpy as np
import pytest

from host.errors import InputError
from host.kinematics import Branch, Elbow, Scara, make_kinematics
from host.robot import Robot
from host.robots import load_robot
from host.trajectory import FloatArray

ROBOT = load_robot("warehouse-scara")
SCARA = make_kinematics(ROBOT)
LOWER = np.array([joint.lower for joint in ROBOT.joints])
UPPER = np.array([joint.upper for joint in ROBOT.joints])


def random_joints(count: int, seed: int) -> FloatArray:
    return np.random.default_rng(seed).uniform(LOWER, UPPER, (count, 6))


def branch_of(poses: FloatArray, elbow: Elbow, near: FloatArray | None = None) -> Branch:
    return {branch.name: branch for branch in SCARA.inverse(poses, near)}[elbow.value]


def inverse_of(*pose: float, elbow: Elbow = Elbow.RIGHT) -> Branch:
    return branch_of(np.array([pose]), elbow)


@pytest.mark.parametrize(
    ("joints", "pose"),
    [
        ((50, 0, 0, 0), (390, 0, 10, 0)),
        ((100, 0, 60, 30), (275, 169.903810568, 60, 90)),
        ((125, 30, -75, 45), (319.271097935, -6.066017178, 85, 0)),
        ((200, -60, 120, -90), (209.641016151, -63.301270189, 160, -30)),
    ],
)
def test_golden_poses(joints: tuple[float, ...], pose: tuple[float, ...]) -> None:
    assert SCARA.forward(np.array([[0.0, 0.0, *joints]]))[0] == pytest.approx(pose, abs=1e-9)
    shifted = SCARA.forward(np.array([[1500.0, 700.0, *joints]]))[0]
    assert shifted == pytest.approx(np.add(pose, (1500, 0, 700, 0)), abs=1e-9)


def modified_dh(alpha_deg: float, a_mm: float, d_mm: float, theta_deg: float) -> FloatArray:
    """Rx(alpha) Tx(a) Rz(theta) Tz(d), multiplied out factor by factor."""
    ca, sa = np.cos(np.deg2rad(alpha_deg)), np.sin(np.deg2rad(alpha_deg))
    c, s = np.cos(np.deg2rad(theta_deg)), np.sin(np.deg2rad(theta_deg))
    rx = np.array([[1, 0, 0, a_mm], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1.0]])
    rz = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, d_mm], [0, 0, 0, 1.0]])
    return np.asarray(rx @ rz)


def dh_product(lift: float, th1: float, th2: float, th3: float) -> FloatArray:
    rows = [(0, 0, lift, th1), (0, 200, 0, th2), (0, 150, 0, th3), (0, 40, -40, 0)]
    return np.asarray(np.linalg.multi_dot([modified_dh(*row) for row in rows]))


def test_the_dh_product_is_the_closed_form() -> None:
    joints = random_joints(500, seed=3)
    poses = SCARA.forward(joints)
    products = np.array([dh_product(*row[2:]) for row in joints])
    slides = np.column_stack([joints[:, 0], np.zeros(500), joints[:, 1]])
    assert products[:, :3, 3] + slides == pytest.approx(poses[:, :3], abs=1e-9)
    attitude = np.rad2deg(np.arctan2(products[:, 1, 0], products[:, 0, 0]))
    assert np.abs((attitude - poses[:, 3] + 180) % 360 - 180).max() < 1e-9
    assert products[:, 2, :3] == pytest.approx(np.tile([0.0, 0.0, 1.0], (500, 1)))  # the tool stays upright


@pytest.mark.parametrize("elbow", Elbow)
def test_forward_undoes_inverse(elbow: Elbow) -> None:
    """10 000 poses that the machine takes; the other elbow takes them as well, within or beyond its limits."""
    joints = random_joints(10_000, seed=4)
    poses = SCARA.forward(joints)
    branch = branch_of(poses, elbow, near=joints)
    back = SCARA.forward(branch.joints)
    assert np.abs(back[:, :3] - poses[:, :3]).max() < 1e-9
    assert np.abs((back[:, 3] - poses[:, 3] + 180) % 360 - 180).max() < 1e-9
    assert np.all(branch.joints[:, 4] * elbow.sign >= 0)
    assert np.all((branch.joints[:, 3:] > -180) & (branch.joints[:, 3:] <= 180))
    assert branch.joints[:, :2].tolist() == joints[:, :2].tolist()


def test_each_pose_is_found_again_by_its_own_elbow() -> None:
    joints = random_joints(10_000, seed=5)
    poses = SCARA.forward(joints)
    right, left = SCARA.inverse(poses, joints)
    own = np.where(joints[:, [4]] >= 0, right.joints, left.joints)
    assert np.abs((own - joints + 180) % 360 - 180)[:, 3:].max() < 1e-4  # ill conditioned where th2 is near 0
    assert np.all(np.where(joints[:, 4] >= 0, right.reachable, left.reachable))


def test_the_slides_stay_where_the_caller_says() -> None:
    pose = np.array([[1275.0, 169.903810568, 560.0, 90.0]])
    held = branch_of(pose, Elbow.RIGHT, near=np.array([1000.0, 500.0, 77.0, 77.0, 77.0, 77.0]))
    assert held.joints[0] == pytest.approx([1000, 500, 100, 0, 60, 30], abs=1e-6)
    assert branch_of(pose, Elbow.RIGHT).reason(0) is not None  # from 0 it is out of reach


def test_joint_velocities_are_those_of_finite_differences() -> None:
    joints = random_joints(2000, seed=6)
    joints = joints[np.abs(np.sin(np.deg2rad(joints[:, 4]))) > 0.1]
    speeds = np.random.default_rng(7).uniform(-50.0, 50.0, joints.shape)
    speeds[:, :2] = 0.0
    h = 1e-6
    tool = SCARA.forward(joints + h * speeds) - SCARA.forward(joints - h * speeds)
    tool[:, 3] = (tool[:, 3] + 180) % 360 - 180
    assert SCARA.joint_velocities(joints, tool / (2 * h)) == pytest.approx(speeds, abs=1e-4)


class TestReasons:
    """Why a pose cannot be taken, on both sides of each limit."""

    @pytest.mark.parametrize(
        ("x_mm", "reason"),
        [
            (390.0, None),
            (390.1, "out of reach: shoulder to wrist 350.1 mm is outside 50..350 mm"),
            (89.0, "out of reach: shoulder to wrist 49.0 mm is outside 50..350 mm"),
        ],
    )
    def test_reach(self, x_mm: float, reason: str | None) -> None:
        branch = inverse_of(x_mm, 0.0, 60.0, 0.0)
        assert branch.reason(0) == reason
        assert branch.reachable.tolist() == [reason is None]
        assert np.isfinite(branch.joints[0, 3:]).all() == (reason is None)

    @pytest.mark.parametrize(
        ("z_mm", "reason"),
        [
            (10.0, None),
            (9.99, "L1: 49.99 mm is outside 50..200 mm"),
            (160.0, None),
            (160.5, "L1: 200.5 mm is outside 50..200 mm"),
        ],
    )
    def test_lift(self, z_mm: float, reason: str | None) -> None:
        assert inverse_of(275.0, 169.903810568, z_mm, 90.0).reason(0) == reason

    @pytest.mark.parametrize("axis", [3, 4])
    @pytest.mark.parametrize("side", [-1, 1])
    def test_every_rotary_limit(self, axis: int, side: int) -> None:
        joint = ROBOT.joints[axis]
        for excess_deg, reachable in ((0.0, True), (0.01, False)):
            joints = np.array([[0.0, 0.0, 100.0, 10.0, 90.0, 20.0]])
            joints[0, axis] = side * (joint.upper + excess_deg)
            elbow = Elbow.RIGHT if joints[0, 4] > 0 else Elbow.LEFT
            branch = branch_of(SCARA.forward(joints), elbow)
            assert branch.reachable.tolist() == [reachable]
            if not reachable:
                upper = f"{joint.upper:g}"
                assert (
                    branch.reason(0)
                    == f"{joint.name}: {side * joint.upper + side * 0.01:.2f} deg is outside -{upper}..{upper} deg"
                )

    def test_the_last_joint_takes_every_angle(self) -> None:
        """It wraps into (-180, 180]: its limits are the whole circle."""
        poses = np.column_stack([np.tile([[275.0, 0.0, 60.0]], (361, 1)), np.arange(-180.0, 181.0)])
        branch = branch_of(poses, Elbow.RIGHT)
        th3_kept = next(limit for limit in branch.constraints if limit.quantity == "th3:").kept
        assert th3_kept[np.isfinite(branch.joints[:, 5])].all()

    def test_a_slide_held_beyond_its_limit(self) -> None:
        pose = np.array([[2275.0, 169.903810568, 60.0, 90.0]])
        reason = branch_of(pose, Elbow.RIGHT, near=np.array([2001.0, 0, 100, 0, 60, 30])).reason(0)
        assert reason == "sx: 2001.0 mm is outside 0..2000 mm"

    def test_each_pose_has_its_own(self) -> None:
        branch = branch_of(np.array([[275.0, 100, 60, 90], [500, 0, 60, 0], [275, 100, 0, 90]]), Elbow.RIGHT)
        assert branch.reachable.tolist() == [True, False, False]
        assert branch.reason(0) is None
        assert str(branch.reason(1)).startswith("out of reach")
        assert str(branch.reason(2)).startswith("L1")


def with_geometry(**dimensions: float) -> Robot:
    return dataclasses.replace(ROBOT, geometry=dimensions)


class TestARobotThatDoesNotFit:
    def test_an_unknown_kind(self) -> None:
        with pytest.raises(InputError, match=r"kinematics.kind: 'warehouse' is unknown: did you mean warehouse-scara"):
            make_kinematics(dataclasses.replace(ROBOT, kinematics="warehouse"))

    def test_a_missing_dimension(self) -> None:
        with pytest.raises(InputError, match=r"kinematics.L5_mm: is missing"):
            make_kinematics(with_geometry(L2_mm=200, L3_mm=150, L4_mm=40))

    def test_an_unknown_dimension(self) -> None:
        with pytest.raises(InputError, match=r"'L6_mm' is unknown: did you mean L"):
            make_kinematics(with_geometry(L2_mm=200, L3_mm=150, L4_mm=40, L5_mm=40, L6_mm=1))

    def test_links_without_length(self) -> None:
        with pytest.raises(InputError, match="make no arm"):
            make_kinematics(with_geometry(L2_mm=0, L3_mm=150, L4_mm=40, L5_mm=40))

    def test_other_joints(self) -> None:
        turned = dataclasses.replace(ROBOT, joints=ROBOT.joints[::-1], home=ROBOT.home[::-1])
        with pytest.raises(InputError, match=r"joints: th3\[deg\] .* has sx\[mm\]"):
            make_kinematics(turned)


def test_it_is_the_kind_that_the_file_names() -> None:
    assert isinstance(SCARA, Scara)
