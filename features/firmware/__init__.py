"""A user's own firmware, compiled for this computer, on an emulated board."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from steptwin.host.common.features import Feature

if TYPE_CHECKING:
    from pathlib import Path

    from steptwin.emulator.board.board_firmware import BoardProgram
    from steptwin.features.firmware.options import FirmwareOptions
    from steptwin.host.robots.robot import Robot


def _machine_options() -> "type[FirmwareOptions]":
    from steptwin.features.firmware.options import FirmwareOptions

    return FirmwareOptions


def _read_options(options: "FirmwareOptions", _robot: "Robot", folder: "Path") -> "FirmwareOptions":
    return options.placed(folder)


def _program(options: "FirmwareOptions | None") -> "Callable[[], BoardProgram] | None":
    return None if options is None else options.program()


FEATURE: Final = Feature(
    name="firmware", machine_options=_machine_options, read_options=_read_options, program=_program
)
