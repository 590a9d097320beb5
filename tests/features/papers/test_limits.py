"""Reasons why a pose is not reachable, on both sides of each limit; the turns and slides that a solution has."""

import dataclasses
import re

import numpy as np
import pytest

from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics import Branch, Kinematics, make_kinematics, within_limits
from tests.features.papers.mechanisms import (
    ALL,
    BY_NAME,
    HYBRID,
    LAB,
    WAREHOUSE,
    Mechanism,
    each_mechanism,
)

WHOLE_CIRCLES = {"lab-scara": 3, "warehouse-scara": 5, "teaching-scara": 3, "calibration-scara": 3, "hybrid-arm": 3}
"""Columns of the joints that reach every angle: solutions wrap into their limits."""


LIMITED = [
    pytest.param(each, axis, side, id=f"{each.name} {joint.name} {'upper' if side > 0 else 'lower'}")
    for each in ALL
    for axis, joint in enumerate(each.robot.joints)
    for side in (-1, 1)
    if axis != WHOLE_CIRCLES[each.robot.name]
]


@pytest.mark.parametrize(("mechanism", "axis", "side"), LIMITED)
def test_every_limit(mechanism: Mechanism, axis: int, side: int) -> None:
    """A rounding error beyond a limit is allowed, a tenth of a unit is not."""
    joint = mechanism.robot.joints[axis]
    limit = joint.upper if side > 0 else joint.lower
    for excess, reachable in ((-0.1, True), (0.0, True), (5e-10, True), (0.1, False)):
        joints = mechanism.placed(axis, limit + side * excess)
        pose = mechanism.kinematics.forward(joints)
        branch = mechanism.kinematics.solve(pose, mechanism.own_branch(joints), near=joints)
        assert branch.reachable.tolist() == [reachable]
        assert within_limits(mechanism.robot.joints, joints).tolist() == [reachable]
    limits = f"{joint.lower:g}..{joint.upper:g} {joint.unit}"
    wanted = (
        rf"{joint.name}: {limit + side * 0.1:.1f} {joint.unit} is outside {re.escape(limits)}, by 0.1(01)? {joint.unit}"
    )
    assert re.fullmatch(wanted, str(branch.reason(0)))


@each_mechanism
def test_the_tool_reaches_every_angle(mechanism: Mechanism) -> None:
    joints = np.tile(mechanism.posture, (721, 1))
    joints[:, WHOLE_CIRCLES[mechanism.robot.name]] += np.linspace(-360.0, 360.0, 721)
    branch = mechanism.kinematics.solve(mechanism.kinematics.forward(joints), mechanism.kinematics.branches[0], joints)
    limits = branch.limits[WHOLE_CIRCLES[mechanism.robot.name]]
    assert limits.kept.all()


@each_mechanism
def test_within_limits(mechanism: Mechanism) -> None:
    posture = np.array(mechanism.posture)
    rows = np.tile(posture, (len(posture) + 1, 1))
    rows[np.arange(len(posture)), np.arange(len(posture))] = 1e5
    assert within_limits(mechanism.robot.joints, rows).tolist() == [False] * len(posture) + [True]
    rows[-1, 0] = np.nan
    assert not within_limits(mechanism.robot.joints, rows).any()


@pytest.mark.parametrize(
    ("name", "pose", "reason"),
    [
        ("lab-scara", (0, 800, 0, 0), None),
        ("lab-scara", (0, 800.1, 0, 0), "shoulder to wrist 800.1 mm is outside 0..800 mm"),
        ("lab-scara", (0, 338.09461, 0, 0), None),
        ("lab-scara", (0, 338.0946, 0, 0), "th3: {sign}130.000001 deg is outside -130..130 deg"),
        ("warehouse-scara", (390, 0, 60, 0), None),
        ("warehouse-scara", (390.1, 0, 60, 0), "shoulder to wrist 350.1 mm is outside 50..350 mm"),
        ("warehouse-scara", (89, 0, 60, 0), "shoulder to wrist 49.0 mm is outside 50..350 mm"),
        ("teaching-scara", (195, 0, -40, 0), None),
        ("teaching-scara", (195.1, 0, -40, 0), "shoulder to wrist 195.1 mm is outside 5..195 mm"),
        ("teaching-scara", (4.9, 0, -40, 0), "shoulder to wrist 4.9 mm is outside 5..195 mm"),
        ("teaching-scara", (50.70028, 0, -40, 0), None),
        ("teaching-scara", (50.70026, 0, -40, 0), "th2: {sign}150.00001 deg is outside -150..150 deg"),
        ("calibration-scara", (600, 0, 200, 0), None),
        ("calibration-scara", (600.1, 0, 200, 0), "shoulder to wrist 600.1 mm is outside 100..600 mm"),
        ("calibration-scara", (99.9, 0, 200, 0), "shoulder to wrist 99.9 mm is outside 100..600 mm"),
        ("calibration-scara", (204.07938, 0, 200, 0), None),
        ("calibration-scara", (204.07937, 0, 200, 0), "th2: {sign}145.000002 deg is outside -145..145 deg"),
        ("hybrid-arm", (550, 0, 600, 0), None),
        ("hybrid-arm", (550.1, 0, 600, 0), "waist to tool 550.1 mm is outside 250..550 mm"),
        ("hybrid-arm", (250, 0, 600, 0), None),
        ("hybrid-arm", (0, 249.9, 600, 0), "waist to tool 249.9 mm is outside 250..550 mm"),
    ],
)
def test_reach(name: str, pose: tuple[float, ...], reason: str | None) -> None:
    """By both elbows; for three robots the joints' limits end the reach before the links do."""
    kinematics = BY_NAME[name].kinematics
    for branch in kinematics.branches if name != "hybrid-arm" else kinematics.branches[:1]:
        solution = kinematics.solve(np.array([pose], dtype=np.float64), branch)
        sign = "-" if branch == "left" else ""
        assert solution.reachable.tolist() == [reason is None]
        told = str(solution.reason(0))
        if reason is not None:
            assert re.fullmatch(rf"{re.escape(reason.format(sign=sign))}, by [\d.e-]+ (mm|deg)", told)


@pytest.mark.parametrize(
    ("name", "radius_mm", "inwards"),
    [
        ("lab-scara", 812.3456789, True),
        ("teaching-scara", 195.1, True),
        ("teaching-scara", 4.87654321, False),
        ("calibration-scara", 99.9, False),
        ("hybrid-arm", 1234.5678, True),
        ("hybrid-arm", 249.987654321, False),
    ],
)
def test_a_step_by_the_distance_is_enough(name: str, radius_mm: float, inwards: bool) -> None:
    """Straight to the shoulder or away from it; half the distance is not enough."""
    kinematics = BY_NAME[name].kinematics
    height_mm = kinematics.forward(np.array([BY_NAME[name].posture]))[0, 2]

    def branch(at_mm: float) -> Branch:
        return kinematics.inverse(np.array([[at_mm, 0.0, height_mm, 0.0]]))[0]

    distance_mm = float(str(branch(radius_mm).reason(0)).rsplit(", by ", 1)[1].removesuffix(" mm"))
    sign = -1 if inwards else 1
    assert not str(branch(radius_mm + sign * distance_mm).reason(0)).startswith(("shoulder to wrist", "waist to tool"))
    assert str(branch(radius_mm + sign * distance_mm / 2).reason(0)).startswith(("shoulder to wrist", "waist to tool"))


@each_mechanism
def test_a_pose_out_of_reach_has_no_joints(mechanism: Mechanism) -> None:
    """The joints of the other poses are not affected."""
    poses = np.repeat(mechanism.kinematics.forward(np.array([mechanism.posture])), 3, axis=0)
    poses[1, 0] = 1e6
    for branch in mechanism.kinematics.inverse(poses, near=np.array(mechanism.posture)):
        assert np.isfinite(branch.joints).all(axis=1).tolist() == [True, False, True]
        assert branch.joints[0].tolist() == branch.joints[2].tolist()
        assert str(branch.reason(1)).startswith(("shoulder to wrist", "waist to tool"))
        assert not branch.reachable[1]


WIDE = [each for each in ALL if each is not WAREHOUSE]


@pytest.mark.parametrize("mechanism", WIDE, ids=lambda each: each.name)
@pytest.mark.parametrize(
    ("th4", "near", "found"),
    [
        pytest.param(100, None, 100, id="0 without near"),
        pytest.param(-260, None, 100, id="0 without near, from another turn"),
        pytest.param(100, -79.9, 100, id="just nearer"),
        pytest.param(100, -80.1, -260, id="just nearer one turn below"),
        pytest.param(-100, 79.9, -100, id="just nearer on the other side"),
        pytest.param(-100, 80.1, 260, id="just nearer one turn above"),
        pytest.param(100, 350, 100, id="nearest turn above the upper limit"),
        pytest.param(-100, -350, -100, id="nearest turn below the lower limit"),
        pytest.param(10, 5000, 10, id="near is turns away"),
        pytest.param(-10, 5000, 350, id="near is turns away, one turn is left"),
        pytest.param(0, 190, 360, id="the upper limit itself"),
        pytest.param(0, -190, -360, id="the lower limit itself"),
    ],
)
def test_a_wide_joint_takes_the_nearest_turn(
    mechanism: Mechanism, th4: float, near: float | None, found: float
) -> None:
    joints = mechanism.placed(3, th4)
    pose = mechanism.kinematics.forward(joints)
    standing = None if near is None else np.array(mechanism.placed(3, near)[0])
    branch = mechanism.kinematics.solve(pose, mechanism.own_branch(joints), standing)
    assert branch.joints[0, 3] == pytest.approx(found, abs=1e-9)
    assert branch.reachable.tolist() == [True]


def test_near_may_differ_from_pose_to_pose() -> None:
    joints = np.repeat(LAB.placed(3, 100.0), 3, axis=0)
    near = joints.copy()
    near[:, 3] = 0.0, -200.0, 300.0
    branch = LAB.kinematics.solve(LAB.kinematics.forward(joints), "right", near)
    assert branch.joints[:, 3] == pytest.approx([100.0, -260.0, 100.0])


def with_last_joint(mechanism: Mechanism, lower_deg: float, upper_deg: float) -> Kinematics:
    *others, last = mechanism.robot.joints
    limited = dataclasses.replace(last, lower=lower_deg, upper=upper_deg)
    return make_kinematics(dataclasses.replace(mechanism.robot, joints=(*others, limited)))


@pytest.mark.parametrize("mechanism", WIDE, ids=lambda each: each.name)
@pytest.mark.parametrize(
    ("lower_deg", "upper_deg", "th4", "found", "reachable"),
    [
        pytest.param(0, 200, 190, 190, True, id="beyond half a turn"),
        pytest.param(0, 200, -150, -150, False, id="below the lower limit"),
        pytest.param(0, 200, 210, -150, False, id="above the upper limit"),
        pytest.param(-200, 0, -190, -190, True, id="beyond half a turn the other way"),
        pytest.param(-200, 0, 150, 150, False, id="above the upper limit, the other way"),
        pytest.param(-180, 180, 190, -170, True, id="a whole circle"),
        pytest.param(-180, 180, -190, 170, True, id="a whole circle the other way"),
    ],
)
def test_a_joint_that_turns_by_a_circle_or_less(
    mechanism: Mechanism, lower_deg: float, upper_deg: float, th4: float, found: float, reachable: bool
) -> None:
    """If no turn is within the limits, the angle stays in (-180, 180]."""
    joints = mechanism.placed(0, -100.0) if mechanism is HYBRID else mechanism.placed(3, 0.0)
    joints[0, 3] = th4
    branch = with_last_joint(mechanism, lower_deg, upper_deg).solve(
        mechanism.kinematics.forward(joints), mechanism.own_branch(joints)
    )
    assert branch.joints[0, 3] == pytest.approx(found)
    assert branch.reachable.tolist() == [reachable]


@each_mechanism
def test_near_moves_nothing_but_slides_and_wide_joints(mechanism: Mechanism) -> None:
    """Wherever the machine stands, the pose determines all other joints."""
    posture = np.array(mechanism.posture)
    pose = mechanism.kinematics.forward(posture[np.newaxis])
    turn = np.array([360.0 if joint.unit is Unit.DEG else 0.0 for joint in mechanism.robot.joints])
    expected = posture.copy()
    if mechanism is not WAREHOUSE:
        expected[3] -= 360.0
    for near in (posture - turn, posture - 3 * turn):
        branch = mechanism.kinematics.solve(pose, mechanism.kinematics.branches[0], near)
        assert branch.joints[0] == pytest.approx(expected, abs=1e-9)
