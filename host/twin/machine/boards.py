"""Distribute a robot's axes over emulated boards, configure and create these, and calculate motor positions.

Node ids continue from board to board, so a program need not know the boards' borders. A commissioned board has the
robot's settings in its flash: a program that configures nothing finds axes with the robot's steps. `steptwin run`
begins with a new board instead, with factory defaults, and writes every setting.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, Final

import numpy as np

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.board.board_firmware import BoardProgram
from steptwin.emulator.board.drifting_board import make_board
from steptwin.emulator.board.local_clock import CRYSTAL_PPM_MAX
from steptwin.emulator.world.switches import WEIGHT_ONE, Switch, Travel
from steptwin.host.common.errors import InputError
from steptwin.host.operate.setting_up import axis_settings
from steptwin.host.robots.joint import Joint, Transmission
from steptwin.host.robots.robot import AXES_MAX, Robot
from steptwin.host.twin.machine.drivers import driver_profile, fitted_module, switched_microsteps
from steptwin.host.twin.machine.machine_options import AS_FILED, MachineOptions, object_view
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.dictionary import FlashPage
from steptwin.protocol.frame import FIRST_NODE_ID
from steptwin.protocol.od import UNITS_PER_FULL_STEP
from steptwin.protocol.storage import stored_name


def check_axes_per_board(counts: Sequence[int], axes: int) -> None:
    """Raise InputError unless each board can drive its number of axes and the total is the robot's."""
    given, nearest = _listed(counts), _listed(_spread(counts, axes))
    for count in counts:
        if not 1 <= count <= AXES_MAX:
            limits = f"a board drives 1 to {AXES_MAX} axes, not {count}"
            raise InputError(f"axes_per_board={given}: {limits}; try {nearest}")
    if sum(counts) != axes:
        raise InputError(f"axes_per_board={given}: {sum(counts)} axes in all, but the robot has {axes}; try {nearest}")


def _spread(counts: Sequence[int], axes: int) -> list[int]:
    """Return the nearest valid numbers: each limited to a board's capacity, their sum the robot's axes."""
    nearest: list[int] = []
    for count in [*counts, *[AXES_MAX] * axes]:
        left = axes - sum(nearest)
        if left:
            nearest.append(min(max(count, 1), AXES_MAX, left))
    return nearest


def _listed(counts: Sequence[int]) -> str:
    return ",".join(map(str, counts))


def check_crystals(crystals_ppm: Sequence[int], boards: int) -> None:
    """Raise InputError unless there is a crystal in range for each board.

    Args:
        crystals_ppm: deviation of each board's crystal, in parts per million; empty: all are exact.
        boards: number of boards.
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


def crystals_document(crystals_ppm: Sequence[int]) -> dict[str, Any]:
    """Return a report's entry about crystals that are off; empty if all are exact."""
    return {"crystal_ppm": list(crystals_ppm)} if any(crystals_ppm) else {}


def steps_at_joints(robot: Robot, joints: Sequence[float]) -> list[int]:
    """Return the step of each motor from the axis' zero, with joints at `joints` in mm and degrees."""
    units = robot.to_units(np.array(joints, dtype=float)).tolist()
    return [_steps(joint.transmission, int(each)) for joint, each in zip(robot.axes, units, strict=True)]


def steps_at(transmission: Transmission, position: float) -> int:
    """Return the step at an axis position, rounded to a wire unit first and then to a step, as the firmware's preset.

    Direct rounding could give one step less than the firmware just below half a step.
    """
    return _steps(transmission, transmission.to_units(position))


def _steps(transmission: Transmission, units: int) -> int:
    return (units * transmission.microsteps + UNITS_PER_FULL_STEP // 2) // UNITS_PER_FULL_STEP


# --- hardware of boards


def board_configs(robot: Robot, options: MachineOptions = AS_FILED) -> list[BoardConfig]:
    """Return the configurations of the boards for a robot's axes, on one bus; node ids continue from board to board.

    Raises:
        InputError: the drivers do not exist or lack a setting of the robot, the boards' axes do not match the robot's,
            or the options have an impossible joint or crystal.
    """
    axes_per_board = options.boards_of(robot)
    stands_at = zip(robot.axes, steps_at_joints(robot, options.joints(robot)), strict=True)
    profile = driver_profile(robot.board, options.driver_profile)
    view = object_view(robot, options)
    substeps = profile.chip.substeps
    start_substeps = [steps * substeps // joint.transmission.microsteps for joint, steps in stands_at]
    microsteps = switched_microsteps(robot, profile, options.dip_microsteps or {})
    modules = tuple(
        fitted_module(robot.board_at(joint), profile, each) for joint, each in zip(robot.axes, microsteps, strict=True)
    )
    configs: list[BoardConfig] = []
    for axes, crystal_ppm in zip(axes_per_board, options.crystals_ppm or [0] * len(axes_per_board), strict=True):
        first = sum(config.axis_count for config in configs)
        configs.append(
            BoardConfig(
                modules=modules[first : first + axes],
                first_node_id=FIRST_NODE_ID + first,
                switches=tuple(_switches(robot, first, first + axes, substeps)),
                view=view,
                travels=tuple(_travel(robot, axis, first, first + axes) for axis in range(first, first + axes)),
                start_substeps=tuple(start_substeps[first : first + axes]),
                crystal_ppm=crystal_ppm,
            )
        )
    return configs


def _switches(robot: Robot, first: int, end: int, substeps: int) -> Iterator[Switch]:
    """Yield the switches of a board's joints; a limit switch is closed from its position to the end of travel."""
    for axis, joint in enumerate(robot.axes[first:end]):
        place, switches = partial(_place, robot, first + axis, substeps), joint.switches
        if switches.negative_limit is not None:
            yield Switch(axis, DigitalInput.NEGATIVE_LIMIT, to_substeps=place(switches.negative_limit))
        if switches.positive_limit is not None:
            yield Switch(axis, DigitalInput.POSITIVE_LIMIT, from_substeps=place(switches.positive_limit))
        ends = switches.home_from, switches.home_to
        lower, upper = (None if position is None else place(position) for position in ends)
        if lower is not None or upper is not None:
            yield Switch(axis, DigitalInput.HOME, lower, upper)


def _place(robot: Robot, axis: int, substeps: int, position: float) -> int:
    """Return a joint position in an axis' substeps, rounded to a step of the robot's file, as homing expects.

    Positions of coupled joints are scaled to move their own axis one to one.
    """
    transmission, own = robot.axes[axis].transmission, robot.coupling.travel_of(axis)[axis]
    return steps_at(transmission, position / own) * substeps // transmission.microsteps


def _travel(robot: Robot, axis: int, first: int, end: int) -> Travel:
    """Return the travel with an axis' switches; raise InputError if another board has an axis or motor of it."""
    elements, joint = robot.coupling.travel_of(axis), robot.coupling.joint_of(axis)
    per_unit = robot.wire_units_per_unit.tolist()
    for other in {*elements, *robot.coupling.axes_of(joint)}:
        if not first <= other < end:
            moved, apart = robot.axes[axis].name, robot.axes[other].name
            raise InputError(f"{moved}: is coupled to {apart}, so both axes must be on one board")
    return Travel(
        tuple(
            (other - first, round(element / elements[axis] * per_unit[axis] / per_unit[other] * WEIGHT_ONE))
            for other, element in elements.items()
        )
    )


# --- boards


_OF_THE_BOARD: Final = range(0x2000, 0x6000)
"""Indexes of the settings that a board keeps whatever objects it shows on the bus."""


def commissioned_flash(robot: Robot, joints: Sequence[Joint], *, board_only: bool = False) -> list[FlashPage]:
    """Return the flash pages of a board with the settings of these joints, or with those of its drivers alone."""
    texts = {od.ROBOT_NAME: stored_name(robot.name)}
    settings = [dict(axis_settings(joint, robot.board).objects()) for joint in joints]
    if board_only:
        settings = [{at: value for at, value in each.items() if at >> 8 in _OF_THE_BOARD} for each in settings]
    return [FlashPage(each, dict(texts)) for each in settings]


def make_boards(
    robot: Robot,
    configs: Sequence[BoardConfig],
    kernel: Kernel,
    *,
    commissioned: bool = True,
    program: Callable[[], BoardProgram] | None = None,
) -> list[Board]:
    """Create boards without power, in the order of the joints.

    Args:
        robot: the machine.
        configs: hardware of each board, from `board_configs`.
        kernel: form of the firmware's kernel.
        commissioned: True for boards with the robot's settings in flash, False for new ones.
        program: creates each board's program in place of our firmware.
    """
    if program is not None:
        return [make_board(config, kernel, program=program()) for config in configs]
    if not commissioned:
        return [make_board(config, kernel) for config in configs]
    firsts = [config.first_node_id - FIRST_NODE_ID for config in configs]
    driven = [robot.axes[first:last] for first, last in pairwise((*firsts, len(robot.axes)))]
    shown = [config.view is not None for config in configs]
    flashes = [commissioned_flash(robot, joints, board_only=each) for joints, each in zip(driven, shown, strict=True)]
    return [make_board(config, kernel, flash) for config, flash in zip(configs, flashes, strict=True)]
