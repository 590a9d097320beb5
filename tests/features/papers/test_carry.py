"""The classroom robot's carry job: the paper's cubic and quintic, and gripping with repetitions."""

import numpy as np
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from tests.host.complaints import complaint_of
from tests.messages import refusing

ROBOT = load_robot("teaching-scara")
SCARA = make_kinematics(ROBOT)

GOLDEN_CUBIC = """
0.000   -0.003552338   0.010198649   -0.006703606  194.999999145   0.005710000
0.150   -1.821368072   5.244858321   -3.423544064  194.773546708   2.952128885
0.300   -6.466897170  18.622321927  -12.155469678  192.153524466  10.356662029
0.495  -14.740584493  42.447584611  -27.707029196  180.407020377  22.322933819
0.750  -25.250993086  72.713805206  -47.462821072  153.529396001  33.158349349
0.900  -29.088604080  83.764753403  -54.676150927  140.837279949  35.404347126
0.990  -29.917528054  86.151758213  -56.234230176  137.920606143  35.750139461
1.000  -29.926445076  86.177436050  -56.250990974  137.888910092  35.753580548
"""
"""Rows of t, th1, th2, th4, x, y."""

GOLDEN_QUINTIC = {
    10: (-0.822151427, 2.367471477, -1.545375779),
    33: (-14.964998707, 43.093817349, -28.128847290),
    50: (-27.063198215, 77.932308340, -50.869115608),
}
"""th1, th2, th4 at step k of 66 in 0.99 s."""


def carry(**options: str) -> Motion:
    return make_job(ROBOT, "carry", options)


@pytest.mark.parametrize("line", GOLDEN_CUBIC.split("\n")[1:-1])
def test_golden_points_of_the_cubic(line: str) -> None:
    t_s, th1, th2, th4, x_mm, y_mm = map(float, line.split())
    joints = carry().positions(np.array([t_s]))
    assert joints[0] == pytest.approx([th1, th2, 0.0, th4], abs=1e-6)
    assert SCARA.forward(joints)[0, :2] == pytest.approx([x_mm, y_mm], abs=1e-6)


def test_golden_points_of_the_quintic() -> None:
    joints = carry(law="quintic", duration_s="0.99").positions(np.arange(67.0) * 0.99 / 66)
    for k, expected in GOLDEN_QUINTIC.items():
        assert joints[k, [0, 1, 3]] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("options", "peaks_deg_s"),
    [
        ({}, (44.884339, 129.250856, 84.366431)),
        ({"law": "quintic", "duration_s": "0.99"}, (56.672145, 163.195525, 106.523272)),
    ],
)
def test_peak_speeds_are_half_way(options: dict[str, str], peaks_deg_s: tuple[float, ...]) -> None:
    motion = carry(**options)
    speeds = np.abs(motion.velocities(np.linspace(0.0, motion.duration_s, 2001)))
    assert speeds.max(axis=0)[[0, 1, 3]] == pytest.approx(peaks_deg_s, abs=1e-6)
    assert np.argmax(speeds[:, 1]) == 1000


def test_the_attitude_stays() -> None:
    """At qa and qb, th1 + th2 + th4 is 0 within a millionth of a radian."""
    poses = SCARA.forward(carry().positions(np.linspace(0.0, 1.0, 101)))
    assert np.abs(poses[:, 3]).max() < np.rad2deg(1.1e-6)


def test_the_papers_goal_belongs_to_another_arm() -> None:
    """The paper's goal fits links with the ratio 5 : 3, not 95 : 100: cos th1, th2, th4 are 13/15, 1/15, 5/9."""
    goal_rad = np.deg2rad(carry().positions(np.array([1.0]))[0])
    assert np.cos(goal_rad[[0, 1, 3]]) == pytest.approx([13 / 15, 1 / 15, 5 / 9], abs=4e-7)


def test_repetitions_go_forth_and_back() -> None:
    motion = carry(repetitions="3")
    assert motion.duration_s == 5.0
    ends = motion.positions(np.arange(6.0))
    assert ends[::2] == pytest.approx(np.tile(ends[0], (3, 1)))
    assert ends[1::2] == pytest.approx(np.tile(ends[1], (3, 1)))
    assert motion.output_changes == ()


def test_the_gripper_switches_only_when_lowered() -> None:
    motion = carry(depth_mm="20", repetitions="2")
    assert [(s.output, s.on) for s in motion.output_changes] == [("gripper", True), ("gripper", False)] * 2
    for switching in motion.output_changes:
        t_s = np.linspace(switching.from_s, switching.until_s, 50)
        assert motion.positions(t_s)[:, 2] == pytest.approx(np.full(50, 20.0))
        assert np.abs(motion.velocities(t_s)).max() < 1e-9
    carried_s = np.linspace(motion.output_changes[0].until_s, motion.output_changes[1].from_s, 1000)
    turning = np.abs(motion.velocities(carried_s)[:, 0]) > 1e-6
    assert np.abs(motion.positions(carried_s)[turning, 2]).max() < 1e-9  # carried at the top
    plan(ROBOT, motion)


def entered(**options: str) -> Motion:
    return make_job(ROBOT, "carry", {"from": "150,60", "to": "100,-50", **options})


@pytest.mark.parametrize(("elbow", "sign"), [("right", 1.0), ("left", -1.0)])
@pytest.mark.parametrize("law", ["cubic", "quintic"])
def test_points_are_entered_and_reached_by_either_arm(elbow: str, sign: float, law: str) -> None:
    motion = entered(elbow=elbow, law=law, duration_s="2")
    joints = motion.positions(np.array([0.0, 1.0, 2.0]))
    assert SCARA.forward(joints[[0, 2]]) == pytest.approx(np.array([[150, 60, -40, 0], [100, -50, -40, 0]]), abs=1e-9)
    assert (np.sign(joints[:, 1]) == sign).all()
    assert joints[1] == pytest.approx((joints[0] + joints[2]) / 2)
    plan(ROBOT, motion)


def test_one_point_may_stay_the_papers() -> None:
    to_point = make_job(ROBOT, "carry", {"from": "qa", "to": "100, -50"})
    assert to_point.positions(np.zeros(1)).tolist() == carry().positions(np.zeros(1)).tolist()
    assert SCARA.forward(to_point.positions(np.ones(1)))[0, :2] == pytest.approx([100.0, -50.0])
    left = carry(elbow="left").positions(np.array([0.0, 1.0]))
    assert np.deg2rad(left[1]) == pytest.approx([1.029725762, -1.504080, 0.0, 0.474354238], abs=1e-8)
    assert np.deg2rad(left[0]) == pytest.approx([0.000120564, -0.000178, 0.0, 0.000056436], abs=1e-8)


@pytest.mark.parametrize(
    "options",
    [
        {"to": "195.1,0"},
        {"to": "-150,60", "elbow": "left"},
        {"from": "150"},
        {"from": "150,nan"},
        {"from": "qb"},
        {"from_": "1,2"},
    ],
)  # fmt: skip
def test_points_that_cannot_be(options: dict[str, str]) -> None:
    complaint_of(lambda: entered(**options))


def test_the_other_arm_is_named_if_it_reaches_the_point() -> None:
    complaint_of(lambda: entered(to="-150,60", elbow="left"))


def test_too_fast_is_refused() -> None:
    """The cubic's th2 needs 129.25 deg/s and 517 deg/s^2 for 1 s; for 0.72 s it needs just under its 180 deg/s."""
    plan(ROBOT, carry(duration_s="0.72"))
    with refusing(InputError):
        plan(ROBOT, carry(duration_s="0.71"))
    with refusing(InputError):
        carry(repetitions="1.5")
    with refusing(InputError):
        carry(depth_mm="61")
