"""An unmodified image of an STM32F103 on the emulated board: its core, its peripherals, its pins at the drivers.

It imports the feature `firmware`, whose boards run a user's firmware as well, for edges on their way to the drivers.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Final

from steptwin.host.common.errors import InputError
from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

if TYPE_CHECKING:
    from pathlib import Path

    from steptwin.emulator.board.board_firmware import BoardProgram
    from steptwin.features.stm32.options import ImageServing, Stm32Options
    from steptwin.features.stm32.part import ImagePart
    from steptwin.features.stm32.section import JointPins, Stm32
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.machine.machine_options import MachineOptions


def _section() -> "type[Stm32]":
    from steptwin.features.stm32.section import Stm32

    return Stm32


def _joint_tables() -> "Mapping[str, type[JointPins]]":
    from steptwin.features.stm32.section import SECOND_TABLE, TABLE, JointPins

    return {TABLE: JointPins, SECOND_TABLE: JointPins}


def _machine_options() -> "type[Stm32Options]":
    from steptwin.features.stm32.options import Stm32Options

    return Stm32Options


def _serve_options() -> "type[ImageServing]":
    from steptwin.features.stm32.options import ImageServing

    return ImageServing


def _read_options(options: "Stm32Options | None", robot: "Robot", folder: "Path") -> "Stm32Options | None":
    return None if options is None else options.fitted(robot, folder)


def _program(options: "Stm32Options | None") -> "Callable[[], BoardProgram] | None":
    return None if options is None else options.program()


def _part(
    _robot: "Robot",
    _joints: Sequence[float],
    _axes_per_board: Sequence[int],
    options: "Stm32Options | None",
    _waits_for: Collection[str] | None,
) -> "ImagePart | None":
    if options is None or options.image is None:
        return None
    from steptwin.features.stm32.part import ImagePart

    return ImagePart(options.uart_port)


def _check_machine(machine: "MachineOptions", options: "Stm32Options | None", _real_time: bool) -> None:
    if options is not None and options.image is not None and len(machine.axes_per_board or (0,)) > 1:
        raise InputError("boards: one STM32F103 drives all axes: leave boards out, or image")


FEATURE: Final = Feature(
    name="stm32",
    needs=("firmware",),
    section=_section,
    joint_tables=_joint_tables,
    machine_options=_machine_options,
    read_options=_read_options,
    program=_program,
    part=_part,
    serve_options=_serve_options,
    check_machine=_check_machine,
    commands=(
        CommandRow(
            "run-image",
            COMMAND_GROUPS[1],
            "Run the file that is flashed into an STM32F103, and tell what the drivers make of its pins.",
            "steptwin.features.stm32.command",
            usual=False,
        ),
    ),
)
