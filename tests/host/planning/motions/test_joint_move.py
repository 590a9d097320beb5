"""Joint moves: all joints in step, straight in joint space, and within each joint's limits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.common.errors import InputError
from steptwin.host.planning.laws import Cubic, Law, Quintic, SCurve, Trapezoid
from steptwin.host.planning.motions.joint_move import JointMove, joint_move, limits_along
from steptwin.host.robots import load_robot
from tests.laws import law_of
from tests.messages import refusing

ROBOT = load_robot("lab-scara")
START, GOAL = (10.0, -20.0, 30.0, 200.0), (200.0, -20.0, -45.0, -160.0)
WAY = np.array([190.0, 0.0, -75.0, -360.0])
LAWS: list[Law] = [Trapezoid(1.0, 2.0, 0.5), Cubic(1.0, 1.5), Quintic(1.0, 1.5), SCurve(1.0, 2.0, 0.6, 0.2)]


@pytest.mark.parametrize("law", LAWS)
def test_all_joints_are_at_the_same_fraction(law: Law) -> None:
    move = joint_move(ROBOT.joint_names, START, GOAL, law)
    t_s = np.linspace(0.0, law.duration_s, 101)
    assert move.positions(t_s) == pytest.approx(np.array(START) + np.outer(law.position(t_s), WAY), abs=1e-9)
    assert move.velocities(t_s) == pytest.approx(np.outer(law.velocity(t_s), WAY), abs=1e-9)
    assert law_of(move, JointMove).accelerations(t_s) == pytest.approx(np.outer(law.acceleration(t_s), WAY), abs=1e-9)


@pytest.mark.parametrize("law", LAWS)
def test_it_goes_from_start_to_goal_at_rest(law: Law) -> None:
    move = joint_move(ROBOT.joint_names, START, GOAL, law)
    ends_s = np.array([0.0, move.duration_s])
    assert move.positions(ends_s).tolist() == [list(START), list(GOAL)]
    assert np.abs(move.velocities(ends_s)).max() == 0.0
    assert (move.duration_s, move.breakpoints_s, move.output_changes) == (law.duration_s, law.breakpoints_s, ())


@pytest.mark.parametrize("distance", [0.0, 0.5, -1.0, 90.0, np.nan])
def test_a_law_of_another_distance_is_refused(distance: float) -> None:
    with refusing(InputError):
        joint_move(ROBOT.joint_names, START, GOAL, Cubic(distance, 1.0))


@pytest.mark.parametrize(
    ("way", "speed", "acceleration"),
    [
        ((70.0, 0.0, 0.0, 0.0), 2.0, 500.0 / 70.0),  # d1: 140 mm/s, 500 mm/s^2
        ((-70.0, 0.0, 0.0, 0.0), 2.0, 500.0 / 70.0),
        ((0.0, 65.0, 0.0, 0.0), 2.0, 1500.0 / 65.0),  # th2, th3, th4: 130 deg/s, 1500 deg/s^2
        ((70.0, 65.0, -130.0, 13.0), 1.0, 500.0 / 70.0),  # th3 limits the speed, d1 the acceleration
        ((0.0, 0.0, 0.0, 0.0), np.inf, np.inf),
        ((1e-310, 0.0, 0.0, 0.0), np.inf, np.inf),
    ],
)
def test_limits_along_a_way(way: tuple[float, ...], speed: float, acceleration: float) -> None:
    assert limits_along(ROBOT, np.array(way)) == pytest.approx((speed, acceleration))


@given(st.tuples(*[st.floats(-300.0, 300.0).map(lambda way: round(way, 6))] * 4))
def test_a_move_at_these_limits_just_keeps_the_joints(way: tuple[float, ...]) -> None:
    speed, acceleration = limits_along(ROBOT, np.array(way))
    for limit, joint_limits in (
        (speed, [joint.speed_max for joint in ROBOT.joints]),
        (acceleration, [joint.acceleration_max for joint in ROBOT.joints]),
    ):
        if any(way):
            parts = limit * np.abs(way) / joint_limits
            assert parts.max() == pytest.approx(1.0)
        else:
            assert limit == np.inf
