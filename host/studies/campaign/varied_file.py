"""The robot file of a run whose robot was varied: whatever reads the folder of the run needs the robot as it was."""

import tomllib
from dataclasses import replace
from typing import Any

from steptwin.host.common.errors import InputError
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.reader import read_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.studies.campaign.toml_text import toml_text
from steptwin.host.studies.campaign.trial import Trial


def with_varied_file(trial: Trial) -> Trial:
    """Return the same run with a robot whose file says what was varied; its comments are lost if anything was.

    A file may not state speeds for which the drivers cannot step fast enough, as with more microsteps. There it states
    the highest speed that they manage: the run was no faster.

    Raises:
        InputError: the robot's file cannot say what was varied.
    """
    robot = trial.setup.robot
    text = _varied_text(robot, f"# {robot.name} as drawn for seed {trial.seed} of a campaign\n")
    return replace(trial, setup=replace(trial.setup, robot=replace(robot, toml=text)))


def _varied_text(robot: Robot, head: str) -> str:
    if read_robot(robot.toml) == robot:
        return robot.toml
    stated = replace(robot, joints=tuple(_within(joint, robot.board.driver_rate_max_hz) for joint in robot.joints))
    document = tomllib.loads(robot.toml)
    document["board"]["bitrate"] = stated.board.bitrate
    for joint in stated.joints:
        _state(joint, document["joints"][joint.name])
    if stated.dynamics is not None:
        document["dynamics"]["payload_kg"] = stated.dynamics.payload_kg
    text = head + toml_text(document)
    if read_robot(text) != stated:
        raise InputError(f"{robot.name}: its file cannot say what was varied")
    return text


def _within(joint: Joint, rate_max_hz: float) -> Joint:
    """Return a joint that is as fast as its driver manages, if it were faster."""
    if joint.step_rate_max_hz <= rate_max_hz:
        return joint
    fastest = rate_max_hz / joint.transmission.steps_per_unit
    return replace(joint, axis_speed_max=fastest) if joint.axis_speed_max else replace(joint, speed_max=fastest)


def _state(joint: Joint, keys: dict[str, Any]) -> None:
    keys["microsteps"] = joint.transmission.microsteps
    for key in ("speed_max", "acceleration_max", "axis_speed_max", "axis_acceleration_max"):
        if getattr(joint, key) is not None:
            keys[key] = getattr(joint, key)
    if joint.homing is not None:
        keys["homing"]["acceleration"] = joint.homing.acceleration
    if joint.motor is not None:
        keys["motor"]["friction_nm"] = joint.motor.friction_nm
