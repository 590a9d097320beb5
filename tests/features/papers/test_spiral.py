"""The laboratory robot's spiral: the paper's 377 points, both elbows, both laws of rise."""

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from tests.host.complaints import complaint_of
from tests.messages import refusing

ROBOT = load_robot("lab-scara")
SCARA = make_kinematics(ROBOT)
SAMPLES_S = np.arange(377.0) * 0.05

GOLDEN_RIGHT = """
0    -300.000000000  400.000000000  0.000  150.000  -14.447914901  102.635625093  178.187710192
47   -308.256878652  408.359811895  1.175  151.175  -13.193404665  100.482626943  177.289222279
94   -300.291133591  376.501803447  2.350  152.350  -14.412437910  105.975353686  181.562915777
141  -274.615613898  424.458034309  3.525  153.525  -17.904974451  101.614021048  173.709046597
188  -346.985572976  401.164444996  4.700  154.700   -7.612193941   96.940457612  179.328263670
235  -259.763868795  357.190932670  5.875  155.875  -20.464424527  112.981213185  182.516788658
282  -297.380333872  470.451311907  7.050  157.050  -13.619251902   91.833867598  168.214615696
329  -360.625955525  344.416225239  8.225  158.225   -5.122498420  102.879124460  187.756626040
376  -206.115398481  395.343649757  9.400  159.400  -28.594433304  112.260114816  173.665681513
"""
"""Rows of k, x, y, z, d1, th2, th3, th4."""

GOLDEN_LEFT = {
    0: (88.187710192, -102.635625093, 75.552085099),
    188: (89.328263670, -96.940457612, 82.387806059),
    376: (83.665681513, -112.260114816, 61.405566696),
}


def spiral(**options: str) -> Motion:
    return make_job(ROBOT, "spiral", options)


def counts(joints: FloatArray) -> FloatArray:
    return np.asarray(np.floor(joints * ROBOT.steps_per_unit + 0.5))


@pytest.mark.parametrize("line", GOLDEN_RIGHT.split("\n")[1:-1])
def test_golden_points(line: str) -> None:
    k, *numbers = map(float, line.split())
    joints = spiral().positions(np.array([0.05 * k]))
    assert joints[0] == pytest.approx(numbers[3:], abs=1e-6)
    assert SCARA.forward(joints)[0] == pytest.approx([*numbers[:3], 0.0], abs=1e-6)


def test_golden_points_of_the_left_elbow() -> None:
    joints = spiral(elbow="left").positions(SAMPLES_S)
    for k, expected in GOLDEN_LEFT.items():
        assert joints[k, 1:] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("elbow", "ends", "pulses"),
    [
        ("right", [(12000, -642, 4562, 1584), (12752, -1271, 4989, 1544)], (752, 3747, 4523, 772)),
        ("left", [(12000, 3919, -4562, 672), (12752, 3718, -4989, 546)], (752, 3853, 4523, 752)),
    ],
)
def test_rounded_targets(elbow: str, ends: list[tuple[int, ...]], pulses: tuple[int, ...]) -> None:
    targets = counts(spiral(elbow=elbow).positions(SAMPLES_S))
    assert tuple(targets[0]) == ends[0]
    assert tuple(targets[-1]) == ends[1]
    assert tuple(np.abs(np.diff(targets, axis=0)).sum(axis=0)) == pulses


def test_ranges_and_speeds_of_the_samples() -> None:
    joints = spiral().positions(SAMPLES_S)
    assert joints.min(axis=0) == pytest.approx([150, -28.594433, 88.283613, 168.112480], abs=1e-6)
    assert joints.max(axis=0) == pytest.approx([159.4, -3.049337, 118.290277, 191.045104], abs=1e-6)
    speeds = np.abs(np.diff(joints, axis=0) / 0.05).max(axis=0)
    assert speeds == pytest.approx([0.5, 14.098802, 15.023481, 14.750782], abs=1e-6)


def test_law_b_changes_the_lift_only() -> None:
    a, b = spiral().positions(SAMPLES_S), spiral(z_law="B").positions(SAMPLES_S)
    assert b[:, 1:] == pytest.approx(a[:, 1:], abs=1e-12)
    assert b[-1, 0] == pytest.approx(209.061942, abs=1e-6)
    assert counts(b)[[0, -1], 0].tolist() == [12000, 16725]


def test_psi_turns_the_tool_only() -> None:
    """With psi = 90 deg, th4 = th2 + th3, the other reading of the paper."""
    joints = spiral(psi_deg="90").positions(SAMPLES_S)
    assert joints[:, 3] == pytest.approx(joints[:, 1] + joints[:, 2], abs=1e-9)


def test_between_the_points_it_stays_on_the_spiral() -> None:
    """The spline is within 0.05 mm of the curve, except in the first and last tenths of a second."""
    t_s = np.linspace(0.5, 18.3, 20_001)
    poses = SCARA.forward(spiral().positions(t_s))
    curve = np.column_stack([-300 + 5 * t_s * np.cos(t_s), 400 + 5 * t_s * np.sin(t_s), t_s / 2])
    assert np.linalg.norm(poses[:, :3] - curve, axis=1).max() < 0.05


def test_it_ends_with_the_last_point_at_rest() -> None:
    motion = spiral()
    assert motion.duration_s == 18.8
    assert motion.velocities(np.array([0.0, 18.8])) == pytest.approx(np.zeros((2, 4)), abs=1e-9)
    assert plan(ROBOT, motion).times_ms[-1] == 18_800


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"point_s": "0.0505"}, "point_s: 0.0505 s is not a whole number of milliseconds"),
        ({"z_law": "C"}, "option z_law: 'C' is unknown: there are A, B (valid: A, B)"),
        ({"x_mm": "-800"}, "at t = 0.000 s the tool's path breaks off: shoulder to wrist 894.4 mm"),
        (
            {"x_mm": "0", "y_mm": "0"},
            "at t = 0.000 s the tool's path breaks off: th3: near singular, |sin th3| 0.00 is outside 0.005..1",
        ),
    ],
)
def test_options_that_are_refused(options: dict[str, str], words: str) -> None:
    told = complaint_of(lambda: spiral(**options))
    assert told.startswith(words)


def test_too_near_the_base_is_beyond_a_joints_limit() -> None:
    """Nearer than 338.095 mm th3 would have to bend by more than 130 deg."""
    with refusing(InputError):
        plan(ROBOT, spiral(x_mm="-250", y_mm="250"))
