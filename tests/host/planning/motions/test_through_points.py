"""Points without velocities: splines, and pauses where a point repeats."""

import numpy as np
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.planning.motions.composer import Sequence
from steptwin.host.planning.motions.sampled import Spline
from steptwin.host.planning.trajectory_file.file_motion import through_points
from tests.messages import refusing

NAMES = ("a", "b")
PLACES = [f"line {i}" for i in range(2, 12)]


def test_without_repeats_it_is_one_spline() -> None:
    motion = through_points(NAMES, np.array([0.0, 0.5, 1.0]), np.array([[0.0, 0], [1, 2], [3, 2]]), PLACES[:3])
    assert isinstance(motion.law, Spline)


def test_it_stands_where_points_repeat() -> None:
    times_s = np.array([0.0, 0.3, 1.0, 1.5, 2.0, 2.5])
    positions = np.array([[0.0, 0.0], [0.0, 0.0], [10.0, 5.0], [10.0, 5.0], [10.0, 5.0], [0.0, 1.0]])
    motion = through_points(NAMES, times_s, positions, PLACES[:6])
    assert isinstance(motion.law, Sequence)
    assert motion.duration_s == 2.5
    assert motion.breakpoints_s == (0.3, 1.0, 2.0)
    assert motion.positions(times_s) == pytest.approx(positions)
    for first_s, last_s in ((0.0, 0.3), (1.0, 2.0)):
        t_s = np.linspace(first_s, last_s, 50)
        assert np.ptp(motion.positions(t_s), axis=0).max() < 1e-12
        assert np.abs(motion.velocities(t_s)).max() < 1e-9


def test_one_joint_may_stand_while_another_moves() -> None:
    """Only a point at which no joint moves makes a pause."""
    motion = through_points(NAMES, np.array([0.0, 0.5, 1.0]), np.array([[0.0, 0], [1, 0], [2, 0]]), PLACES[:3])
    assert isinstance(motion.law, Spline)


def test_points_that_only_repeat() -> None:
    motion = through_points(NAMES, np.array([0.0, 1.0]), np.array([[4.0, 5.0], [4.0, 5.0]]), PLACES[:2])
    assert motion.positions(np.array([0.5])) == pytest.approx(np.array([[4.0, 5.0]]))


def test_a_pause_begins_and_ends_at_whole_milliseconds() -> None:
    positions = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    with refusing(InputError):
        through_points(NAMES, np.array([0.0, 0.5004, 1.0, 2.0]), positions, PLACES[:4])
