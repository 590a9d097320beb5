"""A robot on its base: everything in the station's frame, against S_0T multiplied out here."""

import dataclasses
from math import cos, radians, sin

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import load_robot, parse_robot
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
from steptwin.host.robots.kinematics.base import tool_frames
from steptwin.host.robots.kinematics.chain import Chain
from steptwin.host.robots.kinematics.usual_scara import Lift
from steptwin.host.robots.poses.base_frame import STATION, BaseFrame
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.workspace import monte_carlo, scan
from steptwin.host.robots.workspace.nearest_pose import nearest_pose
from tests.features.papers.mechanisms import ALL, Mechanism, each_mechanism, each_scara, own_solutions
from tests.host.complaints import complaint_of
from tests.host.robots.kinematics.test_usual_scara import scara

BASE = BaseFrame(1250.0, -380.0, 95.0, 127.0)
S_0T = np.array(
    [
        [cos(radians(127.0)), -sin(radians(127.0)), 0.0, 1250.0],
        [sin(radians(127.0)), cos(radians(127.0)), 0.0, -380.0],
        [0.0, 0.0, 1.0, 95.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
)
PROBE_S = 1e-6


def on_base(robot: Robot, base: BaseFrame = BASE) -> Robot:
    """Return a robot on a base, without the shelf, where no base may be turned."""
    return dataclasses.replace(robot, base=base, sections={})


def frames_of(poses: FloatArray) -> FloatArray:
    """Return Trans(x, y, z) Rz(attitude) of each pose."""
    frames = []
    for x_mm, y_mm, z_mm, attitude_deg in poses:
        c, s = cos(radians(attitude_deg)), sin(radians(attitude_deg))
        frames.append([[c, -s, 0, x_mm], [s, c, 0, y_mm], [0, 0, 1, z_mm], [0, 0, 0, 1]])
    return np.array(frames)


def moved(poses: FloatArray) -> FloatArray:
    """Return the matrices in the station of poses given from the base."""
    return np.array([S_0T @ frame for frame in frames_of(poses)])


def kinematics_of(mechanism: Mechanism) -> Kinematics:
    return make_kinematics(on_base(mechanism.robot))


@each_mechanism
def test_forward_is_the_product_of_equation_6(mechanism: Mechanism) -> None:
    joints, arm = mechanism.random_joints(200, seed=31), kinematics_of(mechanism)
    poses = arm.forward(joints)
    assert frames_of(poses) == pytest.approx(moved(mechanism.kinematics.forward(joints)), abs=1e-9)
    assert ((poses[:, 3] > -180.0) & (poses[:, 3] <= 180.0)).all()
    expected = np.array([S_0T @ frame for frame in tool_frames(mechanism.kinematics, joints)])
    assert tool_frames(arm, joints) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("mechanism", "name"),
    [pytest.param(each, name, id=f"{each.name} {name}") for each in ALL for name in each.kinematics.branches],
)
def test_every_branch_has_the_joints_of_the_pose_from_the_base(mechanism: Mechanism, name: str) -> None:
    """Reasons, limits and joints are those without a base; FK takes every joint back to the pose."""
    joints, arm = mechanism.random_joints(2000, seed=32), kinematics_of(mechanism)
    poses, from_base = arm.forward(joints), mechanism.kinematics.forward(joints)
    found, expected = (each.solve(at, name, joints) for each, at in ((arm, poses), (mechanism.kinematics, from_base)))
    clear = np.isfinite(expected.joints).all(axis=1) & (np.abs(from_base[:, 3]) < 179.9)
    rotary = [joint.unit is Unit.DEG for joint in mechanism.robot.joints]
    clear &= (np.abs(expected.joints - joints)[:, rotary] < 179.9).all(axis=1)  # a turn to either side is as near
    assert clear.sum() > 1000
    assert found.joints[clear] == pytest.approx(expected.joints[clear], abs=1e-6)
    assert (found.reachable == expected.reachable)[clear].all()
    if name not in ("(+,-)", "(-,+)", "(-,-)"):  # the platform is on the other side of the sliders' line there
        assert frames_of(arm.forward(found.joints[clear])) == pytest.approx(frames_of(poses[clear]), abs=1e-8)


@each_mechanism
def test_its_own_branch_returns_the_joints(mechanism: Mechanism) -> None:
    joints = mechanism.random_joints(1000, seed=33)
    placed = dataclasses.replace(mechanism, robot=on_base(mechanism.robot), kinematics=kinematics_of(mechanism))
    found, reachable = own_solutions(placed, joints)
    assert reachable.all()
    assert np.median(np.abs(found - joints)) < 1e-9


@each_mechanism
def test_joint_velocities_move_the_tool_in_the_station(mechanism: Mechanism) -> None:
    arm, joints = kinematics_of(mechanism), np.array([mechanism.posture])
    for axis in range(4):
        wanted = np.zeros((1, 4))
        wanted[0, axis] = 10.0
        step = PROBE_S * arm.joint_velocities(joints, wanted)
        moved_by = (arm.forward(joints + step) - arm.forward(joints - step)) / (2 * PROBE_S)
        assert moved_by == pytest.approx(wanted, abs=1e-5)


@each_mechanism
def test_parts_are_drawn_in_the_station(mechanism: Mechanism) -> None:
    joints, arm = mechanism.random_joints(20, seed=34), kinematics_of(mechanism)
    for part, own in zip(arm.links(joints), mechanism.kinematics.links(joints), strict=True):
        expected = [[(S_0T @ [*point, 1.0])[:3] for point in points] for points in own.points_mm]
        assert (part.name, part.role) == (own.name, own.role)
        assert part.points_mm == pytest.approx(np.array(expected), abs=1e-9)
    assert arm.links(joints)[-1].points_mm[:, -1] == pytest.approx(arm.forward(joints)[:, :3], abs=1e-9)


@each_scara
def test_the_chain_with_errors_stands_on_the_base(mechanism: Mechanism) -> None:
    """Where the tool really is, and what each error does, along the station's axes."""
    errors = np.random.default_rng(6).normal(0.0, 0.3, Chain.of(mechanism.robot).errors.shape)
    own, chain = (Chain.of(robot).with_errors(errors) for robot in (mechanism.robot, on_base(mechanism.robot)))
    joints = mechanism.random_joints(20, seed=35)
    expected = np.array([S_0T @ frame for frame in own.transforms(joints)])
    assert chain.transforms(joints) == pytest.approx(expected, abs=1e-9)
    turned = np.kron(np.eye(2), S_0T[:3, :3]) @ own.sensitivities(joints)
    assert chain.sensitivities(joints) == pytest.approx(turned, abs=1e-9)


def test_what_follows_from_the_arm_is_told_in_the_station() -> None:
    """Without a lift and a tool's joint, height and attitude of a pose are refused with the station's figures."""
    robot = scara(Lift.NONE, False, base_mm=200.0)
    height_mm = float(make_kinematics(robot).forward(np.zeros((1, 2)))[0, 2])
    arm = make_kinematics(on_base(robot))
    x_mm, y_mm, z_mm, attitude_deg = arm.forward(np.array([[20.0, 60.0]]))[0]
    assert (z_mm, attitude_deg) == pytest.approx((height_mm + 95.0, -153.0))
    assert arm.solve(np.array([[x_mm, y_mm, z_mm, np.nan]]), "right").reachable[0]
    high = arm.solve(np.array([[x_mm, y_mm, 300.0, np.nan]]), "right").reason(0)
    assert high == f"z 300.0000 mm: the tool has no lift, its height here is {height_mm + 95.0:.4f} mm"
    turned = arm.solve(np.array([[x_mm, y_mm, z_mm, 10.0]]), "right").reason(0)
    assert turned == "phi 10.0000 deg: the tool does not turn by itself, its attitude here is -153.0000 deg"


class TestWorkspace:
    @pytest.mark.slow
    @pytest.mark.parametrize("name", ["lab-scara", "warehouse-scara", "hybrid-arm"])
    def test_it_is_the_same_one_moved(self, name: str) -> None:
        robot = load_robot(name)
        robot, placed = dataclasses.replace(robot, sections={}), on_base(robot)
        own, there = scan(robot), scan(placed)
        assert there.plan.area_mm2 == pytest.approx(own.plan.area_mm2, rel=1e-4)
        assert there.plan.radius_mm == pytest.approx(own.plan.radius_mm, abs=1e-5)
        assert there.plan.z_mm == pytest.approx(own.plan.z_mm + 95.0)
        assert there.profile.area_mm2 == pytest.approx(own.profile.area_mm2, rel=1e-6)
        turn_deg = (there.profile.azimuth_deg - own.profile.azimuth_deg - 127.0 + 180.0) % 360.0 - 180.0
        assert turn_deg == pytest.approx(0.0, abs=1e-9)
        assert there.axis_mm == pytest.approx((S_0T @ [*own.axis_mm, 0.0, 1.0])[:2])
        far_mm = np.hypot(*(there.plan.boundary_mm - np.array(there.axis_mm)).T)
        assert far_mm.max() == pytest.approx(own.plan.radius_mm[1] if own.plan.radius_mm else 0.0, abs=1.0)

    def test_the_cloud_is_the_same_one_moved(self) -> None:
        own, there = (
            monte_carlo(robot, 500, 1) for robot in (load_robot("lab-scara"), on_base(load_robot("lab-scara")))
        )
        assert there.radius_mm == pytest.approx(own.radius_mm, abs=1e-9)
        assert there.cloud_mm == pytest.approx(np.array([(S_0T @ [*at, 1.0])[:3] for at in own.cloud_mm]), abs=1e-9)

    def test_the_nearest_pose_is_one_of_the_station(self) -> None:
        robot, home = on_base(load_robot("lab-scara")), np.array(load_robot("lab-scara").home)
        pose = (1250.0 + 900.0, -380.0, 95.0, 0.0)  # 100 mm beyond the reach of 800 mm about the base
        found = nearest_pose(robot, pose, home)
        assert found is not None
        assert np.hypot(found[0] - 1250.0, found[1] + 380.0) == pytest.approx(800.0, abs=0.5)
        assert any(branch.reachable[0] for branch in make_kinematics(robot).inverse(np.array([found]), home))


class TestRobotFile:
    def text(self, table: str, name: str = "lab-scara") -> str:
        return f"{load_robot(name).toml}\n[base]\n{table}\n"

    def refusal(self, table: str) -> str:
        return complaint_of(lambda: parse_robot(self.text(table), "a.toml"))

    def test_keys_that_are_left_out_are_0(self) -> None:
        assert parse_robot(self.text("x_mm = 500\nphi_deg = -90.0"), "a.toml").base == BaseFrame(500.0, phi_deg=-90.0)
        assert parse_robot(self.text(""), "a.toml").base == load_robot("lab-scara").base == STATION

    def test_a_base_at_the_station_s_origin_changes_no_bit(self) -> None:
        joints = np.random.default_rng(3).uniform(-100.0, 100.0, (50, 4))
        poses = load_robot("lab-scara"), parse_robot(self.text("x_mm = 0.0"), "a.toml")
        first, second = (make_kinematics(robot).forward(joints) for robot in poses)
        assert first.tobytes() == second.tobytes()

    def test_limits(self) -> None:
        assert parse_robot(self.text("z_mm = -100000.0\nphi_deg = 360.0"), "a.toml").base.z_mm == -100_000.0
        far = "a.toml: base.y_mm: 100001.0 mm is outside -100000..100000 mm; the nearest is 100000 mm"
        assert self.refusal("y_mm = 100001.0") == far
        turned = "a.toml: base.phi_deg: -360.5 deg is outside -360..360 deg; the nearest is -360 deg"
        assert self.refusal("phi_deg = -360.5") == turned

    @pytest.mark.parametrize(
        ("table", "words"),
        [
            ("x_mm = nan", "base.x_mm: nan is not a finite number up to 1e+09"),
            ("z_mm = -inf", "base.z_mm: -inf is not a finite number up to 1e+09"),
            ('y_mm = "0"', "base.y_mm: '0' is not a number"),
            ("phi_dg = 90.0", "base.phi_dg: key 'phi_dg' is unknown: did you mean phi_deg?"),
        ],
    )
    def test_a_wrong_value(self, table: str, words: str) -> None:
        assert self.refusal(table) == f"a.toml: {words}"

    def test_a_number_that_is_none(self) -> None:
        complaint_of(lambda: BaseFrame(x_mm=float("nan")))

    def test_a_shelf_is_not_turned(self) -> None:
        """Its drawers open along y; a robot may stand anywhere in front of it."""
        words = (
            "a.toml: base.phi_deg: 30 deg is for a robot without a shelf, whose drawers open along y; 0 is right here"
        )
        assert complaint_of(lambda: parse_robot(self.text("phi_deg = 30.0", "warehouse-scara"), "a.toml")) == words
        assert parse_robot(self.text("x_mm = 30.0", "warehouse-scara"), "a.toml").base.x_mm == 30.0
