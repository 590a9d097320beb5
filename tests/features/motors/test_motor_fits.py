"""What `motors ROBOT` says of accelerations: whose motor gives way, and which homings are too hard."""

from dataclasses import replace

import pytest

from steptwin import load_robot
from steptwin.features.motors.command import print_ramps, warn_of_steep_homings
from steptwin.features.motors.sizing.fitting import JointFit, fits_of
from steptwin.host.robots.joint import Joint

STEEP = {"th2": 80.0, "th3": 360.0}


def steep(joint: Joint) -> Joint:
    assert joint.homing
    return replace(joint, homing=replace(joint.homing, acceleration=STEEP.get(joint.name, joint.homing.acceleration)))


@pytest.fixture(scope="module")
def fits() -> tuple[JointFit, ...]:
    robot = load_robot("lab-scara")
    return fits_of(replace(robot, joints=tuple(map(steep, robot.joints))), others=())


def test_a_homing_is_warned_of_that_stalls_or_turns_another_motor_out_of_step(
    fits: tuple[JointFit, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    warn_of_steep_homings(fits)
    stalls, turns = capsys.readouterr().err.splitlines()
    assert stalls == (
        "steptwin: warning: th2: homing stalls at 80 deg/s2 where the arm is hardest to turn: its motors manage 66"
        " (joints.th2.homing.acceleration in the robot's file)"
    )
    assert turns.startswith("steptwin: warning: th3: homing turns th2 out of step at 360 deg/s2 where ")
    assert "its motors manage 212 (joints.th3.homing" in turns


def test_the_table_names_the_joint_that_gives_way_if_it_is_another(
    fits: tuple[JointFit, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    print_ramps(fits)
    rows = {line.split()[0]: line.split()[2:] for line in capsys.readouterr().out.splitlines()[2:]}
    assert rows["th2"] == ["1500", "65", "80", "66"]
    assert rows["th3"] == ["1500", "th2:", "179", "360", "th2:", "212"]
