"""Make the emulated boards of a robot; tell which axis each joint has there, where its motor is, and its microsteps.

So a program that configures nothing finds an axis that makes the robot's steps. `steptwin run` begins with a new board
instead, which has its factory defaults, and writes every setting.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.board.drifting_board import make_board
from steptwin.emulator.board.local_clock import CRYSTAL_PPM_MAX
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.operate.setting_up import axis_settings
from steptwin.host.robots.board_settings import Microsteps
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.transmission import Transmission
from steptwin.protocol import od
from steptwin.protocol.dictionary import FlashPage
from steptwin.protocol.frame import FIRST_NODE_ID
from steptwin.protocol.objects import UNITS_PER_FULL_STEP
from steptwin.protocol.robot_name import stored_name


def read_crystals(text: str) -> list[int]:
    """Return the parts per million of each board from a text such as `100,-100`; raise InputError for another form."""
    try:
        return [int(word) for word in text.split(",")]
    except ValueError:
        raise InputError(f"crystal_ppm={text}: is not a whole number of ppm for each board, as in 100,-100") from None


def check_crystals(crystals_ppm: Sequence[int], boards: int, *, motors: bool) -> None:
    """Raise InputError unless the crystals are in range, one for each board, and no motors turn with those that drift.

    Args:
        crystals_ppm: how fast each board's crystal is, in parts per million; empty: all are exact.
        boards: number of boards.
        motors: True if motors turn with the boards.
    """
    if not any(crystals_ppm) and len(crystals_ppm) in (0, boards):
        return
    given = ",".join(map(str, crystals_ppm))
    for ppm in crystals_ppm:
        if abs(ppm) > CRYSTAL_PPM_MAX:
            nearest = CRYSTAL_PPM_MAX if ppm > 0 else -CRYSTAL_PPM_MAX
            limits = f"{ppm} ppm is not from {-CRYSTAL_PPM_MAX} to {CRYSTAL_PPM_MAX}"
            raise InputError(f"crystal_ppm={given}: {limits}; the nearest is {nearest}")
    if len(crystals_ppm) != boards:
        raise InputError(f"crystal_ppm={given}: has {len(crystals_ppm)} numbers, but the boards are {boards}")
    if motors:
        raise InputError(f"crystal_ppm={given}: motors that turn with the board need its exact crystal, 0")


def crystals_document(crystals_ppm: Sequence[int]) -> dict[str, Any]:
    """Return the entry of a report that tells crystals which are off; none where all are exact."""
    return {"crystal_ppm": list(crystals_ppm)} if any(crystals_ppm) else {}


Standing = Sequence[float] | Mapping[str, float]
"""Positions of all joints, or of some by name, in mm and degrees."""


def standing_joints(robot: Robot, stand_at: Standing | None) -> list[float]:
    """Return the positions of all joints, in mm and degrees; joints without a position stand at the robot's home.

    Raises:
        InputError: the number of positions is wrong, or the robot has no joint of that name.
    """
    at = dict(zip(robot.joint_names, robot.home, strict=True))
    if stand_at is None:
        return list(at.values())
    if not isinstance(stand_at, Mapping):
        if len(stand_at) != len(at):
            raise InputError(f"stand_at: {len(stand_at)} values for the {len(at)} joints {' '.join(at)}")
        return list(stand_at)
    for name, position in stand_at.items():
        if name not in at:
            raise unknown("stand_at: joint", name, at)
        at[name] = position
    return list(at.values())


def standing_steps(robot: Robot, joints: Sequence[float]) -> list[int]:
    """Return the step at which each motor stands, counted from the axis' zero; `joints` in mm and degrees."""
    units = robot.to_units(np.array(joints, dtype=float)).tolist()
    return [_steps(joint.transmission, int(each)) for joint, each in zip(robot.joints, units, strict=True)]


def steps_at(transmission: Transmission, position: float) -> int:
    """Return the step at an axis position, rounded to a wire unit first and then to a step, as the firmware's preset.

    Rounded at once, a position just below half a step could come out one step below the firmware's counter.
    """
    return _steps(transmission, transmission.to_units(position))


def _steps(transmission: Transmission, units: int) -> int:
    return (units * transmission.microsteps + UNITS_PER_FULL_STEP // 2) // UNITS_PER_FULL_STEP


def commissioned_flash(robot: Robot, joints: Sequence[Joint]) -> list[FlashPage]:
    """Return the flash pages of a board that drives these joints of a robot, as if its settings had been stored."""
    texts = {od.ROBOT_NAME: stored_name(robot.name)}
    return [FlashPage(dict(axis_settings(joint, robot.board).objects()), dict(texts)) for joint in joints]


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
