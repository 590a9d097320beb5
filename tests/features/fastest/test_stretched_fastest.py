"""A fastest motion that is stretched: its cubics meet at points of their own, and no record lasts a millisecond."""

import numpy as np
import pytest

from steptwin.features.fastest.chain import timed_chains
from steptwin.features.fastest.corners import JointLeg
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.composer import sequence
from steptwin.host.planning.motions.sampled import hermite_spline
from steptwin.host.planning.motions.stretched import stretched
from steptwin.host.planning.motions.whole import Pace
from steptwin.host.planning.planner import plan, plan_stretched
from steptwin.host.robots import load_robot

ROBOT = load_robot("teaching-scara")


@pytest.fixture(scope="module")
def fastest() -> Motion:
    leg = JointLeg(ROBOT, np.array([0.0, 20.0, 0.0, 0.0]), np.array([70.0, -40.0, 60.0, 90.0]), Pace())
    (chain,) = timed_chains(ROBOT, [leg], [])
    return chain.timed.motion


@pytest.mark.parametrize("factor", [1.1, 1.3, 1.37, 1.77, 2.5, 3.333])
def test_no_record_lasts_a_millisecond(fastest: Motion, factor: float) -> None:
    """Stretched by 1.37 a third of the records did. Only the last one may: a motion ends where it ends."""
    records_ms = np.diff(plan_stretched(ROBOT, fastest, factor).times_ms)
    assert records_ms[:-1].min() >= 2
    assert plan(ROBOT, fastest).times_ms.size <= records_ms.size


@pytest.mark.parametrize("factor", [1.3, 1.37])
def test_the_records_stay_at_the_motion(fastest: Motion, factor: float) -> None:
    """Between its points each cubic is within 0.002 step of the stretched motion: a third of the tolerance."""
    made = plan_stretched(ROBOT, fastest, factor)
    t_s = np.arange(0, made.times_ms[-1] * 4 + 1) / 4000
    motion = stretched(fastest, factor)
    at_s = made.times_ms / 1000
    again = hermite_spline(ROBOT.joint_names, at_s, motion.positions(at_s), motion.velocities(at_s))
    off = np.abs(ROBOT.to_steps(again.positions(t_s)) - ROBOT.to_steps(motion.positions(t_s)))
    assert off.max() < 0.002


def test_where_the_acceleration_jumps_both_milliseconds_stay(fastest: Motion) -> None:
    """A seam of two motions, and a curve of three straight parts, are no cubics of a fastest motion."""
    positions = np.array([[0.0] * 4, [1.0] * 4, [3.0] * 4, [3.5] * 4])
    velocities = np.array([[0.0] * 4, [12.0] * 4, [9.0] * 4, [0.0] * 4])
    steep = hermite_spline(ROBOT.joint_names, np.array([0.0, 0.1, 0.3, 0.4]), positions, velocities)
    assert steep.smooth_ms == frozenset()
    assert stretched(steep, 1.115).breakpoints_s == (0.111, 0.112, 0.334, 0.335)
    end_ms = round(1000 * fastest.duration_s)
    both = sequence(ROBOT.joint_names, [fastest, steep])
    assert end_ms not in both.smooth_ms
    assert {each for each in both.smooth_ms if each < end_ms} == fastest.smooth_ms
