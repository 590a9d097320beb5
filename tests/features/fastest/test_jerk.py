"""The jerk of a machine: how long its motions are averaged, and how fast its straight moves are."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.features.fastest.chain import timed_chains
from steptwin.features.fastest.corners import flowing
from steptwin.features.fastest.rows import machine_average_s
from steptwin.host.common.errors import InputError
from steptwin.host.planning.laws import SCurve
from steptwin.host.planning.motions.sampled import Spline
from steptwin.host.planning.planner import plan
from steptwin.host.robots import brought_text, load_robot, read_robot
from steptwin.host.robots.robot import Robot
from tests.features.fastest.paths import joint_legs
from tests.features.fastest.test_executed import use
from tests.laws import law_of
from tests.messages import refusing

ROBOT = load_robot("teaching-scara")
START = np.array([0.0, 90.0, 20.0, 0.0])
TURN, LIFT = np.array([30.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 10.0, 0.0])


def with_jerk(robot: Robot, average_s: float) -> Robot:
    """Return the robot whose joints all have the jerk of an averaging time."""
    joints = (replace(each, jerk_max=2.0 * each.acceleration_max / average_s) for each in robot.joints)
    return replace(robot, joints=tuple(joints))


def average_of(robot: Robot, travel: np.ndarray) -> float:
    return machine_average_s(
        robot, flowing(robot, joint_legs(robot, np.array([START, START + travel])), []).path.rates()
    )


def test_a_machine_is_averaged_by_the_jerk_of_the_joints_that_move() -> None:
    first = replace(ROBOT.joints[0], jerk_max=100_000.0)  # of 1000 deg/s2
    robot = replace(ROBOT, joints=(first, *ROBOT.joints[1:]))
    assert average_of(ROBOT, TURN) == 0.05
    assert average_of(robot, TURN) == pytest.approx(0.02)
    assert average_of(robot, LIFT) == 0.05
    assert average_of(robot, TURN + LIFT) == 0.05
    slow = replace(robot, joints=(replace(first, jerk_max=10_000.0), *robot.joints[1:]))
    assert average_of(slow, TURN + LIFT) == pytest.approx(0.2)


def test_records_hold_no_shorter_average_than_ten_milliseconds() -> None:
    assert average_of(with_jerk(ROBOT, 0.011), TURN) == pytest.approx(0.011)
    assert average_of(with_jerk(ROBOT, 0.009), TURN) == 0.01


@pytest.mark.parametrize("average_s", [0.05, 0.01])
@pytest.mark.parametrize("way_deg", [0.2, 3.0, 80.0])
def test_a_straight_move_is_the_s_curve_of_its_jerk_and_no_cubic_exceeds_a_limit(
    average_s: float, way_deg: float
) -> None:
    robot = with_jerk(ROBOT, average_s)
    legs = joint_legs(robot, np.array([START, START + way_deg * TURN / 30.0]))
    (chain,) = timed_chains(robot, legs, [])
    th1 = robot.joints[0]
    assert th1.jerk_max is not None
    best = SCurve.fastest(way_deg, th1.speed_max, th1.acceleration_max, th1.jerk_max)
    assert chain.timed.law.duration_s == pytest.approx(best.duration_s, abs=1e-9)
    assert use(robot, chain.timed) <= 1.0
    assert np.abs(np.asarray(law_of(chain.timed.motion, Spline).curve.c)[0, :, 0]).max() * 6.0 <= th1.jerk_max * (
        1 + 1e-6
    )
    plan(robot, chain.timed.motion)


def test_a_move_without_the_jerk_of_one_of_its_joints_is_averaged() -> None:
    robot = with_jerk(ROBOT, 0.05)
    robot = replace(robot, joints=(*robot.joints[:2], replace(robot.joints[2], jerk_max=None), robot.joints[3]))
    for travel in (LIFT, TURN + LIFT):
        legs = joint_legs(robot, np.array([START, START + travel]))
        with_it, without = (timed_chains(each, legs, [])[0].timed.law.duration_s for each in (robot, ROBOT))
        assert with_it == without


def test_stops_between_straight_legs_have_their_s_curves() -> None:
    robot = with_jerk(ROBOT, 0.01)
    legs = joint_legs(robot, np.array([START, START + TURN, START + TURN + LIFT]))
    apart_s = sum(timed_chains(robot, [leg], [])[0].timed.law.duration_s for leg in legs)
    (chain,) = timed_chains(robot, legs, [0.001])
    assert [corner.stops for corner in chain.flow.corners] == [True]
    assert chain.timed.law.duration_s == pytest.approx(apart_s, abs=1e-9)


def test_a_file_names_the_jerk_of_a_joint() -> None:
    text = brought_text("teaching-scara")

    def read(jerk: str) -> Robot:
        return read_robot(text.replace("acceleration_max", f"jerk_max = {jerk}\nacceleration_max", 1))

    assert [joint.jerk_max for joint in read("50000.0").joints] == [50_000.0, None, None, None]
    with refusing(InputError):
        read("0.0")
