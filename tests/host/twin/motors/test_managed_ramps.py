"""Ramps that a robot's motors manage: none is higher than before, each is at most half of what they manage."""

from dataclasses import replace

import pytest

from steptwin import load_robot
from steptwin.host.common.errors import InputError
from steptwin.host.robots import robot_names
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.motors.managed_ramps import RAMP_PART, with_managed_ramps
from steptwin.host.twin.motors.ramps import JointRamps, ramps_of
from tests.host.robots.coupled import coupled_robot


def with_payload(robot: Robot, payload_kg: float) -> Robot:
    assert robot.dynamics is not None
    return replace(robot, dynamics=replace(robot.dynamics, payload_kg=payload_kg))


@pytest.fixture(scope="module")
def ramps() -> dict[str, tuple[JointRamps, ...]]:
    return {name: ramps_of(load_robot(name)) for name in robot_names()}


@pytest.mark.parametrize("name", robot_names())
def test_homings_of_our_robots_leave_30_percent(name: str, ramps: dict[str, tuple[JointRamps, ...]]) -> None:
    homings = [each.homing for each in ramps[name] if each.homing]
    assert [ramp for ramp in homings if ramp.asked > 0.7 * ramp.managed] == []


@pytest.mark.parametrize("name", robot_names())
def test_ramps_are_the_lower_of_the_files_and_half_of_the_managed(
    name: str, ramps: dict[str, tuple[JointRamps, ...]]
) -> None:
    robot = load_robot(name)
    for before, after, known in zip(robot.joints, with_managed_ramps(robot).joints, ramps[name], strict=True):
        half = RAMP_PART * known.moving.managed
        assert after.acceleration_max == pytest.approx(min(before.acceleration_max, half))
        assert before.homing
        assert after.homing
        assert known.homing
        wanted = min(before.homing.acceleration, RAMP_PART * known.homing.managed, after.acceleration_max)
        assert after.homing.acceleration == pytest.approx(wanted)
        # Nothing else has changed.
        assert replace(after, acceleration_max=before.acceleration_max, homing=before.homing) == before


def test_a_payload_makes_them_lower_and_the_same_robot_is_looked_at_once() -> None:
    robot = load_robot("lab-scara")
    own, loaded = with_managed_ramps(robot), with_managed_ramps(with_payload(robot, 1.0))
    assert loaded.joint("th2").acceleration_max < 0.8 * own.joint("th2").acceleration_max
    assert with_managed_ramps(load_robot("lab-scara")) is own


@pytest.mark.parametrize(
    ("name", "payload_kg", "joint", "weak"),
    [("warehouse-scara", 50.0, "sz", "sz"), ("lab-scara", 2.0, "th2", "th3")],
)
def test_a_load_that_a_motor_cannot_carry_is_refused(name: str, payload_kg: float, joint: str, weak: str) -> None:
    """The weight on a lift; at an elbow the centrifugal force while the shoulder turns at its highest speed."""
    message = f"^{joint}: without any acceleration {weak}'s motor is too weak for {joint}'s highest speed$"
    with pytest.raises(InputError, match=message):
        with_managed_ramps(with_payload(load_robot(name), payload_kg))


def test_a_coupled_axis_gets_a_lower_limit_of_its_own() -> None:
    """Of the joint th2, whose motor the shoulder turns along: that of its axis, by which it stops, in proportion."""
    robot = coupled_robot(axis_acceleration_max="50000.0")
    known, after = ramps_of(robot)[1], with_managed_ramps(robot).joint("th2")
    assert known.moving.asked == 50000.0
    lowered = RAMP_PART * known.moving.managed
    assert after.axis_acceleration_max == pytest.approx(lowered)
    assert after.acceleration_max == pytest.approx(robot.joint("th2").acceleration_max * lowered / 50000.0)
