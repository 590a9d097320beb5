"""Ramps that a robot's motors manage: all at once with torque to spare, and none higher than before."""

from dataclasses import replace
from math import inf

import pytest

from steptwin import load_robot
from steptwin.features.motors.turning.ramps import JointRamps, ramps_of, with_managed_ramps
from steptwin.host.common.errors import InputError
from steptwin.host.robots import robot_names
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.reader import parse_robot
from steptwin.host.robots.robot import Robot
from tests.host.robots.coupled import coupled_robot, coupled_text
from tests.messages import refusing


def with_payload(robot: Robot, payload_kg: float) -> Robot:
    assert robot.dynamics is not None
    return replace(robot, dynamics=replace(robot.dynamics, payload_kg=payload_kg))


MOVED = [name for name in robot_names() if load_robot(name).dynamics]
"""The robots whose files have motors and masses."""


@pytest.fixture(scope="module")
def ramps() -> dict[str, tuple[JointRamps, ...]]:
    return {name: ramps_of(load_robot(name)) for name in MOVED}


@pytest.mark.parametrize("name", MOVED)
def test_homings_of_our_robots_leave_30_percent(name: str, ramps: dict[str, tuple[JointRamps, ...]]) -> None:
    homings = [each.homing for each in ramps[name] if each.homing]
    assert [ramp for ramp in homings if ramp.asked > 0.7 * ramp.managed] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", MOVED)
def test_all_may_ramp_at_once_and_none_is_lower_than_it_must_be(
    name: str, ramps: dict[str, tuple[JointRamps, ...]]
) -> None:
    """Each motor keeps 30 %; a joint that is lowered takes part in what asks just so much of a motor."""
    robot = load_robot(name)
    after = with_managed_ramps(robot).joints
    for kind in ("moving", "homing"):
        known = [getattr(each, kind) for each in ramps[name]]
        accelerations = [of_axis(joint) if kind == "moving" else homing_of(joint) for joint in after]
        asked = {
            motor: sum(got / ramp.by_motor[motor] for got, ramp in zip(accelerations, known, strict=True))
            for motor in robot.axis_names
        }
        assert max(asked.values()) <= 0.7 + 1e-9
        for got, ramp in zip(accelerations, known, strict=True):
            assert got <= ramp.asked
            if got < ramp.asked and kind == "moving":
                assert max(asked[motor] for motor, most in ramp.by_motor.items() if most < inf) > 0.7 - 1e-6


def of_axis(joint: Joint) -> float:
    return joint.axis_acceleration_max or joint.acceleration_max


def homing_of(joint: Joint) -> float:
    assert joint.homing
    return joint.homing.acceleration


def test_nothing_else_changes() -> None:
    robot = load_robot("lab-scara")
    for before, after in zip(robot.joints, with_managed_ramps(robot).joints, strict=True):
        assert before.homing
        assert after.homing
        homing = replace(after.homing, acceleration=before.homing.acceleration)
        assert replace(after, acceleration_max=before.acceleration_max, homing=homing) == before


def test_a_payload_makes_them_lower_and_the_same_robot_is_looked_at_once() -> None:
    robot = load_robot("lab-scara")
    own, loaded = with_managed_ramps(robot), with_managed_ramps(with_payload(robot, 1.0))
    assert loaded.joint("th2").acceleration_max < 0.8 * own.joint("th2").acceleration_max
    assert with_managed_ramps(load_robot("lab-scara")) is own


@pytest.mark.parametrize(
    ("name", "payload_kg"),
    [("warehouse-scara", 50.0), ("lab-scara", 2.0)],
)
def test_a_load_that_a_motor_cannot_carry_is_refused(name: str, payload_kg: float) -> None:
    """The weight on a lift; at an elbow the centrifugal force while the shoulder turns at its highest speed."""
    with refusing(InputError):
        with_managed_ramps(with_payload(load_robot(name), payload_kg))


def test_a_coupled_axis_gets_a_lower_limit_of_its_own() -> None:
    """Of the joint th2, whose motor the shoulder turns along: that of its axis, by which it stops, in proportion."""
    robot = coupled_robot(axis_acceleration_max="50000.0")
    known, after = ramps_of(robot)[1].moving, with_managed_ramps(robot).joint("th2")
    assert known.asked == 50000.0
    assert after.axis_acceleration_max
    assert 0.3 * known.managed < after.axis_acceleration_max < 0.7 * known.managed
    part = after.axis_acceleration_max / 50000.0
    assert after.acceleration_max == pytest.approx(robot.joint("th2").acceleration_max * part)


@pytest.mark.parametrize("payload_kg", [0.6, 1.0])
def test_a_homing_stays_within_the_lowered_limit_of_an_axis_that_its_joint_moves_twice_as_far(
    payload_kg: float,
) -> None:
    text = coupled_text("th2 = { th1 = 1.0, th2 = 2.0 }").replace("acceleration = 720.0", "acceleration = 450.0")
    after = with_managed_ramps(with_payload(parse_robot(text, "belt.toml"), payload_kg)).joint("th2")
    assert after.acceleration_max < 900.0
    assert homing_of(after) == pytest.approx(after.acceleration_max / 2.0, rel=1e-12)
