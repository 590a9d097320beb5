"""Describe a robot's machine to the emulator: its boards, their drivers, and its switches."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

from steptwin.emulator.board.board import BoardConfig
from steptwin.emulator.world.switches import WEIGHT_ONE, Switch, Travel
from steptwin.host.common.errors import InputError
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.boards import standing_steps, steps_at
from steptwin.host.twin.machine.drivers import driver_profile, fitted_module, switched_microsteps
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.frame import FIRST_NODE_ID


def board_configs(
    robot: Robot,
    joints: Sequence[float],
    axes_per_board: Sequence[int],
    driver_profile_name: str | None = None,
    dip_microsteps: Mapping[str, int] | None = None,
    crystals_ppm: Sequence[int] = (),
) -> list[BoardConfig]:
    """Return the boards that drive the axes of a robot, on one bus; node ids continue from board to board.

    Args:
        robot: the machine.
        joints: positions where it stands, mm and degrees.
        axes_per_board: number of axes on each board, in the order of the joints.
        driver_profile_name: drivers other than the robot file's; the file's driver settings do not apply to them.
        dip_microsteps: microsteps other than the robot file's to which modules' switches are set, by joint.
        crystals_ppm: how fast each board's crystal is, in parts per million; empty: all are exact.

    Raises:
        InputError: the drivers do not exist, or cannot be set as the robot needs them.
        ValueError: the boards do not have as many axes as the robot.
    """
    if sum(axes_per_board) != len(robot.joints):
        raise ValueError(f"{axes_per_board} are not the {len(robot.joints)} axes of the robot")
    stands_at = zip(robot.joints, standing_steps(robot, joints), strict=True)
    profile = driver_profile(robot.board, driver_profile_name)
    substeps = profile.chip.substeps
    start_substeps = [steps * substeps // joint.transmission.microsteps for joint, steps in stands_at]
    microsteps = switched_microsteps(robot, profile, dip_microsteps or {})
    modules = tuple(fitted_module(robot.board, profile, each) for each in microsteps)
    configs: list[BoardConfig] = []
    for axes, crystal_ppm in zip(axes_per_board, crystals_ppm or [0] * len(axes_per_board), strict=True):
        first = sum(config.axis_count for config in configs)
        configs.append(
            BoardConfig(
                modules=modules[first : first + axes],
                first_node_id=FIRST_NODE_ID + first,
                switches=tuple(_switches(robot, first, first + axes, substeps)),
                travels=_travels(robot, first, first + axes),
                start_substeps=tuple(start_substeps[first : first + axes]),
                crystal_ppm=crystal_ppm,
            )
        )
    return configs


def _switches(robot: Robot, first: int, end: int, substeps: int) -> Iterator[Switch]:
    """Yield the switches of a board's joints; a limit switch is closed from its position to the end of travel."""
    for axis, joint in enumerate(robot.joints[first:end]):
        place, switches = partial(_place, robot, first + axis, substeps), joint.switches
        if switches.negative_limit is not None:
            yield Switch(axis, DigitalInput.NEGATIVE_LIMIT, to_substeps=place(switches.negative_limit))
        if switches.positive_limit is not None:
            yield Switch(axis, DigitalInput.POSITIVE_LIMIT, from_substeps=place(switches.positive_limit))
        ends = switches.home_from, switches.home_to
        lower, upper = (None if position is None else place(position) for position in ends)
        if lower is not None or upper is not None:
            yield Switch(axis, DigitalInput.HOME, lower, upper)


def _place(robot: Robot, joint: int, substeps: int, position: float) -> int:
    """Return a joint position in its axis' substeps, on a step of the robot's file, as homing expects.

    A coupled joint's are scaled so that its own axis moves them one to one.
    """
    transmission, own = robot.joints[joint].transmission, robot.coupling.axes_of(joint)[joint]
    return steps_at(transmission, position / own) * substeps // transmission.microsteps


def _travels(robot: Robot, first: int, end: int) -> tuple[Travel, ...]:
    """Return the way along which the switches of each of a board's joints stand.

    Raises:
        InputError: an axis that moves a joint with switches is on another board.
    """
    return tuple(_travel(robot, joint, first, end) for joint in range(first, end))


def _travel(robot: Robot, joint: int, first: int, end: int) -> Travel:
    elements = robot.coupling.axes_of(joint)
    per_unit = robot.wire_units_per_unit.tolist()
    weights = []
    for axis, element in elements.items():
        if not first <= axis < end:
            moved, other = robot.joints[joint].name, robot.joints[axis].name
            raise InputError(f"{moved}: is coupled to {other}, so both axes must be on one board")
        weight = element / elements[joint] * per_unit[joint] / per_unit[axis]
        weights.append((axis - first, round(weight * WEIGHT_ONE)))
    return Travel(tuple(weights))
