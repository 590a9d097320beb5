"""Where the machine may be after each event: against a search on a grid, with and without lost pulses."""

import numpy as np
import pytest

from steptwin.features.captures.path_walk import agreeing, compiled_walk, events_of, reach, reach_back, walk
from steptwin.host.common.arrays import FloatArray, Int8Array

POINTS = np.array([[0.0, 9.0, 9.0, 2.0, 2.0], [0.0, 0.0, 6.0, 6.0, -3.0]])
END = (4.0, 4.0)


def walked(points: FloatArray, per_segment: int = 4000) -> Int8Array:
    """Return the events of a nearest-step rule along a path."""
    place = np.linspace(0.0, points.shape[1] - 1.0, per_segment * (points.shape[1] - 1) + 1)
    counts = [np.floor(np.interp(place, np.arange(points.shape[1]), axis) + 0.5) for axis in points]
    times = [place[1:][np.diff(count) != 0.0] for count in counts]
    signs = [np.diff(count)[np.diff(count) != 0.0].astype(np.int8) for count in counts]
    return events_of(times, signs, 1e-9).changes


def on_a_grid(points: FloatArray, half: float, changes: Int8Array, fine: int = 400) -> tuple[int, float, float]:
    """Return after how many events a search on a grid of places has any, and the first and the last place then."""
    grid = np.linspace(0.0, points.shape[1] - 1.0, fine * (points.shape[1] - 1) + 1)
    places = np.array([np.interp(grid, np.arange(points.shape[1]), axis) for axis in points])
    count, there = np.zeros(len(points)), np.zeros(grid.size, bool)
    there[0], last = True, (-1, 0.0, 0.0)
    for event in range(len(changes) + 1):
        if event:
            count += changes[event - 1]
        agrees = np.abs(places - count[:, np.newaxis]).max(axis=0) <= half
        now, reached = np.zeros(grid.size, bool), False
        for i in range(grid.size):
            reached = bool(agrees[i] and (reached or there[i]))
            now[i] = reached
        there = now
        if not there.any():
            break
        last = event, float(grid[there].min()), float(grid[there].max())
    return last


def test_the_counts_of_a_rule_walk_the_path_and_others_do_not() -> None:
    changes = walked(POINTS)
    found = reach(POINTS, 0.51, changes, np.zeros(2), (0.0, 0.0))
    assert (found.events(), found.at(len(changes))[1]) == (len(changes), 4.0)
    other = reach(POINTS, 0.49, changes, np.zeros(2), (0.0, 0.0))
    assert other.events() == 0


@pytest.mark.parametrize("seed", range(6))
def test_a_search_on_a_grid_finds_the_same_places(seed: int) -> None:
    random = np.random.default_rng(seed)
    points = random.integers(-4, 5, (2, 4)).astype(np.float64)
    points -= points[:, :1]
    changes = walked(points)
    if seed % 2:
        changes = np.delete(changes, random.integers(len(changes)), axis=0)
    half = float(random.choice([0.55, 0.8, 1.2]))
    event, low, high = on_a_grid(points, half, changes)
    found = reach(points, half, changes, np.zeros(2), (0.0, 0.0))
    assert found.events() == event
    assert found.at(event) == pytest.approx((low, high), abs=1e-2)


def test_a_lost_pulse_is_a_layer() -> None:
    changes = np.delete(walked(POINTS), 3, axis=0)
    assert reach(POINTS, 0.51, changes, np.zeros(2), (0.0, 0.0)).events() < len(changes)
    found = reach(POINTS, 0.51, changes, np.zeros(2), (0.0, 0.0), 0, 1, 1)
    assert (found.events(1), found.at(len(changes), 1)[1]) == (len(changes), 4.0)
    wrong = reach(POINTS, 0.51, changes, np.zeros(2), (0.0, 0.0), 1, 1, 1)
    assert wrong.events(1) < len(changes)


def test_an_extra_pulse_is_a_layer_the_other_way() -> None:
    changes = np.insert(walked(POINTS), 4, [[1, 0]], axis=0)
    found = reach(POINTS, 0.51, changes, np.zeros(2), (0.0, 0.0), 0, -1, 1)
    assert (found.events(1), found.at(len(changes), 1)[1]) == (len(changes), 4.0)


def test_backwards_the_same_places_are_met() -> None:
    changes = walked(POINTS)
    ahead = reach(POINTS, 0.6, changes, np.zeros(2), (0.0, 0.0))
    back = reach_back(POINTS, 0.6, changes, changes.sum(axis=0, dtype=np.int64).astype(np.float64), END)
    assert back.at(0)[0] == 0.0
    assert (np.maximum(ahead.lows, back.lows) <= np.minimum(ahead.highs, back.highs)).all()


def test_agreeing_places_are_intervals() -> None:
    """A count of 9, 3 is met on the second segment; 2, 0 on the first one and on the last one."""
    assert agreeing(POINTS, 0.5, np.array([9.0, 3.0]), 0.0) == [pytest.approx((1.0 + 2.5 / 6.0, 1.0 + 3.5 / 6.0))]
    twice = agreeing(POINTS, 0.5, np.array([2.0, 0.0]), 0.0)
    assert twice == [pytest.approx((1.5 / 9.0, 2.5 / 9.0)), pytest.approx((3.0 + 5.5 / 9.0, 3.0 + 6.5 / 9.0))]
    assert len(agreeing(POINTS, 0.5, np.array([2.0, 0.0]), 1.0)) == 1


def test_steps_of_one_sample_are_one_event_with_one_step_of_an_axis() -> None:
    """The second step of an axis begins an event of its own, however near it is."""
    one, other = np.array([1.0, 2.0, 2.000001]), np.array([1.000001, 3.0])
    signs = [np.array([1, 1, -1], np.int8), np.array([1, -1], np.int8)]
    events = events_of([one, other], signs, 1.5e-6)
    assert events.changes.tolist() == [[1, 1], [1, 0], [-1, 0], [0, -1]]
    assert events.time_s.tolist() == [1.000001, 2.0, 2.000001, 3.0]
    assert events_of([one[:0], one[:0]], [signs[0][:0]] * 2, 1e-6).changes.shape == (0, 2)


@pytest.mark.slow
def test_the_loops_give_the_same_bits_plain_andcompiled_walk() -> None:
    pytest.importorskip("numba")
    changes = np.delete(walked(20.0 * POINTS), 90, axis=0)
    lows, highs = np.ones((len(changes) + 1, 3)), np.zeros((len(changes) + 1, 3))
    compiled_walk()(20.0 * POINTS, 0.6, changes, np.zeros(2), (0.0, 0.0), 0, 1, lows, highs)
    plain_lows, plain_highs = np.ones_like(lows).tolist(), np.zeros_like(highs).tolist()
    walk((20.0 * POINTS).tolist(), 0.6, changes.tolist(), [0.0, 0.0], (0.0, 0.0), 0, 1, plain_lows, plain_highs)
    assert (plain_lows, plain_highs) == (lows.tolist(), highs.tolist())
