"""The hybrid arm's helix and five points."""

import numpy as np
import pytest

from steptwin.features.papers.hybrid_jobs import five_poses
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot
from tests.features.papers.loop_closure import LoopClosure
from tests.host.robots.kinematics.changed import with_geometry
from tests.messages import refusing

ROBOT = load_robot("hybrid-arm")
ARM = make_kinematics(ROBOT)

GOLDEN_HELIX = """
0   430  150  500  19.230672376  -63.383045955  -116.976396230
10  270  150  530  29.054604099  -95.013698445    -3.684439122
20  430  150  560  19.230672376   -3.383045955   -56.976396230
40  430  150  620  19.230672376   56.616954045     3.023603770
60  430  150  680  19.230672376  116.616954045    63.023603770
70  270  150  710  29.054604099   84.986301555   176.315560878
80  430  150  740  19.230672376  176.616954045   123.023603770
"""
"""Rows of t, X, Y, Z, th1, Z5, Z6."""

GOLDEN_POINTS = """
430.000000000 150.000000000 500  19.230672376  -63.383045955  -116.976396230
374.721359550  73.915478695 548  11.158598200  -56.177947770   -39.012159960
285.278640450 102.977179817 596  19.848088130  -29.918461940    67.732153120
285.278640450 197.022820183 644  34.630235450   27.623975490    79.097035910
374.721359550 226.084521305 692  31.104276180  116.550222930    80.525075780
"""
"""Rows of X, Y, Z, th1, Z5, Z6 at 0, 288, 576, 864 and 1152 degrees around the helix: every fifth of its four turns."""


def helix(**options: str) -> Motion:
    return make_job(ROBOT, "helix", options)


def curve(t_s: FloatArray) -> FloatArray:
    w = 2 * np.pi * t_s / 20
    return np.column_stack([350 + 80 * np.cos(w), 150 + 80 * np.sin(w), 500 + 3 * t_s])


@pytest.mark.parametrize("line", GOLDEN_HELIX.split("\n")[1:-1])
def test_golden_points_of_the_helix(line: str) -> None:
    t_s, x_mm, y_mm, z_mm, *joints = map(float, line.split())
    reached = helix().positions(np.array([t_s]))
    assert reached[0] == pytest.approx([*joints, -joints[0]], abs=1e-6)
    assert ARM.forward(reached)[0] == pytest.approx([x_mm, y_mm, z_mm, 0.0], abs=1e-6)


def test_pulses_of_the_samples() -> None:
    """The paper samples at k T / 240, the job at the nearest whole milliseconds; the pulses are the same."""
    t_s = np.arange(241) / 3
    poses = np.column_stack([curve(t_s), np.zeros(241)])
    joints = ARM.solve(poses, "(+,+)").joints
    targets = np.floor(joints * ROBOT.steps_per_unit + 0.5)
    assert targets[[0, -1]].tolist() == [[855, -10141, -18716, -171], [855, 28259, 19684, -171]]
    assert np.abs(np.diff(targets, axis=0)).sum(axis=0).tolist() == [8624, 90328, 122392, 1728]
    fine = np.floor(helix().positions(np.linspace(0, 80, 24_001)) * ROBOT.steps_per_unit + 0.5)
    assert np.abs(np.diff(fine, axis=0)).sum(axis=0).tolist() == [8624, 90376, 122432, 1728]


def test_between_the_samples_the_tip_stays_on_the_helix() -> None:
    """Splines without rest at the ends are within 0.011347 mm; those at rest differ more in the outer steps."""
    t_s = np.linspace(2.0, 78.0, 24_001)
    off_mm = np.linalg.norm(ARM.forward(helix().positions(t_s))[:, :3] - curve(t_s), axis=1)
    assert 0.005 < off_mm.max() < 0.0115


def test_it_starts_and_ends_at_rest() -> None:
    assert np.abs(helix().velocities(np.array([0.0, 80.0]))).max() < 1e-9
    plan(ROBOT, helix())


@pytest.mark.slow
def test_too_fast_a_helix_is_refused() -> None:
    plan(ROBOT, helix(duration_s="60"))
    with refusing(InputError):
        plan(ROBOT, helix(duration_s="18.5"))
    with refusing(InputError):
        plan(ROBOT, helix(duration_s="15"))


def five_points_of(robot: Robot, **options: str) -> tuple[Motion, FloatArray]:
    """Return the job and the joints at its rests, of shape (points, 4), in order of time."""
    motion = make_job(robot, "five-points", options)
    t_s = np.arange(0.0, motion.duration_s, 0.01)
    resting = t_s[np.abs(motion.velocities(t_s)).max(axis=1) == 0]
    joints = motion.positions(resting).round(6)
    return motion, joints[np.concatenate([[True], np.abs(np.diff(joints, axis=0)).max(axis=1) > 1e-3])]


def test_the_five_points_are_on_the_helix() -> None:
    motion, visited = five_points_of(ROBOT)
    rows = np.array([line.split() for line in GOLDEN_POINTS.split("\n")[1:-1]], dtype=np.float64)
    assert visited == pytest.approx(np.column_stack([rows[:, 3:], -rows[:, 3]]), abs=1.1e-6)
    assert ARM.forward(visited)[:, :3] == pytest.approx(rows[:, :3], abs=1e-5)
    assert helix().positions(np.linspace(0.0, 64.0, 5)) == pytest.approx(visited, abs=1.1e-6)
    plan(ROBOT, motion)


def test_the_helix_is_an_option_of_both() -> None:
    """Two turns of radius 50 about (380, 20) from 520, 30 up at each; at three quarters of the way y is 20 - 0."""
    curve_options = {"x_mm": "380", "y_mm": "20", "z_mm": "520", "radius_mm": "50", "rise_mm": "30", "turns": "2"}
    _, visited = five_points_of(ROBOT, **curve_options)
    angles = 2.0 * np.pi * 2 * np.arange(5) / 5
    expected = np.column_stack([380 + 50 * np.cos(angles), 20 + 50 * np.sin(angles), 520 + 60 * np.arange(5) / 5])
    assert ARM.forward(visited)[:, :3] == pytest.approx(expected, abs=1e-5)
    motion = helix(**curve_options, duration_s="40", samples="9")
    eighths = ARM.forward(motion.positions(np.linspace(0.0, 40.0, 9)))[:, :3]
    assert eighths[2] == pytest.approx([330.0, 20.0, 535.0], abs=1e-6)
    assert eighths[7] == pytest.approx([380.0, -30.0, 572.5], abs=1e-6)


def test_more_samples_than_milliseconds_are_refused() -> None:
    helix(duration_s="1", samples="1001", radius_mm="1", rise_mm="1", turns="1")
    with refusing(InputError):
        helix(duration_s="1", samples="1002", radius_mm="1", rise_mm="1", turns="1")


def test_other_dimensions_have_points_of_their_own() -> None:
    """Screws 200 mm apart, links of 240 mm, 200 mm out to the tool: the loop of the mechanism closes at the joints."""
    robot = with_geometry(ROBOT, h_mm=100.0, L_mm=240.0, l3_mm=200.0, z2_max_mm=130.0)
    motion, visited = five_points_of(robot)
    poses = five_poses(robot)
    assert len(np.unique(poses.round(3), axis=0)) == len(visited) == 5
    assert LoopClosure.of(robot).driven_at_the_joints(visited).poses == pytest.approx(poses, abs=1e-5)
    plan(robot, motion)
    plan(robot, make_job(robot, "helix", {}))
