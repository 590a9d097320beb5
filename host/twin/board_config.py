"""Describe a robot's machine to the emulator: its boards, their drivers, and its switches."""

from collections.abc import Iterator, Sequence

from steptwin.emulator.board import BoardConfig
from steptwin.emulator.switches import Switch
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.drivers import driver_profile, fitted_module
from steptwin.host.twin.standing import standing_steps, steps_at
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.frame import FIRST_NODE_ID


def board_config(robot: Robot, joints: Sequence[float], driver_profile_name: str | None = None) -> BoardConfig:
    """Return the board that drives all axes of a robot.

    Args:
        robot: the machine.
        joints: positions at which it stands, mm and degrees.
        driver_profile_name: drivers other than the robot file's; the file's driver settings do not apply to them.

    Raises:
        InputError: the drivers do not exist, or cannot be set as the robot needs them.
    """
    (config,) = board_configs(robot, joints, [len(robot.joints)], driver_profile_name)
    return config


def board_configs(
    robot: Robot, joints: Sequence[float], axes_per_board: Sequence[int], driver_profile_name: str | None = None
) -> list[BoardConfig]:
    """Return several boards on one bus, each with its number of axes; node ids continue from board to board.

    Raises:
        InputError: as `board_config` does.
        ValueError: the boards do not have as many axes as the robot.
    """
    if sum(axes_per_board) != len(robot.joints):
        raise ValueError(f"{axes_per_board} are not the {len(robot.joints)} axes of the robot")
    start_steps = standing_steps(robot, joints)
    profile = driver_profile(robot.board, driver_profile_name)
    modules = tuple(fitted_module(robot.board, profile, joint.transmission.microsteps) for joint in robot.joints)
    configs: list[BoardConfig] = []
    for axes in axes_per_board:
        first = sum(config.axis_count for config in configs)
        configs.append(
            BoardConfig(
                axis_count=axes,
                osc_pf=(profile.osc_pf,) * axes,
                first_node_id=FIRST_NODE_ID + first,
                switches=tuple(_switches(robot.joints[first : first + axes])),
                start_steps=tuple(start_steps[first : first + axes]),
                modules=modules[first : first + axes],
            )
        )
    return configs


def _switches(joints: Sequence[Joint]) -> Iterator[Switch]:
    """Yield the switches of a board's joints; a limit switch is closed from its position to the end of travel."""
    for axis, joint in enumerate(joints):
        places, transmission = joint.switches, joint.transmission
        if places.negative_limit is not None:
            yield Switch(axis, DigitalInput.NEGATIVE_LIMIT, to_steps=steps_at(transmission, places.negative_limit))
        if places.positive_limit is not None:
            yield Switch(axis, DigitalInput.POSITIVE_LIMIT, from_steps=steps_at(transmission, places.positive_limit))
        ends = places.home_from, places.home_to
        first, last = (None if end is None else steps_at(transmission, end) for end in ends)
        if first is not None or last is not None:
            yield Switch(axis, DigitalInput.HOME, first, last)
