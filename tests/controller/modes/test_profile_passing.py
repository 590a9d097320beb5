"""A profile through a target: exactly there at the velocity asked for, at rest at the next one, within all limits."""

from itertools import accumulate
from math import sqrt

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from steptwin.controller.modes.profile import Limits, Passing, move, move_through
from steptwin.controller.modes.ramps import GRAIN_MS, PIECE_MS, Segment
from tests.controller.modes.test_profile import ACROSS_A_BEND, ENOUGH, ExecutedProfile, linear, smooth, steepest
from tests.one_example import one_example

LIMITS = Limits(6400, 1_000_000, 1_000_000)
"""100 units per ms, 1 unit per ms^2: a ramp takes 100 ms and 5000 units."""
FAR = 10**6


def through(distance: int, limits: Limits, passing: Passing, velocity: int = 0) -> list[Segment]:
    profile = move_through(distance, velocity, 0, limits, passing)
    assert profile is not None
    return ExecutedProfile(velocity).take(profile, 10_000).segments


def ends_at(segments: list[Segment], distance: int) -> list[tuple[int, int]]:
    """Return the time in ms and the velocity of each segment's end at a distance; by rounding, slow ones have more."""
    position, ms, found = 0, 0, []
    for segment in segments:
        position += segment.displacement_units
        ms += segment.duration_ms
        if position == distance:
            found.append((ms, segment.end_velocity))
    return found


def passed_at(segments: list[Segment], distance: int) -> tuple[int, int]:
    """Return when a profile passes a distance, at the end of a segment, and its velocity there."""
    (passed,) = ends_at(segments, distance)
    return passed


@pytest.mark.parametrize("wanted", [1, 640, 3200, 6399, 6400])
@pytest.mark.parametrize("sign", [1, -1])
def test_it_passes_at_the_velocity_asked_for(wanted: int, sign: int) -> None:
    segments = through(sign * 50_000, LIMITS, Passing(wanted, sign * 40_000, LIMITS))
    passed = passed_at(segments, sign * 50_000)
    assert passed[1] == sign * wanted
    assert sum(segment.displacement_units for segment in segments) == sign * 90_000
    assert segments[-1].end_velocity == 0


def times_s(distance: float, v: float, a: float, at: float, onward: float) -> tuple[float, float]:
    """Return when the exact trapezoid from rest passes a distance at a velocity, and when it rests; no rounding.

    In units and ms: it rises to v, cruises, falls to the velocity, then rises to v again and stops.
    """
    peak = min(v, sqrt(a * distance + at * at / 2))
    ways = (peak**2 / (2 * a), (peak**2 - at**2) / (2 * a))
    passed = peak / a + (peak - at) / a + (distance - sum(ways)) / peak
    peak = min(v, sqrt(a * onward + at * at / 2))
    ways = ((peak**2 - at**2) / (2 * a), peak**2 / (2 * a))
    return passed, passed + (2 * peak - at) / a + (onward - sum(ways)) / peak


@pytest.mark.parametrize("at", [1, 10, 50, 99, 100])
@pytest.mark.parametrize("distance", [8_000, 20_000, 50_001])
@pytest.mark.parametrize("onward", [7_000, 60_000])
def test_it_takes_the_time_of_its_trapezoids(distance: int, at: int, onward: int) -> None:
    """But for the rounding to whole milliseconds and the cruise that makes up for it, of some GRAIN_MS each."""
    segments = through(distance, LIMITS, Passing(64 * at, onward, LIMITS))
    passed = passed_at(segments, distance)
    passed_ms, rests_ms = times_s(distance, 100, 1, at, onward)
    assert passed[0] == pytest.approx(passed_ms, abs=2 * GRAIN_MS)
    assert passed[0] > passed_ms - 1
    assert sum(segment.duration_ms for segment in segments) == pytest.approx(rests_ms, abs=4 * GRAIN_MS)


@pytest.mark.parametrize(("onward", "fastest"), [(4000, 5568), (5199, 6398), (5200, 6400)])
def test_it_passes_no_faster_than_it_can_stop_before_the_next_target(onward: int, fastest: int) -> None:
    """From 100 units per ms a stop takes 5000 units, and 200 more for whole milliseconds."""
    segments = through(50_000, LIMITS, Passing(6400, onward, LIMITS))
    passed = passed_at(segments, 50_000)
    assert passed[1] == fastest
    places = list(accumulate(segment.displacement_units for segment in segments))
    assert max(places) == places[-1] == 50_000 + onward


@pytest.mark.parametrize(("distance", "fastest"), [(100, 512), (1250, 2368), (7000, 6144), (7500, 6400)])
def test_it_passes_no_faster_than_the_way_allows(distance: int, fastest: int) -> None:
    """To 37 units per ms takes 685 units, and a cruise of 15 ms to make up for whole milliseconds takes 555 more."""
    segments = through(distance, LIMITS, Passing(6400, FAR, LIMITS))
    passed = passed_at(segments, distance)
    assert passed[1] == fastest
    assert fastest / 64 <= sqrt(2 * distance)


def test_what_is_not_passed() -> None:
    """The next target behind, or at the same place; a target behind the axis, or where it stands; nothing wanted."""
    assert move_through(5000, 0, 0, LIMITS, Passing(6400, -5000, LIMITS)) is None
    assert move_through(5000, 0, 0, LIMITS, Passing(6400, 0, LIMITS)) is None
    assert move_through(-5000, 0, 0, LIMITS, Passing(6400, 9000, LIMITS)) is None
    assert move_through(0, 0, 0, LIMITS, Passing(6400, 9000, LIMITS)) is None
    assert move_through(5000, 0, 0, LIMITS, Passing(0, 9000, LIMITS)) is None
    assert move_through(4900, 6400, 0, LIMITS, Passing(6400, 9000, LIMITS)) is None, "too near to stop"


@pytest.mark.parametrize("distance", [5_100, 5_500, 6_000, 50_000])
def test_a_set_point_that_comes_at_full_speed(distance: int) -> None:
    """Near to the target it still passes, if there is room, and it never overruns."""
    profile = move_through(distance, 6400, 0, LIMITS, Passing(3200, 9000, LIMITS))
    assert profile is not None
    segments = ExecutedProfile(6400).take(profile).segments
    places = list(accumulate(segment.displacement_units for segment in segments))
    assert max(places) == places[-1] == distance + 9000
    assert passed_at(segments, distance)[1] <= 3200


ways = st.one_of(st.integers(1, 2000), st.integers(1, 10**6))


@pytest.mark.slow
@given(
    limits=st.one_of(linear, smooth),
    onward_limits=st.one_of(linear, smooth),
    distance=ways,
    onward=ways,
    wanted=st.integers(1, 960_000),
    velocity=st.one_of(st.just(0), st.integers(-960_000, 960_000)),
    sign=st.sampled_from([1, -1]),
)
@example(LIMITS, LIMITS, 50_000, 40_000, 6400, 0, 1)
def test_it_keeps_all_limits_and_never_overruns(
    limits: Limits, onward_limits: Limits, distance: int, onward: int, wanted: int, velocity: int, sign: int
) -> None:
    passing = Passing(wanted, sign * onward, onward_limits)
    profile = move_through(sign * distance, sign * velocity, 0, limits, passing)
    if profile is None:
        return
    run = ExecutedProfile(sign * velocity).take(profile)
    fastest = max(limits.velocity, onward_limits.velocity, abs(velocity))
    assert run.fastest_excess <= fastest
    steep = max(steepest(limits), steepest(onward_limits))
    assert run.acceleration_excess <= steep * (1 + 3 / GRAIN_MS) * ACROSS_A_BEND
    assert all(GRAIN_MS <= segment.duration_ms <= PIECE_MS for segment in run.segments)
    places = list(accumulate(sign * segment.displacement_units for segment in run.segments))
    assert max(places) <= distance + onward
    if len(run.segments) < ENOUGH:
        assert (sign * run.units, run.velocity) == (distance + onward, 0)
        speeds = [sign * velocity for _, velocity in ends_at(run.segments, sign * distance)]
        assert any(0 < speed <= min(wanted, limits.velocity) for speed in speeds)


@pytest.mark.slow
@given(
    limits=linear, distance=st.integers(10**4, 10**6), onward=st.integers(10**4, 10**6), wanted=st.integers(1, 10**5)
)
def test_from_rest_it_keeps_the_acceleration_exactly(limits: Limits, distance: int, onward: int, wanted: int) -> None:
    profile = move_through(distance, 0, 0, limits, Passing(wanted, onward, limits))
    if profile is not None:
        run = ExecutedProfile(0).take(profile)
        assert run.acceleration_excess <= steepest(limits) * (1 + 1e-9)


@pytest.mark.slow
@given(
    limits=st.one_of(linear, smooth),
    distance=st.integers(10**4, 10**6),
    change_after=st.integers(1, 60),
    onward=st.integers(10**4, 10**6),
    wanted=st.integers(1, 10**5),
)
def test_a_set_point_that_comes_on_the_way(
    limits: Limits, distance: int, change_after: int, onward: int, wanted: int
) -> None:
    """Wherever the axis is on its way to rest at the target, it goes on through it, or the plan stays as it is."""
    run = ExecutedProfile(0).take(move(distance, 0, 0, limits), change_after)
    acceleration = run.segments[-1].end_acceleration
    passing = Passing(wanted, onward, limits)
    profile = move_through(distance - run.units, run.velocity, acceleration, limits, passing)
    if profile is None:
        return
    begun = len(run.segments)
    run.take(profile)
    places = list(accumulate(segment.displacement_units for segment in run.segments))
    assert max(places) <= distance + onward
    assert run.acceleration_excess <= steepest(limits) * (1 + 3 / GRAIN_MS) * ACROSS_A_BEND
    if len(run.segments) - begun < ENOUGH:
        assert (run.units, run.velocity) == (distance + onward, 0)
        assert distance in places


def test_some_passings() -> None:
    for limits, velocity, sign in ((LIMITS, 0, 1), (LIMITS, 5000, -1), (LIMITS, -9000, 1)):
        one_example(test_it_keeps_all_limits_and_never_overruns, limits, limits, 50_000, 40_000, 6400, velocity, sign)
    one_example(test_from_rest_it_keeps_the_acceleration_exactly, LIMITS, 50_000, 40_000, 6400)
    for change_after in (3, 30):
        one_example(test_a_set_point_that_comes_on_the_way, LIMITS, 50_000, change_after, 40_000, 6400)
