"""How much faster a motion may be executed: what is stated passes as a plan of that time, and hardly more does."""

from dataclasses import replace
from functools import cache

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.host.common.errors import InputError
from steptwin.host.planning.laws import Cubic, Trapezoid
from steptwin.host.planning.motions.joint_move import joint_move
from steptwin.host.planning.plan import BITS_OF_A_RECORD, BUS_PART, Plan, highest_speed
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot

ROBOT = replace(load_robot("teaching-scara"), dynamics=None)
"""Without motors: they have tests of their own."""
START = (0.0, 10.0, 0.0, 0.0)


def tireless(robot: Robot) -> Robot:
    """Return the robot with joints whose motors could do anything: only the driver limits their speeds."""
    joints = tuple(replace(joint, speed_max=1e6, acceleration_max=1e9) for joint in robot.joints)
    return replace(robot, joints=joints)


ROBOTS = {"joints": ROBOT, "driver": tireless(ROBOT)}
"""Robots by what limits their speeds."""


def turned(duration_s: float, robot: Robot = ROBOT, law: type[Cubic] = Cubic) -> Plan:
    goal = (60.0, 10.0, 0.0, 0.0)
    return plan(robot, joint_move(robot.joint_names, START, goal, law(1.0, duration_s)))


@cache
def shortest_s(name: str) -> float:
    """Return the least whole number of milliseconds in which the turn passes."""
    low_ms, high_ms = 1, 20_000
    while high_ms - low_ms > 1:
        middle_ms = (low_ms + high_ms) // 2
        try:
            turned(middle_ms / 1000, ROBOTS[name])
            high_ms = middle_ms
        except InputError:
            low_ms = middle_ms
    return high_ms / 1000


@pytest.mark.parametrize("name", ROBOTS)
@settings(max_examples=25, deadline=None)
@given(percent=st.integers(100, 160))
def test_what_is_stated_passes_and_hardly_more_does(name: str, percent: int) -> None:
    """A motion in `percent` of its shortest time may be as much faster: within the rounding to percents and points."""
    found = highest_speed(turned(round(shortest_s(name) * percent / 100, 3), ROBOTS[name]))
    assert found.percent == pytest.approx(min(150, percent), abs=1)
    assert (found.by == "this is the highest speed") is (found.percent == 150)


def test_a_slow_motion_may_be_half_as_fast_again_and_one_at_its_limit_no_faster() -> None:
    assert highest_speed(turned(60.0)) == (150, "this is the highest speed")
    at_limit = highest_speed(turned(shortest_s("joints")))
    assert at_limit.percent == 100
    assert at_limit.by.startswith("th1: ")


def test_accelerations_grow_with_the_square() -> None:
    """A trapezoid with 1 / 1.4401 of th1's acceleration for 50 ms, whose speed is far below its limit: 120 %."""
    acceleration = ROBOT.joint("th1").acceleration_max / 1.4401
    goal = (0.05 * acceleration * 0.95, 10.0, 0.0, 0.0)
    made = plan(ROBOT, joint_move(ROBOT.joint_names, START, goal, Trapezoid(1.0, 1.0, 0.05)))
    assert highest_speed(made) == (120, "th1: mean acceleration over 1 ms")


def test_the_bus_must_carry_the_records() -> None:
    """Four axes with points every 10 ms are 54 000 bit/s: of 80 kbit/s, of which 80 % count, 118 %."""
    made = turned(60.0)
    for bitrate, percent in ((125_000, 150), (80_000, 118), (50_000, 100)):
        board = replace(ROBOT.board, bitrate=125_000)
        object.__setattr__(board, "bitrate", bitrate)  # also one that no CAN controller has
        of_bus = highest_speed(replace(made, robot=replace(ROBOT, board=board)))
        assert of_bus.percent == percent
        assert 4 * 100 * BITS_OF_A_RECORD * percent / 100 <= max(BUS_PART * bitrate, 54_000)
