"""The robot file of a run that is made again: read, it is the robot as the campaign has varied it."""

from dataclasses import replace
from typing import Any

import pytest

from steptwin.features.campaigns.trial import Trial, draw, with_varied_file
from steptwin.features.campaigns.variations import set_up
from steptwin.host.robots import load_robot, robot_names
from steptwin.host.robots.reader import read_robot
from steptwin.host.robots.robot import Robot
from tests.features.campaigns.campaigns import SMALL, campaign_of


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Trial:
    return draw(campaign_of(SMALL, tmp_path_factory.mktemp("varied")), 3)


def _filed(trial: Trial, robot: Robot, **varied: Any) -> tuple[Robot, Robot]:
    """Return a robot as varied, and as the file of its run has it."""
    setup = set_up(robot, varied)
    filed = with_varied_file(replace(trial, setup=setup)).setup.robot
    assert filed == setup.robot
    return setup.robot, read_robot(filed.toml)


@pytest.mark.parametrize("name", robot_names())
def test_a_varied_robot_is_in_its_file(trial: Trial, name: str) -> None:
    """Payload and friction only if its file says something of its dynamics, which an AR4's does not."""
    robot = load_robot(name)
    dynamics = {"payload_kg": 1.25, "friction": 1.5} if robot.dynamics else {}
    varied, filed = _filed(trial, robot, **dynamics, microsteps=2, bitrate=500_000)
    assert filed == varied
    assert (filed.dynamics.payload_kg if filed.dynamics else None) == dynamics.get("payload_kg")
    assert filed.board.bitrate == 500_000
    assert {joint.transmission.microsteps for joint in filed.joints} == {2}


def test_ramps_that_the_motors_manage_are_in_the_file(trial: Trial) -> None:
    robot = load_robot("teaching-scara")
    varied, filed = _filed(trial, robot, ramps="motors")
    assert filed == varied
    assert filed != robot


@pytest.mark.parametrize("name", robot_names())
def test_speeds_for_which_the_drivers_are_too_slow_are_lowered(trial: Trial, name: str) -> None:
    varied, filed = _filed(trial, load_robot(name), microsteps=16)
    for given, stated in zip(varied.joints, filed.joints, strict=True):
        assert stated == replace(given, speed_max=stated.speed_max)
        part = varied.board.driver_rate_max_hz / given.step_rate_max_hz
        assert stated.speed_max == pytest.approx(given.speed_max * min(part, 1.0), rel=1e-12)


def test_what_is_not_in_the_file_leaves_its_text(trial: Trial) -> None:
    robot = load_robot("teaching-scara")
    varied = with_varied_file(replace(trial, setup=set_up(robot, {"record_ms": 5})))
    assert varied.setup.robot.toml == robot.toml


def test_a_robot_says_which_seed_it_is_of(trial: Trial) -> None:
    setup = set_up(load_robot("teaching-scara"), {"microsteps": 8})
    text = with_varied_file(replace(trial, setup=setup)).setup.robot.toml
    assert text.startswith("# teaching-scara as drawn for seed 3 of a campaign\n")


def test_its_file_keeps_its_comments(trial: Trial) -> None:
    robot = load_robot("teaching-scara")
    text = with_varied_file(replace(trial, setup=set_up(robot, {"microsteps": 2}))).setup.robot.toml
    assert text.count("#") == robot.toml.count("#") + 1
