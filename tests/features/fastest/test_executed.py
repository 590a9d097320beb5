"""The cubics that the board executes keep every limit everywhere, and take hardly longer than the optimum."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.features.fastest.averaged import Averaged
from steptwin.features.fastest.chain import timed_chains
from steptwin.features.fastest.corners import flowing
from steptwin.features.fastest.executed import TimedPath, timed
from steptwin.features.fastest.solve import fastest_squares
from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.motions.sampled import Spline
from steptwin.host.planning.motions.whole import Pace
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot
from tests.features.fastest.paths import joint_legs, tool_legs
from tests.features.fastest.test_solve import duration_s
from tests.host.robots.coupled import coupled_robot
from tests.laws import law_of

ROBOT = load_robot("teaching-scara")
START = np.array([20.0, 105.0, 30.0, 0.0])
PICK = np.array([[0.0, 90, 50, 0], [0, 90, 5, 0], [-60, 60, 5, 20], [-60, 60, 50, 20]])


def use(robot: Robot, motion: TimedPath, percent: float = 100.0) -> float:
    """Return the largest part of a limit that the executed cubics use, by looking at each of them in 20 places."""
    curve = law_of(motion.motion, Spline).curve
    times_s = np.asarray(curve.x)
    inside = np.linspace(0.0, 1.0, 20)[:-1]
    fine_s = np.unique((times_s[:-1, np.newaxis] + np.diff(times_s)[:, np.newaxis] * inside).ravel())
    parts = []
    for order, joint_limits, axis_limits in (
        (1, [joint.speed_max for joint in robot.joints], robot.axis_speeds_max),
        (2, [joint.acceleration_max for joint in robot.joints], robot.axis_accelerations_max),
    ):
        values = np.asarray(curve(fine_s, order))
        parts += [np.abs(values) / np.array(joint_limits), np.abs(robot.coupling.to_axes(values)) / axis_limits]
    return float(max(part.max() for part in parts)) / (percent / 100)


positions = st.tuples(st.floats(-80, 80), st.floats(20, 110), st.floats(2, 58), st.floats(-150, 150))
chains = st.lists(positions, min_size=2, max_size=4).filter(
    lambda rows: min(np.abs(np.diff(rows, axis=0)).max(axis=1)) > 3.0
)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(chains, st.floats(0.02, 0.45), st.sampled_from([0.02, 0.05, 0.1]), st.sampled_from([30.0, 100.0]))
def test_no_cubic_exceeds_a_limit(rows: list[tuple[float, ...]], part: float, average_s: float, percent: float) -> None:
    legs = joint_legs(ROBOT, np.array(rows), Pace(percent))
    radii = [part * min(before.length, after.length) for before, after in pairwise(legs)]
    found = timed(ROBOT, flowing(ROBOT, legs, radii).path, average_s)
    assert use(ROBOT, found, percent) <= 1.0 + 1e-9
    assert found.highest <= 1.0
    ends = found.motion.positions(np.array([0.0, found.motion.duration_s]))
    assert ends == pytest.approx(np.array([rows[0], rows[-1]]), abs=1e-9)
    plan(ROBOT, found.motion)  # its own checks, of each millisecond and of the drivers' step rate


def test_coupled_axes_have_limits_of_their_own() -> None:
    robot = coupled_robot()
    legs = joint_legs(robot, np.array([[0.0, 20, 5, 0], [40.0, 60, 5, 0], [60.0, 20, 5, 0]]))
    found = timed(robot, flowing(robot, legs, [5.0]).path, 0.05)
    assert 0.9 < use(robot, found) <= 1.0 + 1e-9


@pytest.mark.parametrize(("average_s", "most"), [(0.02, 1.03), (0.05, 1.06)])
def test_lasts_hardly_longer_than_the_optimum_of_its_path(average_s: float, most: float) -> None:
    """The optimum changes its acceleration in no time: averaging costs its own time and some more in the corners."""
    path = flowing(ROBOT, joint_legs(ROBOT, PICK), [20.0, 20.0]).path
    rates = path.rates()
    optimum_s = duration_s(rates.s, fastest_squares(rates.s, path.limits().rows(ROBOT, rates)))
    assert timed(ROBOT, path, average_s).law.duration_s <= most * optimum_s


def test_the_tool_keeps_its_speed_over_tangential_legs() -> None:
    """Two lines in a row: at 60 mm/s nearly all the time, and never above it."""
    legs = tool_legs(ROBOT, START, [(-30.0, 0.0, 0.0), (-25.0, 0.0, 0.0)], Pace(100.0, 60.0, 90.0))
    found = timed(ROBOT, flowing(ROBOT, legs, [0.0]).path, 0.02)
    t_s = np.arange(0.0, found.motion.duration_s, 0.001)
    speeds = _tool_speeds(found, t_s)
    assert speeds.max() <= 1.005 * 60.0
    assert (np.abs(speeds - 60.0) < 0.017 * 60.0).mean() >= 0.9


def _tool_speeds(found: TimedPath, t_s: FloatArray) -> FloatArray:
    from steptwin.host.robots.kinematics import make_kinematics

    kinematics = make_kinematics(ROBOT)
    before, after = (kinematics.forward(found.motion.positions(t_s + dt))[:, :3] for dt in (0.0, 1e-5))
    return np.asarray(np.linalg.norm(after - before, axis=1) / 1e-5)


def test_lines_of_the_tool_stay_on_their_path_to_a_hundredth_of_a_step() -> None:
    legs = tool_legs(ROBOT, START, [(-25.0, 10.0, 0.0)], Pace(100.0, 200.0))
    path = flowing(ROBOT, legs, []).path
    found = timed(ROBOT, path, 0.02)
    t_s = np.linspace(0.0, found.motion.duration_s, 3001)
    wanted = path.at(found.law.at(t_s)[0])[0]
    off = np.abs(ROBOT.to_steps(found.motion.positions(t_s)) - ROBOT.to_steps(wanted))
    assert off.max() < 0.01


@pytest.mark.slow
def test_stops_where_that_is_faster_and_flows_where_it_is_not() -> None:
    legs = joint_legs(ROBOT, PICK)
    tiny, wide = timed_chains(ROBOT, legs, [0.05, 0.05]), timed_chains(ROBOT, legs, [10.0, 10.0])
    stopped = sum(timed_chains(ROBOT, [leg], [])[0].timed.law.duration_s for leg in legs)
    assert [corner.stops for corner in wide[0].flow.corners] == [False, False]
    assert [corner.stops for corner in tiny[0].flow.corners] == [True, True]
    assert tiny[0].timed.law.duration_s == pytest.approx(stopped, abs=0.01)  # points lie elsewhere
    assert wide[0].timed.law.duration_s < stopped
    rests_s = tiny[0].timed.law.begins_s
    assert np.abs(tiny[0].timed.motion.velocities(rests_s)).max() < 1e-9
    corners = tiny[0].timed.motion.positions(rests_s[1:-1])
    assert corners == pytest.approx(np.array(PICK[1:-1]), abs=1e-9)


def _law(squares: list[float], average_s: float, slower: float = 1.0) -> Averaged:
    inner = np.array(squares)
    return Averaged.of(np.linspace(0.0, 3.0, len(inner) + 2), np.concatenate([[0.0], inner, [0.0]]), average_s, slower)


laws = st.builds(_law, st.lists(st.floats(0.05, 25.0), min_size=1, max_size=12), st.floats(0.005, 0.3), st.floats(1, 2))


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(laws)
def test_is_the_mean_of_what_it_averages(law: Averaged) -> None:
    shrink = (law.times_s[-1] + law.average_s) / law.duration_s
    t_s = np.linspace(0.0, law.duration_s, 41)
    value, speed = law.at(t_s)
    inside = np.linspace(0.0, 1.0, 2001)
    fine_s = np.linspace(0.0, law.times_s[-1], 20_001)
    i = np.clip(np.searchsorted(law.times_s, fine_s, side="right") - 1, 0, len(law.times_s) - 2)
    part = (fine_s - law.times_s[i]) / (law.times_s[i + 1] - law.times_s[i])
    speeds = law.speeds[i] + part * (law.speeds[i + 1] - law.speeds[i])
    raw = np.concatenate([[0.0], np.cumsum((speeds[1:] + speeds[:-1]) / 2 * np.diff(fine_s))])
    for k, t in enumerate(t_s):
        window_s = t * shrink - law.average_s * (1.0 - inside)
        mean = np.trapezoid(np.interp(window_s, fine_s, raw), inside)
        assert value[k] == pytest.approx(mean, abs=2e-4)
        end, begin = np.interp([t * shrink, t * shrink - law.average_s], fine_s, raw)
        assert speed[k] == pytest.approx((end - begin) / law.average_s * shrink, abs=2e-3)


@settings(max_examples=60, deadline=None)
@given(laws)
def test_begins_and_ends_exactly_at_rest_and_never_turns_back(law: Averaged) -> None:
    value, speed = law.at(np.array([0.0, law.duration_s]))
    assert value.tolist() == [0.0, 3.0]
    assert speed == pytest.approx([0.0, 0.0], abs=1e-9)
    assert round(1000 * law.duration_s) == pytest.approx(1000 * law.duration_s, abs=1e-9)
    assert (np.diff(law.at(np.linspace(0.0, law.duration_s, 500))[0]) > -1e-12).all()


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(laws, st.floats(0.01, 2.99))
def test_says_when_it_is_at_a_value(law: Averaged, s: float) -> None:
    assert law.at(np.array([law.time_at(s)]))[0][0] == pytest.approx(s, abs=1e-6)


def test_jerk_is_at_most_twice_the_acceleration_over_the_time_of_averaging() -> None:
    law = _law([4.0, 4.0, 4.0, 4.0], 0.1)
    highest = np.abs(np.diff(law.speeds) / np.diff(law.times_s)).max()
    t_s = np.arange(0.0, law.duration_s, 1e-4)
    jerk = np.diff(law.at(t_s)[1], 2) / 1e-8
    assert np.abs(jerk).max() <= 2.0 * highest / 0.1 * 1.001


def test_lasts_as_long_as_before_and_the_time_of_averaging_in_whole_milliseconds() -> None:
    law = _law([4.0], 0.02)
    assert law.duration_s == pytest.approx(np.ceil(1000 * (2 * 2 * 1.5 / 2.0 + 0.02)) / 1000)
    assert _law([4.0], 0.02, 1.5).duration_s == pytest.approx(1.5 * 3.02, abs=1e-3)
