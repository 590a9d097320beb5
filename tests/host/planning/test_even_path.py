"""Curves over their true length: the tool's speed, the length against an independent measure, and the same poses."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from steptwin.host.common.errors import InputError
from steptwin.host.planning.paths import EVENNESS, EvenPath, SampledPath, Smoothing
from tests.host.complaints import complaint_of
from tests.host.planning.test_paths import ZIGZAG

PLACES = st.lists(st.tuples(*[st.integers(-9, 9)] * 3), min_size=3, max_size=7)


def worst_speed(path: EvenPath) -> float:
    """Return by which part the speed is off, by differences of the poses that 5000 equal lengths give."""
    poses = path.poses(np.linspace(0.0, path.length_mm, 5001))
    chords_mm = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1)
    return float(np.abs(chords_mm * 5000 / path.length_mm - 1).max())


@pytest.mark.parametrize("smoothing", Smoothing)
def test_the_speed_of_a_zigzag_is_even(smoothing: Smoothing) -> None:
    raw = SampledPath.through(ZIGZAG, smoothing)
    even = EvenPath.of(raw)
    fine = raw.poses(np.linspace(0.0, raw.length_mm, 200_001))
    assert even.length_mm == pytest.approx(np.linalg.norm(np.diff(fine[:, :3], axis=0), axis=1).sum(), rel=1e-6)
    assert worst_speed(even) < 0.01
    speeds = np.linalg.norm(raw.derivatives(np.linspace(0.0, raw.length_mm, 5001))[:, :3], axis=1)
    assert speeds.max() / speeds.min() > 1.5  # the speed over the polygon's length
    ends = even.poses(np.array([0.0, even.length_mm]))
    assert ends == pytest.approx(ZIGZAG[[0, -1]], abs=1e-9)
    for pose in ZIGZAG:
        off = even.poses(np.linspace(0.0, even.length_mm, 20_001)) - pose
        assert np.linalg.norm(off[:, :3], axis=1).min() < 0.02


@pytest.mark.parametrize("smoothing", Smoothing)
def test_derivatives_are_those_of_the_poses(smoothing: Smoothing) -> None:
    even, h_mm = EvenPath.of(SampledPath.through(ZIGZAG, smoothing)), 1e-4
    s_mm = np.linspace(0.3, even.length_mm - 0.3, 301)
    differences = (even.poses(s_mm + h_mm) - even.poses(s_mm - h_mm)) / (2 * h_mm)
    assert even.derivatives(s_mm) == pytest.approx(differences, abs=1e-3)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(PLACES, st.sampled_from(Smoothing))
def test_any_curve_is_even_or_refused(places: list[tuple[int, int, int]], smoothing: Smoothing) -> None:
    rows = np.array([[*place, 0.0] for place in places])
    assume(np.linalg.norm(np.diff(rows, axis=0), axis=1).min() > 0)
    try:
        even = EvenPath.of(SampledPath.through(rows, smoothing))
    except InputError:
        return
    speeds = np.linalg.norm(even.derivatives(np.linspace(0.0, even.length_mm, 3001))[:, :3], axis=1)
    assert np.abs(speeds - 1).max() < 2 * EVENNESS


def test_a_curve_that_turns_back_on_the_spot_is_refused() -> None:
    rows = np.array([[0.0, 0, 0, 0], [10, 0, 0, 0], [20, 0, 0, 0], [5, 0, 0, 0]])
    told = complaint_of(lambda: EvenPath.of(SampledPath.through(rows, Smoothing.C2_SPLINE)))
    assert told == "the curve turns back on the spot between its poses 3 and 4: make two curves of it"
