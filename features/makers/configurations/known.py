"""The controllers whose configurations are read, and how a file's text shows which it is of."""

from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

from steptwin.features.makers.configurations.grbl import is_grbl, read_grbl
from steptwin.features.makers.configurations.klipper import is_klipper, read_klipper
from steptwin.features.makers.configurations.linuxcnc import is_linuxcnc, read_linuxcnc
from steptwin.features.makers.configurations.machine import Configuration
from steptwin.features.makers.configurations.marlin import is_marlin, read_marlin
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import PROGRAM_BYTES_MAX
from steptwin.host.common.own_files import read_old_text


class Controller(NamedTuple):
    """A controller's configurations: the usual file, whether a text is one, and what reads it."""

    file: str
    shows: Callable[[str], bool]
    read: Callable[[Path], Configuration]


CONTROLLERS: Final = {
    "klipper": Controller("printer.cfg", is_klipper, read_klipper),
    "grbl": Controller("what $$ lists", is_grbl, read_grbl),
    "marlin": Controller("Configuration.h, or what M503 lists", is_marlin, read_marlin),
    "linuxcnc": Controller("machine.ini", is_linuxcnc, read_linuxcnc),
}


def read_configuration(path: Path, controller: str | None = None) -> Configuration:
    """Return the machine of a configuration, of a controller by name or by what the text shows.

    Raises:
        InputError: the file cannot be read, shows no controller, or its reader refuses it.
    """
    if controller is None:
        text = read_old_text(path, PROGRAM_BYTES_MAX)
        controller = next((name for name, each in CONTROLLERS.items() if each.shows(text)), None)
    if controller is None:
        files = "; ".join(f"{name}: {each.file}" for name, each in CONTROLLERS.items())
        raise InputError(f"is no configuration that is known ({files})")
    return CONTROLLERS[controller].read(path)
