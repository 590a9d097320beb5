"""Homings beyond what the motors manage are told in words."""

from dataclasses import replace

import pytest

from steptwin import load_robot
from steptwin.features.motors.turning.ramps import ramps_of, steep_homings
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.drivers import DriverSetup, driver_profile, driver_settings
from steptwin.protocol.drivers import bare_chip
from steptwin.protocol.drivers.tb6560 import THREE_AMP_MODULE

LAB = load_robot("lab-scara")
CHIP = THREE_AMP_MODULE.chip


def homing_at(name: str, acceleration: float) -> Robot:
    """Return the laboratory arm, one of whose joints homes with this acceleration."""
    homing = LAB.joint(name).homing
    assert homing
    changed = replace(LAB.joint(name), homing=replace(homing, acceleration=acceleration))
    return replace(LAB, joints=tuple(changed if each.name == name else each for each in LAB.joints))


@pytest.mark.slow
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


@pytest.mark.slow
def test_other_drivers_have_settings_of_their_own() -> None:
    """A module lowers the current of a shoulder that stands while the elbow homes; what the file says is not of it."""
    homing = ramps_of(LAB)[LAB.index_of("th3")].homing
    assert homing
    idle = ramps_of(LAB, THREE_AMP_MODULE)[LAB.index_of("th3")].homing
    assert idle
    assert idle.by_motor["th3"] == homing.by_motor["th3"]
    assert 0.4 * homing.by_motor["th2"] < idle.by_motor["th2"] < 0.6 * homing.by_motor["th2"]
    (told,) = steep_homings(LAB, THREE_AMP_MODULE)
    assert told.startswith("th3: homing turns th2 out of step at 145 deg/s2 where")


def test_settings_are_the_files_for_its_own_drivers_only() -> None:
    """Also one of 0; drivers that are not switched have no current of their own at standstill."""
    module = replace(LAB.board, driver_profile="3a-module", osc_pf=None)
    stated = replace(module, current_a=1.2, idle_percent=20, fast_decay_percent=0)
    other = replace(THREE_AMP_MODULE, current_a=2.0, idle_percent=50, fast_decay_percent=25)
    assert driver_settings(module, THREE_AMP_MODULE) == DriverSetup(CHIP, 1.5, 0.5, 0.0, by_pins=False)
    assert driver_settings(stated, THREE_AMP_MODULE) == DriverSetup(CHIP, 1.2, 0.2, 0.0, by_pins=False)
    assert driver_settings(stated, other) == DriverSetup(CHIP, 2.0, 0.5, 0.25, by_pins=False)
    assert driver_settings(stated, bare_chip(330)) == DriverSetup(CHIP, 1.5, 1.0, 0.0)
