"""Describe a robot's machine to the emulator: its boards, their drivers, and its switches."""

from collections.abc import Iterator, Mapping, Sequence

from steptwin.emulator.board import BoardConfig
from steptwin.emulator.switches import Switch
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.transmission import Transmission
from steptwin.host.twin.drivers import driver_profile, fitted_module, switched_microsteps
from steptwin.host.twin.standing import standing_steps, steps_at
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.frame import FIRST_NODE_ID


def board_config(
    robot: Robot,
    joints: Sequence[float],
    driver_profile_name: str | None = None,
    dip_microsteps: Mapping[str, int] | None = None,
) -> BoardConfig:
    """Return the board that drives all axes of a robot.

    Args:
        robot: the machine.
        joints: positions at which it stands, mm and degrees.
        driver_profile_name: drivers other than the robot file's; the file's driver settings do not apply to them.
        dip_microsteps: microsteps other than the robot file's to which modules' switches are set, by joint.

    Raises:
        InputError: the drivers do not exist, or cannot be set as the robot needs them.
    """
    (config,) = board_configs(robot, joints, [len(robot.joints)], driver_profile_name, dip_microsteps)
    return config


def board_configs(
    robot: Robot,
    joints: Sequence[float],
    axes_per_board: Sequence[int],
    driver_profile_name: str | None = None,
    dip_microsteps: Mapping[str, int] | None = None,
) -> list[BoardConfig]:
    """Return several boards on one bus, each with its number of axes; node ids continue from board to board.

    Raises:
        InputError: as `board_config` does.
        ValueError: the boards do not have as many axes as the robot.
    """
    if sum(axes_per_board) != len(robot.joints):
        raise ValueError(f"{axes_per_board} are not the {len(robot.joints)} axes of the robot")
    stands_at = zip(robot.joints, standing_steps(robot, joints), strict=True)
    start_sixteenths = [steps * joint.transmission.step_sixteenths for joint, steps in stands_at]
    profile = driver_profile(robot.board, driver_profile_name)
    microsteps = switched_microsteps(robot, profile, dip_microsteps or {})
    modules = tuple(fitted_module(robot.board, profile, each) for each in microsteps)
    configs: list[BoardConfig] = []
    for axes in axes_per_board:
        first = sum(config.axis_count for config in configs)
        configs.append(
            BoardConfig(
                axis_count=axes,
                osc_pf=(profile.osc_pf,) * axes,
                first_node_id=FIRST_NODE_ID + first,
                switches=tuple(_switches(robot.joints[first : first + axes])),
                start_sixteenths=tuple(start_sixteenths[first : first + axes]),
                modules=modules[first : first + axes],
            )
        )
    return configs


def _switches(joints: Sequence[Joint]) -> Iterator[Switch]:
    """Yield the switches of a board's joints; a limit switch is closed from its position to the end of travel."""
    for axis, joint in enumerate(joints):
        places, transmission = joint.switches, joint.transmission
        if places.negative_limit is not None:
            yield Switch(axis, DigitalInput.NEGATIVE_LIMIT, to_sixteenths=_place(transmission, places.negative_limit))
        if places.positive_limit is not None:
            yield Switch(axis, DigitalInput.POSITIVE_LIMIT, from_sixteenths=_place(transmission, places.positive_limit))
        ends = places.home_from, places.home_to
        first, last = (None if end is None else _place(transmission, end) for end in ends)
        if first is not None or last is not None:
            yield Switch(axis, DigitalInput.HOME, first, last)


def _place(transmission: Transmission, position: float) -> int:
    """Return a position in sixteenths of a full step, on a step of the robot's file, as its homing expects."""
    return steps_at(transmission, position) * transmission.step_sixteenths
