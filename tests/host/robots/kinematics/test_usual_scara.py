"""The kind `scara`: every combination of lift, tool rotation and tool direction, by golden values and properties."""

import dataclasses
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import load_robot
from steptwin.host.robots.joint import Joint, Transmission, Unit
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
from steptwin.host.robots.kinematics.usual_scara import Lift, ScaraGeometry, Vertical
from steptwin.host.robots.robot import Dimension, Robot
from tests.host.complaints import complaint_of
from tests.host.robots.kinematics.changed import pose_errors, with_geometry

COMBINATIONS = list(product(Lift, (True, False), Vertical, Vertical))
each_combination = pytest.mark.parametrize(("lift", "turning", "tool", "positive"), COMBINATIONS)

JOINTS = {
    Unit.MM: Joint("", Unit.MM, 0.0, 80.0, 30.0, 150.0, Transmission(200, 8, 4.0)),
    Unit.DEG: Joint("", Unit.DEG, -150.0, 150.0, 180.0, 900.0, Transmission(200, 16, 360.0, 4.0)),
}
NAMES = {
    (Lift.FIRST, True): ("d1", "th2", "th3", "th4"),
    (Lift.FIRST, False): ("d1", "th2", "th3"),
    (Lift.LAST, True): ("th1", "th2", "d3", "th4"),
    (Lift.LAST, False): ("th1", "th2", "d3"),
    (Lift.NONE, True): ("th1", "th2", "th3"),
    (Lift.NONE, False): ("th1", "th2"),
}
DIMENSIONS = {"l1_mm": 200.0, "l2_mm": 150.0, "base_mm": 180.0, "offset_mm": -10.0, "drop_mm": 40.0}


def scara(
    lift: Lift = Lift.LAST,
    turning: bool = True,
    tool: Vertical = Vertical.DOWN,
    positive: Vertical = Vertical.DOWN,
    **dimensions: Dimension,
) -> Robot:
    units = [Unit.MM if name.startswith("d") else Unit.DEG for name in NAMES[lift, turning]]
    joints = tuple(
        dataclasses.replace(JOINTS[unit], name=name) for name, unit in zip(NAMES[lift, turning], units, strict=True)
    )
    options: dict[str, Dimension] = {"lift": lift, "tool_rotation": turning, "tool": tool, "lift_positive": positive}
    geometry = options | DIMENSIONS | dimensions
    home = tuple(0.0 for _ in joints)
    return Robot("arm", "An arm", "scara", geometry, joints, home, load_robot("ar4-mk3").board)


def drawn(robot: Robot, count: int, seed: int) -> FloatArray:
    lower, upper = ([getattr(joint, bound) for joint in robot.joints] for bound in ("lower", "upper"))
    return np.random.default_rng(seed).uniform(lower, upper, (count, len(lower)))


def elbow(kinematics: Kinematics, joints: FloatArray) -> FloatArray:
    """Return sin(elbow), the second rotary joint."""
    names = [name for name in kinematics.dh_variables(joints) if name.startswith("th")]
    return np.sin(np.deg2rad(kinematics.dh_variables(joints)[names[1]]))


class TestGoldenValues:
    """The arm of 200 + 150 mm at th1 = 30, th2 = 60: x = 200 cos 30, y = 200 sin 30 + 150, z = 180 - 10 - 40 -+ d3."""

    @pytest.mark.parametrize(
        ("robot", "joints", "pose"),
        [
            pytest.param(scara(), (30, 60, 25, 45), (173.205080757, 250, 105, 45), id="lift last, tool down"),
            pytest.param(scara(tool=Vertical.UP), (30, 60, 25, 45), (173.205080757, 250, 105, 135), id="tool up"),
            pytest.param(
                scara(positive=Vertical.UP), (30, 60, 25, 45), (173.205080757, 250, 155, 45), id="lift counts up"
            ),
            pytest.param(
                scara(Lift.FIRST, positive=Vertical.UP),
                (25, 30, 60, 45),
                (173.205080757, 250, 155, 45),
                id="lift first",
            ),
            pytest.param(scara(Lift.NONE), (30, 60, 45), (173.205080757, 250, 130, 45), id="no lift"),
            pytest.param(scara(turning=False), (30, 60, 25), (173.205080757, 250, 105, 90), id="no rotation"),
            pytest.param(
                scara(Lift.NONE, turning=False), (30, 60), (173.205080757, 250, 130, 90), id="neither lift nor rotation"
            ),
            pytest.param(
                scara(tool_mm=20.0), (30, 60, 25, 90), (193.205080757, 250, 105, 0), id="tool beside its axis"
            ),
            pytest.param(
                scara(heading_deg=90.0), (30, 60, 25, 45), (-250, 173.205080757, 105, 135), id="the arm heads for +y"
            ),
        ],
    )
    def test_pose(self, robot: Robot, joints: tuple[float, ...], pose: tuple[float, ...]) -> None:
        kinematics = make_kinematics(robot)
        assert kinematics.forward(np.array([joints], dtype=np.float64))[0] == pytest.approx(pose, abs=1e-9)
        right = kinematics.solve(np.array([pose]), "right").joints[0]
        assert right == pytest.approx(joints, abs=1e-6)

    def test_the_lift_of_a_4_mm_screw(self) -> None:
        """1/8 steps of a motor of 200: 400 steps/mm, so that 15 kHz are 37.5 mm/s."""
        lift = scara().joint("d3")
        assert lift.transmission.steps_per_unit == 400
        assert dataclasses.replace(lift, speed_max=37.5).step_rate_max_hz == 15_000


@each_combination
class TestEveryCombination:
    def test_joints_are_numbered_along_the_chain(
        self, lift: Lift, turning: bool, tool: Vertical, positive: Vertical
    ) -> None:
        joints = ScaraGeometry(200.0, 150.0, lift, positive, turning, tool).joints
        assert tuple(joints) == NAMES[lift, turning]
        turned = scara(lift, turning, tool, positive)
        complaint_of(lambda: make_kinematics(dataclasses.replace(turned, joints=turned.joints[::-1])))

    def test_each_branch_takes_the_tool_back(
        self, lift: Lift, turning: bool, tool: Vertical, positive: Vertical
    ) -> None:
        robot = scara(lift, turning, tool, positive, heading_deg=30.0, tool_mm=15.0 if turning else 0.0)
        kinematics, joints = make_kinematics(robot), drawn(robot, 2000, seed=2)
        poses = kinematics.forward(joints)
        assert kinematics.attitude_follows is not turning
        branches = {branch.name: branch for branch in kinematics.inverse(poses, joints)}
        own = np.where(elbow(kinematics, joints) >= 0, 0, 1)
        found = np.stack([branches[name].joints for name in ("right", "left")])[own, np.arange(2000)]
        reachable = np.stack([branches[name].reachable for name in ("right", "left")])[own, np.arange(2000)]
        assert np.all(reachable)
        assert np.all(np.abs(found - joints).max(axis=1) * np.abs(elbow(kinematics, joints)) < 1e-9)
        if turning:
            for branch in branches.values():
                assert pose_errors(kinematics.forward(branch.joints), poses).max() < 1e-9

    def test_the_dh_table_is_the_closed_form(
        self, lift: Lift, turning: bool, tool: Vertical, positive: Vertical
    ) -> None:
        robot = scara(lift, turning, tool, positive, heading_deg=-40.0, tool_mm=15.0 if turning else 0.0)
        kinematics, joints = make_kinematics(robot), drawn(robot, 500, seed=3)
        poses, transforms = kinematics.forward(joints), kinematics.dh.transforms(kinematics.dh_variables(joints))
        assert np.abs(transforms[:, :3, 3] - poses[:, :3]).max() < 1e-9
        attitude_rad = np.deg2rad(poses[:, 3])
        assert np.abs(transforms[:, :2, 0] - np.column_stack([np.cos(attitude_rad), np.sin(attitude_rad)])).max() < 1e-9
        assert np.all(transforms[:, 2, 2] == pytest.approx(1.0 if tool is Vertical.UP else -1.0))

    def test_velocities_are_the_derivatives(
        self, lift: Lift, turning: bool, tool: Vertical, positive: Vertical
    ) -> None:
        robot = scara(lift, turning, tool, positive, tool_mm=15.0 if turning else 0.0)
        kinematics, joints = make_kinematics(robot), drawn(robot, 500, seed=4)
        joints = joints[np.abs(elbow(kinematics, joints)) > 0.1]
        rates = np.random.default_rng(5).uniform(-1.0, 1.0, joints.shape)
        dt_s = 1e-5
        tool_rates = kinematics.forward(joints + dt_s * rates) - kinematics.forward(joints - dt_s * rates)
        tool_rates[:, 3] = (tool_rates[:, 3] + 180.0) % 360.0 - 180.0
        assert kinematics.joint_velocities(joints, tool_rates / (2.0 * dt_s)) == pytest.approx(rates, abs=1e-4)


LENGTHS = st.floats(20.0, 2000.0)
OFFSETS = st.floats(-500.0, 500.0)


@pytest.mark.slow
@settings(max_examples=100)
@given(st.sampled_from(COMBINATIONS), LENGTHS, LENGTHS, OFFSETS, OFFSETS, OFFSETS, OFFSETS, st.integers(0, 2**32 - 1))
def test_forward_undoes_inverse_whatever_the_dimensions(
    combination: tuple[Lift, bool, Vertical, Vertical],
    l1_mm: float, l2_mm: float, base_mm: float, offset_mm: float, drop_mm: float, tool_mm: float, seed: int,
) -> None:  # fmt: skip
    lift, turning, tool, positive = combination
    robot = scara(
        lift, turning, tool, positive,
        l1_mm=l1_mm, l2_mm=l2_mm, base_mm=base_mm, offset_mm=offset_mm, drop_mm=drop_mm,
        tool_mm=tool_mm if turning else 0.0,
    )  # fmt: skip
    kinematics, joints = make_kinematics(robot), drawn(robot, 20, seed)
    poses = kinematics.forward(joints)
    own = np.where(elbow(kinematics, joints) >= 0, 0, 1)
    found = np.stack([branch.joints for branch in kinematics.inverse(poses, joints)])[own, np.arange(20)]
    assert pose_errors(kinematics.forward(found), poses).max() < 1e-6


class TestWithoutRotation:
    ROBOT = scara(turning=False)

    def reason(self, *pose: float) -> str | None:
        return make_kinematics(self.ROBOT).solve(np.array([pose]), "right").reason(0)

    def test_a_pose_without_attitude_is_reached(self) -> None:
        branch = make_kinematics(self.ROBOT).solve(np.array([[173.205080757, 250.0, 105.0, np.nan]]), "right")
        assert branch.reachable[0]
        assert branch.joints[0] == pytest.approx([30, 60, 25], abs=1e-6)

    def test_an_attitude_that_does_not_follow_is_refused_with_the_right_one(self) -> None:
        words = "phi 45.0000 deg: the tool does not turn by itself, its attitude here is 90.0000 deg"
        assert self.reason(173.205080757, 250.0, 105.0, 45.0) == words
        assert self.reason(173.205080757, 250.0, 105.0, 90.0) is None

    def test_both_sides_of_the_tolerance(self) -> None:
        assert self.reason(173.205080757, 250.0, 105.0, 90.00099) is None
        assert str(self.reason(173.205080757, 250.0, 105.0, 90.0011)).startswith("phi 90.0011 deg: the tool does not")

    def test_a_whole_turn_makes_no_difference(self) -> None:
        assert self.reason(173.205080757, 250.0, 105.0, 450.0) is None

    def test_a_tool_beside_the_axis_is_a_longer_link(self) -> None:
        robot = with_geometry(self.ROBOT, tool_mm=20.0)
        words = "kinematics.tool_mm: 20 mm beside the axis of a wrist that does not turn: l2_mm = 170 is the same arm"
        assert complaint_of(lambda: make_kinematics(robot)) == words


class TestWithoutLift:
    ROBOT = scara(Lift.NONE)

    def reason(self, *pose: float) -> str | None:
        return make_kinematics(self.ROBOT).solve(np.array([pose]), "right").reason(0)

    def test_another_height_is_refused_with_the_right_one(self) -> None:
        words = "z 100.0000 mm: the tool has no lift, its height here is 130.0000 mm"
        assert self.reason(173.205080757, 250.0, 100.0, 45.0) == words
        assert self.reason(173.205080757, 250.0, 130.0009, 45.0) is None
        assert str(self.reason(173.205080757, 250.0, 130.0011, 45.0)).startswith("z 130.0011 mm: ")


@pytest.mark.parametrize(
    ("dimension", "value"),
    [
        ("lift", "frist"),
        ("tool", "sideways"),
        ("tool_rotation", 1.0),
        ("l1_mm", True),
        ("l1_mm", 0.0),
        ("l3_mm", 1.0),
    ],
)
def test_wrong_dimensions(dimension: str, value: Dimension) -> None:
    robot = dataclasses.replace(scara(), geometry={**scara().geometry, dimension: value})
    complaint_of(lambda: make_kinematics(robot))


def test_what_may_be_left_out() -> None:
    robot = dataclasses.replace(scara(), geometry={"l1_mm": 200.0, "l2_mm": 150.0})
    assert make_kinematics(robot).forward(np.array([[0.0, 0.0, 10.0, 0.0]]))[0].tolist() == [350.0, 0.0, 10.0, 0.0]
