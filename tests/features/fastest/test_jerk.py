"""The jerk of a machine: how long its motions are averaged, and how fast its straight moves are."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.features.fastest.corners import flowing
from steptwin.features.fastest.rows import machine_average_s
from steptwin.host.common.errors import InputError
from steptwin.host.robots import brought_text, load_robot, read_robot
from steptwin.host.robots.robot import Robot
from tests.features.fastest.paths import joint_legs
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


def test_a_file_names_the_jerk_of_a_joint() -> None:
    text = brought_text("teaching-scara")

    def read(jerk: str) -> Robot:
        return read_robot(text.replace("acceleration_max", f"jerk_max = {jerk}\nacceleration_max", 1))

    assert [joint.jerk_max for joint in read("50000.0").joints] == [50_000.0, None, None, None]
    with refusing(InputError):
        read("0.0")
