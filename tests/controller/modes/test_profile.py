"""The profile generator ends exactly at the target and keeps its limits, up to the rounding that its module states."""

from dataclasses import dataclass, field
from itertools import accumulate, pairwise

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from steptwin.controller.modes.profile import Limits, move, stop
from steptwin.controller.modes.ramps import GRAIN_MS, PIECE_MS, Profile, Segment
from tests.one_example import one_example

PER_S2 = 64 / 1_000_000
"""A unit per s^2 in 1/64 unit per ms^2."""
ACROSS_A_BEND = 11 / 9 + 1e-9
"""How a cubic over a bend of the acceleration exceeds it: 1 + x - x^2 where the last x = 1/3 of it is constant."""
ENOUGH = 500
"""Number of segments after which a test leaves a long motion."""


@dataclass
class ExecutedProfile:
    """Segments executed from a velocity, with the speeds and accelerations of the kernel's cubics."""

    velocity: int
    segments: list[Segment] = field(default_factory=list)
    units: int = 0
    fastest_excess: float = 0.0
    """The highest speed of a segment's hull in 1/64 unit per ms, less the most that rounding adds."""
    accelerations: list[tuple[int, float, float]] = field(default_factory=list)
    """Duration of each segment, and its acceleration at start and end in 1/64 unit per ms^2."""

    def take(self, profile: Profile, count: int = ENOUGH) -> "ExecutedProfile":
        for _ in range(count):
            segment = profile.next_segment()
            if segment is None:
                break
            self._append(segment)
        return self

    def _append(self, segment: Segment) -> None:
        t = segment.duration_ms
        v0, v1, distance = self.velocity, segment.end_velocity, 64 * segment.displacement_units
        hull = max(abs(v0), abs(v1), abs(3 * distance / t - v0 - v1))
        self.fastest_excess = max(self.fastest_excess, hull - speed_rounding(t))
        first = (6 * distance - (4 * v0 + 2 * v1) * t) / t**2
        last = ((2 * v0 + 4 * v1) * t - 6 * distance) / t**2
        self.accelerations.append((t, first, last))
        self.segments.append(segment)
        self.units += segment.displacement_units
        self.velocity = v1

    @property
    def acceleration_excess(self) -> float:
        """The highest acceleration, less the most that rounding adds."""
        return max((max(abs(a), abs(b)) - rounding(t) for t, a, b in self.accelerations), default=0.0)


def speed_rounding(duration_ms: int) -> float:
    """Return the bound 3 / T + 1/64 units per ms, in 1/64 unit per ms."""
    return 64 * 3 / duration_ms + 1


def rounding(duration_ms: int) -> float:
    """Return the bound (6 / T + 1/16) / T units per ms^2, in 1/64 unit per ms^2."""
    return 64 * (6 / duration_ms + 1 / 16) / duration_ms


accelerations = st.integers(10**4, 2**32 - 1)
linear = st.builds(Limits, st.integers(1, 960_000), accelerations, accelerations, st.just(0))
smooth = st.builds(Limits, st.integers(1, 960_000), accelerations, accelerations, st.integers(10**6, 2**32 - 1))
distances = st.one_of(st.integers(-2000, 2000), st.integers(-(10**6), 10**6), st.integers(-(2**32), 2**32))


def steepest(limits: Limits) -> float:
    return max(limits.acceleration, limits.deceleration) * PER_S2


@pytest.mark.slow
@given(limits=st.one_of(linear, smooth), distance=distances)
@example(limits=Limits(1, 1, 1), distance=3)
def test_from_rest_it_ends_at_the_target_within_all_limits(limits: Limits, distance: int) -> None:
    run = ExecutedProfile(0).take(move(distance, 0, 0, limits))
    assert run.fastest_excess <= limits.velocity
    assert run.acceleration_excess <= steepest(limits) * (ACROSS_A_BEND if limits.jerk else 1 + 1e-9)
    assert all(GRAIN_MS <= segment.duration_ms <= PIECE_MS for segment in run.segments)
    if len(run.segments) < ENOUGH:
        assert (run.units, run.velocity) == (distance, 0)


@pytest.mark.slow
@given(limits=st.one_of(linear, smooth), distance=distances, velocity=st.integers(-960_000, 960_000))
def test_from_any_velocity_it_ends_at_the_target(limits: Limits, distance: int, velocity: int) -> None:
    """Starts may also move the wrong way, be too near to stop or too fast: the deceleration corrects them."""
    run = ExecutedProfile(velocity).take(move(distance, velocity, 0, limits))
    assert run.fastest_excess <= max(limits.velocity, abs(velocity))
    assert run.acceleration_excess <= steepest(limits) * (1 + 3 / GRAIN_MS) * ACROSS_A_BEND
    if len(run.segments) < ENOUGH:
        assert (run.units, run.velocity) == (distance, 0)


@pytest.mark.slow
@given(
    first=st.one_of(linear, smooth),
    second=st.one_of(linear, smooth),
    distance=distances,
    change_after=st.integers(1, 60),
    target=distances,
)
def test_a_new_target_with_new_limits_on_the_way(
    first: Limits, second: Limits, distance: int, change_after: int, target: int
) -> None:
    run = ExecutedProfile(0).take(move(distance, 0, 0, first), change_after)
    acceleration = run.segments[-1].end_acceleration if run.segments else 0
    run.take(move(target - run.units, run.velocity, acceleration, second))
    assert run.fastest_excess <= max(first.velocity, second.velocity) + 1
    assert run.acceleration_excess <= max(steepest(first), steepest(second)) * (1 + 3 / GRAIN_MS) * ACROSS_A_BEND
    if len(run.segments) < ENOUGH:
        assert (run.units, run.velocity) == (target, 0)


@pytest.mark.slow
@given(limits=st.one_of(linear, smooth), velocity=st.integers(-960_000, 960_000))
def test_a_stop_never_turns_round(limits: Limits, velocity: int) -> None:
    run = ExecutedProfile(velocity).take(stop(velocity, 0, limits))
    assert run.acceleration_excess <= limits.deceleration * PER_S2 * ACROSS_A_BEND
    if len(run.segments) < ENOUGH:
        assert run.velocity == 0
        assert run.units * velocity >= 0
        blend_ms = 1000 * limits.deceleration / limits.jerk if limits.jerk else 0
        longest_ms = abs(velocity) / (limits.deceleration * PER_S2) + blend_ms + 4 * GRAIN_MS
        assert abs(run.units) <= abs(velocity) * longest_ms / 128 + 1
    assert all(segment.end_velocity * velocity >= 0 for segment in run.segments)


@pytest.mark.slow
@given(limits=smooth, distance=st.integers(10**5, 10**8), change_after=st.integers(1, 40))
def test_jerk_limited_motions_have_no_steps_in_their_acceleration(
    limits: Limits, distance: int, change_after: int
) -> None:
    """This holds also where a new target takes over: the present acceleration goes to 0 within the jerk."""
    run = ExecutedProfile(0).take(move(distance, 0, 0, limits), change_after)
    run.take(move(2 * distance, run.velocity, run.segments[-1].end_acceleration, limits))
    blended = [(0, 0.0, 0.0), *run.accelerations]
    jerk = limits.jerk * 64 / 10**9
    for (t0, _, before), (t1, after, _) in pairwise(blended):
        # The last ramp may bend a little: it subtracts the distance of whole milliseconds too many.
        give_back = 3 * 64 * 15_000 / 1000
        assert abs(after - before) <= rounding(t0 or t1) + rounding(t1) + jerk * PIECE_MS + give_back


fast = st.builds(
    Limits,
    st.integers(10**6, 10**7),
    st.integers(10**7, 10**9),
    st.integers(10**7, 10**9),
    st.integers(10**8, 2**32 - 1),
)
"""Limits of stepper axes, in which a full step has 16 384 units."""


def changes(run: ExecutedProfile) -> list[float]:
    """Return how far the acceleration changes within each segment and before it, less the most that rounding adds."""
    accelerations = [(16, 0.0, 0.0), *run.accelerations]
    steps = [abs(a - last) - rounding(t) - rounding(t0) for (t0, _, last), (t, a, _) in pairwise(accelerations)]
    return [*steps, *(abs(b - a) - 2 * rounding(t) for t, a, b in run.accelerations)]


@pytest.mark.slow
@given(limits=fast, distance=st.integers(10**4, 10**7), change_after=st.integers(1, 60), sign=st.sampled_from([1, -1]))
@example(limits=Limits(10**7, 10**9, 10**8, 10**9), distance=10**7, change_after=30, sign=1)
@example(limits=Limits(10**7, 10**9, 10**8, 10**9), distance=10**7, change_after=42, sign=-1)
def test_a_jerk_limited_halt_on_the_way_ends_before_the_target(
    limits: Limits, distance: int, change_after: int, sign: int
) -> None:
    """An axis that brakes to its target already brakes on."""
    run = ExecutedProfile(0).take(move(sign * distance, 0, 0, limits), change_after)
    velocity, acceleration = run.velocity, run.segments[-1].end_acceleration
    halt = ExecutedProfile(velocity).take(stop(velocity, acceleration, limits, sign * distance - run.units))
    assert halt.velocity == 0
    assert sign * (run.units + halt.units) <= distance
    assert all(sign * segment.end_velocity >= 0 for segment in halt.segments)
    assert halt.acceleration_excess <= steepest(limits) * ACROSS_A_BEND
    joined = ExecutedProfile(0, accelerations=[*run.accelerations, *halt.accelerations])
    assert max(changes(joined)) <= limits.jerk * 64 / 10**9 * PIECE_MS + 3 * 64 * 15_000 / 1000


@pytest.mark.slow
@given(limits=fast, distance=st.integers(10**4, 10**7), at=st.integers(0, 60))
def test_a_jerk_limited_axis_that_brakes_may_be_given_its_target_again(limits: Limits, distance: int, at: int) -> None:
    """It goes there without overrunning it."""
    run = ExecutedProfile(0).take(move(distance, 0, 0, limits))
    braking = [n for n, s in enumerate(run.segments) if s.end_velocity > 0 > s.end_acceleration]
    assume(braking)
    again = ExecutedProfile(0).take(move(distance, 0, 0, limits), braking[at % len(braking)] + 1)
    again.take(move(distance - again.units, again.velocity, again.segments[-1].end_acceleration, limits))
    assert (again.units, again.velocity) == (distance, 0)
    assert max(accumulate(segment.displacement_units for segment in again.segments)) <= distance


def test_a_halt_with_a_lower_deceleration_keeps_the_present_one() -> None:
    """From 200 units per ms at 1 unit per ms^2 the axis takes 200 ms, and half of the last blend's 100 ms."""
    limits = Limits(400 * 64, 10**6, 10**5, 10**7)
    halt = ExecutedProfile(200 * 64).take(stop(200 * 64, -64 << 16, limits))
    assert halt.velocity == 0
    assert sum(segment.duration_ms for segment in halt.segments) == pytest.approx(250, abs=2)
    assert halt.units == pytest.approx(150 * 125 + 50 * 100 / 3, rel=0.01)


def test_a_halt_that_has_no_time_for_its_jerk_does_not_turn_round() -> None:
    """At 10 units per ms and -1 unit per ms^2, 20 ms are left; a jerk of 0.001 units per ms^3 would take a second."""
    halt = ExecutedProfile(640).take(stop(640, -64 << 16, Limits(6400, 10**6, 10**6, 10**6)))
    assert sum(segment.duration_ms for segment in halt.segments) == 20
    assert (halt.units, halt.velocity) == (67, 0)  # v T / 3


def test_a_trapezoid_takes_its_time() -> None:
    """100 000 units at 64 units per ms with ramps of 100 ms take 1662.5 ms, and less than 5 GRAIN_MS more."""
    limits = Limits(64 * 64, 640_000, 640_000)
    run = ExecutedProfile(0).take(move(100_000, 0, 0, limits))
    total_ms = sum(segment.duration_ms for segment in run.segments)
    assert total_ms == pytest.approx(1662.5, abs=5 * GRAIN_MS)
    assert max(segment.end_velocity for segment in run.segments) == 64 * 64


def test_a_jerk_limited_ramp_takes_its_time() -> None:
    """To 100 units per ms at 1 unit per ms^2 and 0.02 units per ms^3 the ramp takes 100 ms + 50 ms."""
    limits = Limits(6400, 1_000_000, 1_000_000, 20_000_000)
    run = ExecutedProfile(0).take(move(10**6, 0, 0, limits), 40)
    ended = [segment.end_velocity for segment in run.segments]
    at_speed = ended.index(6400)
    assert sum(segment.duration_ms for segment in run.segments[: at_speed + 1]) == 150


@pytest.mark.parametrize("jerk", [0, 10**7])
def test_no_distance_is_no_motion(jerk: int) -> None:
    assert move(0, 0, 0, Limits(6400, 10**6, 10**6, jerk)).next_segment() is None
    assert stop(0, 0, Limits(6400, 10**6, 10**6, jerk)).next_segment() is None


def test_too_near_to_stop_it_overshoots_and_comes_back() -> None:
    """From 100 units per ms at 1 unit per ms^2 a stop takes 5000 units; for a target at 1000 the axis reverses."""
    run = ExecutedProfile(6400).take(move(1000, 6400, 0, Limits(6400, 1_000_000, 1_000_000)))
    position, farthest = 0, 0
    for segment in run.segments:
        position += segment.displacement_units
        farthest = max(farthest, position)
    assert farthest == 5000
    assert position == 1000


@pytest.mark.parametrize(("distance", "jerk"), [(1, 1000), (-1, 1000), (2, 1000), (1, 10_000)])
def test_where_there_is_no_room_for_a_ramp_it_creeps_for_16_ms(distance: int, jerk: int) -> None:
    """A single unit would else take a ramp that covers more than it."""
    run = ExecutedProfile(0).take(move(distance, 0, 0, Limits(960_000, 2**32 - 1, 2**32 - 1, jerk)))
    assert [segment.duration_ms for segment in run.segments] == [16]
    assert (run.units, run.velocity) == (distance, 0)


def test_a_creep_takes_its_time() -> None:
    """3 units at 1 unit/s^2 are a smoothstep of sqrt(6 D / a) = 4.2427 s."""
    run = ExecutedProfile(0).take(move(3, 0, 0, Limits(6400, 1, 1)))
    assert sum(segment.duration_ms for segment in run.segments) == 4243
    assert (run.units, run.velocity) == (3, 0)


LINEAR, SMOOTH = Limits(200_000, 10**8, 5 * 10**7), Limits(200_000, 10**8, 5 * 10**7, 10**9)
"""Some 3000 units per ms, reached within 32 ms."""


@pytest.mark.parametrize("limits", [LINEAR, SMOOTH], ids=["linear", "smooth"])
@pytest.mark.parametrize("distance", [7, -1500, 10**6])
def test_some_profiles(limits: Limits, distance: int) -> None:
    one_example(test_from_rest_it_ends_at_the_target_within_all_limits, limits, distance)
    for velocity in (-150_000, 100, 400_000):
        one_example(test_from_any_velocity_it_ends_at_the_target, limits, distance, velocity)
        one_example(test_a_stop_never_turns_round, limits, velocity)
    one_example(test_a_new_target_with_new_limits_on_the_way, limits, SMOOTH, distance, 5, -2 * distance)


def test_some_jerk_limited_profiles() -> None:
    one_example(test_jerk_limited_motions_have_no_steps_in_their_acceleration, SMOOTH, 10**6, 10)
    limits = Limits(10**7, 10**9, 10**8, 10**9)
    one_example(test_a_jerk_limited_halt_on_the_way_ends_before_the_target, limits, 10**7, 30, 1)
    one_example(test_a_jerk_limited_halt_on_the_way_ends_before_the_target, limits, 10**7, 42, -1)
    one_example(test_a_jerk_limited_axis_that_brakes_may_be_given_its_target_again, limits, 10**6, 3)
