"""Homings beyond what the motors manage are told in words."""

from dataclasses import replace

import pytest

from steptwin import load_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.drivers import driver_profile
from steptwin.host.twin.motors.ramps import ramps_of
from steptwin.host.twin.motors.steep_homings import steep_homings

LAB = load_robot("lab-scara")


def homing_at(name: str, acceleration: float) -> Robot:
    """Return the laboratory arm, one of whose joints homes with this acceleration."""
    homing = LAB.joint(name).homing
    assert homing
    changed = replace(LAB.joint(name), homing=replace(homing, acceleration=acceleration))
    return replace(LAB, joints=tuple(changed if each.name == name else each for each in LAB.joints))


@pytest.mark.parametrize(
    ("joint", "what"), [("th2", "th2: homing stalls at"), ("th3", "th3: homing turns th2 out of step at")]
)
def test_homings_beyond_what_motors_manage_are_told(joint: str, what: str) -> None:
    """On both sides of what they manage; other drivers have a current of their own."""
    homing = ramps_of(LAB)[LAB.index_of(joint)].homing
    assert homing
    own = driver_profile(LAB.board)
    assert steep_homings(homing_at(joint, homing.managed), own) == []
    (told,) = steep_homings(homing_at(joint, 1.01 * homing.managed), own)
    assert told.startswith(f"{what} {1.01 * homing.managed:g} deg/s2 where")
    assert f"manage {homing.managed:.0f} (joints.{joint}.homing.acceleration in" in told
    assert what in " ".join(steep_homings(homing_at(joint, homing.managed), replace(own, current_a=0.8)))
