"""Straight lines with parabolic blends: golden values by hand, limits kept, and what becomes of overlapping blends."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.sampled import Spline, blended_lines
from tests.host.complaints import complaint_of
from tests.laws import law_of
from tests.messages import refusing

NAMES = ("a", "b")
LIMITS = np.array([100.0, 400.0])


def change_times_s(changes: FloatArray) -> FloatArray:
    return np.asarray((np.abs(changes) / LIMITS).max(axis=1))


def lines(times_s: list[float], first: list[float], at_rest: tuple[bool, bool] = (True, True)) -> Motion:
    """Return the motion of the first joint through these positions; the second one stands."""
    return blended_lines(
        change_times_s, NAMES, np.array(times_s), np.column_stack([first, np.ones(len(first))]), at_rest
    )


def accelerations(motion: Motion) -> FloatArray:
    """Return the accelerations inside each millisecond, of shape (n, joints)."""
    return law_of(motion, Spline).accelerations(np.arange(0.0005, motion.duration_s, 0.001))


def test_golden() -> None:
    """Two lines at rest, by hand.

    The blend at the start takes r with r (T - r/2) = 10 / 100 s^2: 0.1056 s, in whole milliseconds 106; at the end 51.
    The lines' speeds are 10 / (1 - 0.053) and -10 / (2 - 0.0255); their difference takes 156.2 ms, twice 79 in whole
    ones.
    """
    motion = lines([0.0, 1.0, 3.0], [0.0, 10.0, 0.0])
    assert motion.breakpoints_s == (0.106, 0.921, 1.079, 2.949)
    out, back = 10 / 0.947, -10 / 1.9745
    speeds = motion.velocities(np.array([0.0, 0.053, 0.106, 0.921, 1.0, 1.079, 2.0, 2.949, 3.0]))[:, 0]
    assert speeds == pytest.approx([0, out / 2, out, out, (out + back) / 2, back, back, back, 0], abs=1e-12)
    at = motion.positions(np.array([0.0, 0.5, 1.0, 2.0, 3.0]))[:, 0]
    missed = (out - back) * 0.158 / 8
    assert at == pytest.approx([0, out * 0.447, 10 - missed, 10 + back, 0], abs=1e-12)
    assert (motion.positions(np.array([0.4, 1.0]))[:, 1] == 1.0).all()


def test_a_single_line_is_a_trapezoid() -> None:
    """4 in 1 s at 100 /s^2: r (1 - r) = 0.04, r = 0.0417 s."""
    motion = lines([0.0, 1.0], [0.0, 4.0])
    assert motion.breakpoints_s == (0.042, 0.958)
    assert motion.velocities(np.array([0.5]))[0, 0] == pytest.approx(4 / 0.958)


def test_at_speed_the_line_begins_and_ends_in_the_points() -> None:
    motion = lines([0.0, 1.0, 3.0], [0.0, 10.0, 0.0], (False, False))
    assert motion.breakpoints_s == (0.925, 1.075)
    ends = np.array([0.0, 3.0])
    assert motion.positions(ends)[:, 0] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert motion.velocities(ends)[:, 0] == pytest.approx([10.0, -5.0])


def test_a_blend_that_needs_whole_milliseconds_has_no_further_one() -> None:
    """A change of 20 /s at 100 /s^2 takes exactly 200 ms."""
    assert lines([0.0, 1.0, 2.0], [0.0, 10.0, 0.0], (False, False)).breakpoints_s == (0.9, 1.1)


def test_all_joints_leave_their_lines_together() -> None:
    positions = np.array([[0.0, 0.0], [10.0, 1.0], [0.0, 2.0], [1.0, 4.0]])
    motion = blended_lines(change_times_s, NAMES, np.array([0.0, 1.0, 2.0, 3.0]), positions)
    curved = np.abs(accelerations(motion)) > 1e-9
    assert (curved[:, 0] >= curved[:, 1]).all()
    assert curved.any(axis=0).all()


@pytest.mark.slow
@given(
    dt_ms=st.lists(st.integers(400, 2000), min_size=1, max_size=6),
    seed=st.integers(0, 2**32 - 1),
    at_rest=st.tuples(st.booleans(), st.booleans()),
)
def test_blends_with_room_keep_the_accelerations(dt_ms: list[int], seed: int, at_rest: tuple[bool, bool]) -> None:
    """With ways of up to 2 in 0.4 s the blends at 100 /s^2 cannot overlap."""
    times_s = np.cumsum([0, *dt_ms]) / 1000
    positions = np.random.default_rng(seed).uniform(-1.0, 1.0, (len(times_s), 2))
    motion = blended_lines(change_times_s, NAMES, times_s, positions, at_rest)
    used = np.abs(accelerations(motion)) / LIMITS
    assert used.max() <= 1 + 1e-9
    for point_s, rests in ((times_s[0], at_rest[0]), (times_s[-1], at_rest[1])):
        speed = np.abs(motion.velocities(np.array([point_s]))).max()
        assert (speed < 1e-9) == rests
    off = np.abs(motion.positions(times_s) - positions)
    assert off[[0, -1]].max() < 1e-9
    assert (off <= 4.0**2 / 0.4**2 / (2 * LIMITS.min())).all()  # |dv|^2 / 8a, with dv up to twice 2 / 0.4, and rounding


@pytest.mark.parametrize("points", [[0.0, 10.0, 0.0], [0.0, 10.0], [0.0, 10.0, 10.5, 3.0, 0.0]])
def test_overlapping_blends_share_the_time_and_exceed_the_accelerations(points: list[float]) -> None:
    times_s = (0.2 * np.arange(len(points))).round(3).tolist()
    motion = lines(times_s, points)
    assert np.abs(accelerations(motion)).max() > LIMITS[0]
    assert motion.duration_s == times_s[-1]
    assert motion.positions(np.array([times_s[-1]]))[0, 0] == pytest.approx(points[-1], abs=1e-9)
    assert np.abs(motion.velocities(np.array([0.0, times_s[-1]]))).max() < 1e-9


def test_short_times_have_place_for_a_blend_of_a_millisecond_each() -> None:
    motion = lines([0.0, 0.002, 0.004, 0.006], [0.0, 5.0, 0.0, 1.0])
    assert motion.breakpoints_s == (0.001, 0.003, 0.005)
    told = complaint_of(lambda: lines([0.0, 0.002, 0.003], [0.0, 1.0, 2.0]))
    assert told == "the points at 0.002 s and 0.003 s are 1 ms apart: lines with blends take at least 2 ms"


def test_times_are_whole_milliseconds() -> None:
    with refusing(InputError):
        lines([0.0, 0.5004, 1.0], [0.0, 1.0, 2.0])
