"""The hybrid arm's helix and five points."""

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.jobs.five_points import POSES
from steptwin.host.planning.planner import plan
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics

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

GOLDEN_POINTS = (
    (0.000000000, 3.772233983, 3.772233983),
    (23.198590514, -104.644925490, -86.378068442),
    (-39.805571092, 49.443855311, 58.449470912),
    (119.744881297, -44.732336609, -47.685656202),
    (14.036243468, 169.827384518, 74.384689891),
)
"""th1, Z5, Z6."""


def helix(**options: str) -> Trajectory:
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


def test_too_fast_a_helix_is_refused() -> None:
    plan(ROBOT, helix(duration_s="60"))
    with pytest.raises(
        InputError, match=r"^th1: a mean acceleration over 1 ms of 667\.9 deg/s\^2 at t = 0\.000 s is more"
    ):
        plan(ROBOT, helix(duration_s="18.5"))
    with pytest.raises(
        InputError,
        match=r"^Z6: \d+\.\d+ kHz of steps at t = \d+\.\d+ s is more than the driver's 15\.0 kHz; [\d.]+ times slower",
    ):
        plan(ROBOT, helix(duration_s="15"))


def test_five_points() -> None:
    trajectory = make_job(ROBOT, "five-points", {})
    t_s = np.arange(0.0, trajectory.duration_s, 0.01)
    resting = np.abs(trajectory.velocities(t_s)).max(axis=1) == 0
    visited = np.unique(trajectory.positions(t_s[resting]).round(6), axis=0)
    expected = [(th1, z5, z6, -th1) for th1, z5, z6 in GOLDEN_POINTS]
    assert visited == pytest.approx(np.array(sorted(expected)), abs=1.1e-6)
    ends = ARM.forward(trajectory.positions(np.array([0.0, trajectory.duration_s])))
    assert ends == pytest.approx(np.array([POSES[0], POSES[-1]]), abs=1e-9)
    plan(ROBOT, trajectory)
