"""The drawer pull against reference figures, computed independently from the paper's geometry."""

import dataclasses

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import job_names, job_options, make_job
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from tests.host.complaints import complaint_of
from tests.messages import refusing

ROBOT = load_robot("warehouse-scara")
SCARA = make_kinematics(ROBOT)
SAMPLES_S = np.arange(1001) / 100

RIGHT_TABLE = [
    (0, 169.903810568, 0.000000000, 60.000000000, 30.000000000),
    (1, 164.278810568, -1.598764958, 61.564419309, 30.034345649),
    (2, 147.403810568, -6.258938357, 65.731725269, 30.527213088),
    (3, 124.903810568, -12.205257204, 70.190477795, 32.014779409),
    (4, 102.403810568, -17.884129344, 73.521595924, 34.362533420),
    (5, 79.903810568, -23.298304550, 75.801112147, 37.497192403),
    (6, 57.403810568, -28.421935134, 77.067781321, 41.354153813),
    (7, 34.903810568, -33.209101074, 77.338957468, 45.870143606),
    (8, 12.403810568, -37.600376642, 76.617987690, 50.982388952),
    (9, -4.471189432, -40.593526388, 75.421190190, 55.172336198),
    (10, -10.096189432, -41.528098726, 74.895689865, 56.632408861),
]
LEFT_TABLE = [
    (0, 169.903810568, 50.569992092, -60.000000000, 99.430007908),
    (10, -10.096189432, 20.879608989, -74.895689865, 144.016080876),
]


def pull(**options: str) -> Motion:
    return make_job(ROBOT, "pull-line", options)


def step_counts(joints: FloatArray) -> FloatArray:
    return np.floor(joints * ROBOT.steps_per_unit + 0.5)


@pytest.mark.parametrize(("elbow", "table"), [("right", RIGHT_TABLE), ("left", LEFT_TABLE)])
def test_the_table(elbow: str, table: list[tuple[float, ...]]) -> None:
    t_s, y_mm, *arm_deg = np.array(table, dtype=np.float64).T
    joints = pull(elbow=elbow).positions(t_s)
    assert joints[:, 3:] == pytest.approx(np.column_stack(arm_deg), abs=1e-6)
    assert joints[:, :3].tolist() == [[0.0, 0.0, 100.0]] * len(table)
    assert SCARA.forward(joints)[:, 1] == pytest.approx(y_mm, abs=1e-8)


@pytest.mark.parametrize("elbow", ["right", "left"])
def test_the_tool_stays_on_its_line(elbow: str) -> None:
    poses = SCARA.forward(pull(elbow=elbow).positions(SAMPLES_S))
    assert np.abs(poses[:, [0, 2, 3]] - [275.0, 60.0, 90.0]).max() < 1e-9
    assert poses[0, 1] - poses[-1, 1] == pytest.approx(180.0, abs=1e-9)
    assert np.all(np.diff(poses[:, 1]) < 0)


@pytest.mark.parametrize(
    ("elbow", "start", "end", "pulses"),
    [
        ("right", (0, 2667, 800), (-1846, 3329, 1510), (1846, 880, 710)),
        ("left", (2248, -2667, 2651), (928, -3329, 3840), (1320, 880, 1189)),
    ],
)
@pytest.mark.parametrize("samples", [1001, 10_001])
def test_counts(
    elbow: str, start: tuple[int, ...], end: tuple[int, ...], pulses: tuple[int, ...], samples: int
) -> None:
    counts = step_counts(pull(elbow=elbow).positions(np.linspace(0.0, 10.0, samples)))
    assert counts[0].tolist() == [0, 0, 32_000, *start]
    assert counts[-1].tolist() == [0, 0, 32_000, *end]
    assert np.abs(np.diff(counts, axis=0)).sum(axis=0).tolist() == [0, 0, 0, *pulses]


def test_poses_from_whole_steps() -> None:
    """Error of the tool with every joint at its nearest whole step."""
    joints = pull().positions(SAMPLES_S)
    off = SCARA.forward(step_counts(joints) / ROBOT.steps_per_unit) - SCARA.forward(joints)
    assert np.hypot(off[:, 0], off[:, 1]).max() == pytest.approx(0.089622, abs=1e-6)
    assert np.abs(off[:, 0]).max() == pytest.approx(0.063509, abs=1e-6)
    assert np.abs(off[:, 3]).max() == pytest.approx(0.0375, abs=1e-6)


def test_speeds() -> None:
    """The reference figures are means over 10 ms; the highest speed, at the end of a ramp, is slightly above."""
    motion = pull()
    means = np.abs(np.diff(motion.positions(SAMPLES_S), axis=0)).max(axis=0) / 0.01
    assert means[3:] == pytest.approx([6.088993, 5.056419, 5.387523], abs=1e-6)
    momentary = np.abs(motion.velocities(np.arange(10_001) / 1000)).max(axis=0)
    assert np.all(momentary[3:] > means[3:])
    assert momentary[3:] == pytest.approx(means[3:], rel=2e-3)


def test_in_one_second_it_is_ten_times_as_fast() -> None:
    fast = pull(duration_s="1", ramp_s="0.2")
    mean = np.abs(np.diff(fast.positions(SAMPLES_S / 10), axis=0)).max(axis=0) / 0.001
    assert mean[3] == pytest.approx(60.889931, abs=1e-5)
    assert mean[3] * ROBOT.steps_per_unit[3] == pytest.approx(2706, abs=1)
    assert fast.positions(SAMPLES_S / 10) == pytest.approx(pull().positions(SAMPLES_S), abs=1e-9)


@pytest.mark.parametrize("elbow", ["right", "left"])
def test_velocities_are_the_derivatives(elbow: str) -> None:
    motion = pull(elbow=elbow)
    t_s = np.setdiff1d(SAMPLES_S[1:-1], motion.breakpoints_s)
    h = 1e-4
    differences = (motion.positions(t_s + h) - motion.positions(t_s - h)) / (2 * h)
    assert motion.velocities(t_s) == pytest.approx(differences, abs=1e-6)
    assert np.abs(motion.velocities(np.array([0.0, 10.0]))).max() == 0.0
    assert motion.breakpoints_s == (2.0, 8.0)


def test_the_elbow_opens_until_the_wrist_passes_the_shoulder() -> None:
    """There the wrist is 275 mm from the shoulder: cos th2 = (275^2 - 200^2 - 150^2) / (2 200 150) = 0.21875."""
    t_s = np.linspace(6.5, 7.0, 50_001)
    joints = pull().positions(t_s)
    widest = int(np.argmax(joints[:, 4]))
    assert joints[widest, 4] == pytest.approx(np.rad2deg(np.arccos(0.21875)), abs=1e-9)
    assert SCARA.forward(joints[[widest]])[0, 1] == pytest.approx(40.0, abs=1e-3)
    assert pull().positions(SAMPLES_S)[:, 4].max() == pytest.approx(77.364369, abs=1e-6)


def test_an_arc_cosine_for_the_wrist_direction_fails_the_pull() -> None:
    """The printed alpha = acos(x / r) loses the sign of y when the wrist is on the near side of the shoulder."""
    joints = pull().positions(SAMPLES_S)
    planned = SCARA.forward(joints)
    wrist_y = planned[:, 1] - 40.0
    alpha_deg = np.rad2deg(np.arctan2(wrist_y, 275.0))
    printed = joints.copy()
    printed[:, 3] += np.abs(alpha_deg) - alpha_deg
    printed[:, 5] = 90.0 - printed[:, 3] - printed[:, 4]
    error_mm = np.hypot(*(SCARA.forward(printed) - planned)[:, :2].T)
    assert error_mm[-1] == error_mm.max() == pytest.approx(100.192379, abs=1e-6)
    assert error_mm[SAMPLES_S < 6.77].max() < 1e-9
    assert error_mm[SAMPLES_S > 6.78].min() > 0.01


class TestOptions:
    def test_slides_and_lift_shift_the_pull(self) -> None:
        motion = pull(sx_mm="1000", sz_mm="250.5", L1_mm="150")
        joints = motion.positions(SAMPLES_S)
        assert np.abs(joints[:, :3] - [1000.0, 250.5, 150.0]).max() < 1e-9
        assert joints[:, 3:] == pytest.approx(pull().positions(SAMPLES_S)[:, 3:], abs=1e-9)
        assert SCARA.forward(joints[:1])[0] == pytest.approx([1275.0, 169.903810568, 360.5, 90.0])

    def test_they_are_described_with_default_and_range(self) -> None:
        assert job_names(ROBOT) == ("drawer-pull", "store", "fetch", "every-slot", "pull-line")
        assert job_options(ROBOT, "pull-line") == {
            "elbow": "right (right, left)",
            "duration_s": "10 (0.002..600 s)",
            "ramp_s": "2 (0.001..300 s)",
            "sx_mm": "0 (0..2000 mm)",
            "sz_mm": "0 (0..1000 mm)",
            "L1_mm": "100 (50..200 mm)",
            "travel_mm": "180 (1..1000 mm)",
            "compartments": "3 (1..3 compartments)",
            "law": "planned (planned, fastest)",
        }

    @pytest.mark.parametrize(
        ("name", "value", "message"),
        [
            ("elbo", "left", "option 'elbo' is unknown: did you mean elbow?"),
            (
                "colour",
                "red",
                "option 'colour' is unknown: there are elbow, duration_s, ramp_s, sx_mm, sz_mm, L1_mm, travel_mm,"
                " compartments",
            ),
            ("elbow", "lft", "option elbow: 'lft' is unknown: did you mean left? (valid: right, left)"),
            ("duration_s", "soon", "option duration_s: 'soon' is not a number (valid: 0.002..600 s)"),
            ("duration_s", "600.001", "option duration_s: 600.001 s is outside 0.002..600 s; the nearest is 600 s"),
            ("duration_s", "nan", "option duration_s: nan s is outside 0.002..600 s"),
            ("duration_s", "1.0005", "duration_s: 1.0005 s is not a whole number of milliseconds: the nearest is 1 s"),
            ("ramp_s", "5.001", "ramp_s: 5.001 s is not above 0 and at most 5 s, half of duration_s"),
            ("sx_mm", "-0.1", "option sx_mm: -0.1 mm is outside 0..2000 mm; the nearest is 0 mm"),
            ("L1_mm", "200.1", "option L1_mm: 200.1 mm is outside 50..200 mm; the nearest is 200 mm"),
            ("L1_mm", "49.9", "option L1_mm: 49.9 mm is outside 50..200 mm; the nearest is 50 mm"),
        ],
    )
    def test_mistakes(self, name: str, value: str, message: str) -> None:
        told = complaint_of(lambda: pull(**{name: value}))
        assert told == message

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("name", "value"), [("L1_mm", "200"), ("L1_mm", "50"), ("ramp_s", "5"), ("sx_mm", "2e3"), ("duration_s", "600")]
    )
    def test_the_ends_of_the_ranges(self, name: str, value: str) -> None:
        motion = pull(**{name: value})
        assert np.isfinite(motion.positions(np.array([0.0, motion.duration_s]))).all()

    def test_an_unknown_job(self) -> None:
        with refusing(InputError):
            make_job(ROBOT, "drawer-push", {})
        with refusing(InputError):
            job_options(ROBOT, "x")


def test_the_error_for_too_small_a_robot_says_where_it_ends() -> None:
    small = dataclasses.replace(ROBOT, geometry={"L2_mm": 50, "L3_mm": 50, "L4_mm": 40, "L5_mm": 40})
    with refusing(InputError):
        plan(small, make_job(small, "pull-line", {"travel_mm": "180"}))
    plan(small, make_job(small, "pull-line"))


def test_a_kind_without_jobs() -> None:
    other = dataclasses.replace(ROBOT, kinematics="other")
    assert job_names(other) == ()
    with refusing(InputError):
        make_job(other, "spiral", {})


@pytest.mark.parametrize(("compartments", "way_mm"), [("1", 60.0), ("2", 120.0), ("3", 180.0)])
def test_the_drawer_comes_out_by_compartments(compartments: str, way_mm: float) -> None:
    motion = pull(compartments=compartments, duration_s="8")
    ends = SCARA.forward(motion.positions(np.array([0.0, 8.0])))
    assert ends[1] - ends[0] == pytest.approx([0.0, -way_mm, 0.0, 0.0], abs=1e-9)
    half = SCARA.forward(pull(compartments=compartments, travel_mm="90").positions(np.array([10.0])))[0]
    assert half[1] == pytest.approx(169.903810568 - way_mm / 2)


def test_there_are_three_compartments() -> None:
    complaint_of(lambda: pull(compartments="4"))
