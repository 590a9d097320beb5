"""Corners of long chains: where the motion stops, that it is never slower for a rounding, and how the work grows."""

from collections.abc import Callable
from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from steptwin.features.fastest.averaged import Averaged
from steptwin.features.fastest.chain import TimedChain, timed_chains
from steptwin.features.fastest.corners import JointLeg, RoundedLegs, ToolLeg, flowing
from steptwin.features.fastest.executed import lasting_s, timed
from steptwin.features.fastest.flow_path import FlowPath
from steptwin.features.fastest.pieces import FollowedPath, PiecewisePath
from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.motions.whole import Pace
from steptwin.host.planning.paths import Arc
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from tests.features.fastest.paths import joint_legs, tool_legs
from tests.work import function_calls

ROBOT = load_robot("teaching-scara")
START = np.array([20.0, 80.0, 20.0, 0.0])


def zigzag(legs: int) -> list[JointLeg]:
    """Return legs of some degrees that turn back and forth."""
    rows = np.tile(START, (legs + 1, 1))
    rows[:, 0] += 6.0 * (np.arange(legs + 1) % 2)
    rows[:, 1] += 5.0 * np.arange(legs + 1) * (1 - 2 * (np.arange(legs + 1) // 8 % 2)) % 40.0
    return joint_legs(ROBOT, rows)


def chain_of(legs: list[JointLeg], radius_mm: float) -> TimedChain:
    (chain,) = timed_chains(ROBOT, legs, [radius_mm] * (len(legs) - 1))
    return chain


@pytest.mark.slow
def test_the_work_of_a_chain_grows_with_its_legs_and_not_with_their_square(monkeypatch: pytest.MonkeyPatch) -> None:
    instants = 0
    whole: Callable[[FlowPath, FloatArray], tuple[FloatArray, FloatArray]] = FlowPath.at

    def counting(self: FlowPath, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        nonlocal instants
        instants += len(s)
        return whole(self, s)

    monkeypatch.setattr(FlowPath, "at", counting)
    seen, calls = [], []
    for count in (16, 64):
        instants, legs = 0, zigzag(count)
        calls.append(function_calls(partial(chain_of, legs, 1.0)))
        seen.append(instants)
    assert seen[1] < 1.5 * 64 / 16 * seen[0]
    assert calls[1] < 1.5 * 64 / 16 * calls[0]


@pytest.mark.parametrize("radius_mm", [pytest.param(0.02, marks=pytest.mark.slow), 0.2, 1.0])
def test_a_rounding_never_makes_a_chain_slower_than_stops(radius_mm: float) -> None:
    legs = zigzag(5)
    apart_s = sum(timed_chains(ROBOT, [leg], [])[0].timed.law.duration_s for leg in legs)
    assert chain_of(legs, radius_mm).timed.law.duration_s <= apart_s + 1e-9


@pytest.mark.slow
def test_only_the_corner_in_which_a_stop_is_faster_becomes_one() -> None:
    chain = timed_chains(ROBOT, zigzag(4), [5.0, 0.005, 5.0])[0]
    assert [corner.stops for corner in chain.flow.corners] == [False, True, False]
    t_s = chain.timed.law.begins_s[1:2]
    assert np.abs(chain.timed.motion.velocities(t_s)).max() < 1e-9
    assert chain.timed.motion.positions(t_s)[0] == pytest.approx(zigzag(4)[1].goal, abs=1e-9)


def test_runs_between_stops_last_as_long_as_each_by_itself() -> None:
    legs = zigzag(4)
    flow = RoundedLegs.of(ROBOT, legs, [1.0] * 3).flow([1])
    together = timed(ROBOT, flow.path, 0.05, stops=flow.stops)
    apart_s = [timed(ROBOT, flowing(ROBOT, part, [1.0]).path, 0.05).law.duration_s for part in (legs[:2], legs[2:])]
    assert together.law.lasts_s == pytest.approx(apart_s, abs=0.005)  # their points lie elsewhere
    assert together.highest <= 1.0
    assert lasting_s(ROBOT, flow.path, 0.05, stops=flow.stops) == pytest.approx(apart_s, rel=0.02)


def test_an_average_of_two_runs_is_that_of_each() -> None:
    s = np.array([0.0, 1.0, 2.0, 2.0, 3.0, 5.0])
    squares = np.array([0.0, 4.0, 0.0, 0.0, 1.0, 0.0])
    both = Averaged.of(s, squares, 0.1, stops=np.array([2.0]))
    first, second = (Averaged.of(s[own], squares[own], 0.1) for own in (slice(0, 3), slice(3, 6)))
    assert both.begins_s.tolist() == [0.0, first.duration_s, round(first.duration_s + second.duration_s, 3)]
    t_s = np.linspace(0.0, second.duration_s, 50)
    for law, from_s in ((first, 0.0), (second, first.duration_s)):
        inside = t_s[t_s < law.duration_s]
        assert both.at(inside + from_s)[0] == pytest.approx(law.at(inside)[0], abs=1e-9)
        assert both.at(inside + from_s)[1] == pytest.approx(law.at(inside)[1], abs=1e-9)
    assert both.times_at(np.array([1.0, 2.5]))[1] == pytest.approx(first.duration_s + second.time_at(2.5), abs=1e-8)


def same_as_its_pieces(path: FlowPath | PiecewisePath) -> None:
    """Compare places, directions, curvatures and the tool's speeds with those of each piece by itself."""
    assert isinstance(path, FlowPath)
    pieces = PiecewisePath(path.robot, path.pieces)
    ours, theirs = path.rates(), pieces.rates()
    assert ours.s == pytest.approx(theirs.s, abs=1e-9)
    assert ours.joints == pytest.approx(theirs.joints, abs=1e-9)
    assert ours.first == pytest.approx(theirs.first, abs=1e-8)
    assert ours.second == pytest.approx(theirs.second, abs=1e-5)
    assert ours.tool == pytest.approx(theirs.tool, abs=1e-6)
    s = np.linspace(0.0, float(path.starts[-1]), 200)
    assert path.at(s)[0] == pytest.approx(pieces.at(s)[0], abs=1e-9)
    assert path.tool(s) == pytest.approx(pieces.tool(s), abs=1e-6)
    assert path.limits().speeds == pytest.approx(pieces.limits().speeds)


def test_lines_arcs_and_joint_moves_together_are_what_each_is_by_itself() -> None:
    pace = Pace(100.0, 60.0, 90.0)
    lines = tool_legs(ROBOT, START, [(-30.0, 0.0, 0.0), (0.0, -25.0, 0.0)], pace)
    here = lines[-1].followed.end
    pose = make_kinematics(ROBOT).forward(here[np.newaxis])[0]
    path = Arc.around(tuple(pose.tolist()), (pose[0] + 10.0, pose[1]), 70.0, turned=True)
    arc = ToolLeg(FollowedPath.along(ROBOT, path, lines[-1].followed.branch, here), pace)
    here = arc.followed.end
    moves = [JointLeg(ROBOT, begin, end, Pace(50.0, 80.0)) for begin, end in pairwise([here, here + 8.0, here - 8.0])]
    same_as_its_pieces(flowing(ROBOT, [*lines, arc, *moves], [3.0, 2.0, 4.0, 2.0]).path)


def test_lines_of_a_tool_that_turns_in_space_are_too() -> None:
    robot = load_robot("parol6")
    start = np.array([10.0, -80.0, 170.0, 5.0, 40.0, 180.0])
    same_as_its_pieces(flowing(robot, tool_legs(robot, start, [(8.0, 0.0, 0.0), (0.0, 9.0, 2.0)]), [2.0]).path)
