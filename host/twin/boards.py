"""Make the emulated boards of a robot; tell which axis each joint has there, where its motor is, and its microsteps."""

from collections.abc import Sequence
from itertools import pairwise

from steptwin.controller.backend import Kernel
from steptwin.emulator.board import Board, BoardConfig
from steptwin.emulator.drifting_board import make_board
from steptwin.host.robots.microsteps import Microsteps
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.commissioning import commissioned_flash
from steptwin.protocol.frame import FIRST_NODE_ID


def make_boards(
    robot: Robot, configs: Sequence[BoardConfig], kernel: Kernel, *, commissioned: bool = True
) -> list[Board]:
    """Make boards without power, in the order of the joints.

    Args:
        robot: the machine.
        configs: hardware of each board, from `board_configs`.
        kernel: form of the firmware's kernel.
        commissioned: True for boards whose flash holds the robot's settings, False for new ones.
    """
    if not commissioned:
        return [make_board(config, kernel) for config in configs]
    firsts = [config.first_node_id - FIRST_NODE_ID for config in configs]
    driven = [robot.joints[first:last] for first, last in pairwise((*firsts, len(robot.joints)))]
    flashes = [commissioned_flash(robot, joints) for joints in driven]
    return [make_board(config, kernel, flash) for config, flash in zip(configs, flashes, strict=True)]


def axes_of(boards: Sequence[Board]) -> list[tuple[Board, int]]:
    """Return the board of each joint, and the number of the joint's axis on it."""
    return [(board, axis) for board in boards for axis in range(board.config.axis_count)]


def microsteps_of(robot: Robot, axes: Sequence[tuple[Board, int]]) -> list[Microsteps]:
    """Return the microsteps per full step of each axis: its driver's, its board's and its robot file's."""
    return [
        Microsteps(
            joint.name,
            board.driver_microsteps(axis),
            board.firmware.motion.config(axis).microsteps,
            joint.transmission.microsteps,
        )
        for joint, (board, axis) in zip(robot.joints, axes, strict=True)
    ]


def counted_steps(robot: Robot, start_steps: Sequence[int], axes: Sequence[tuple[Board, int]]) -> list[float]:
    """Return the position of each motor by the steps that its driver has made, from the joint's zero.

    It is in steps of the robot's file, a whole number of them unless the driver makes others.
    """
    return [
        start + board.position_sixteenths(axis) / joint.transmission.step_sixteenths
        for start, joint, (board, axis) in zip(start_steps, robot.joints, axes, strict=True)
    ]
