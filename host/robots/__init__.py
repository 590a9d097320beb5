"""Robots: one TOML file for each robot that StepTwin brings; a user's own file has the same form.

The folder `machines` holds robots that people build; features bring others.
"""

from functools import cache
from pathlib import Path
from typing import Final

from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import giving
from steptwin.host.common.file_limits import ROBOT_BYTES_MAX
from steptwin.host.common.own_files import is_file, read_text
from steptwin.host.robots.reader import parse_robot, read_robot
from steptwin.host.robots.robot import Robot

__all__ = [
    "MACHINES",
    "SUFFIX",
    "brought_text",
    "load_robot",
    "load_robot_file",
    "parse_robot",
    "read_robot",
    "robot_names",
]

SUFFIX: Final = ".toml"
"""End of the name of a robot's file."""


_FOLDER: Final = Path(__file__).with_name("machines")


def _brought() -> dict[str, Path]:
    """Return the robot files by the robots' names: those of features, then those of the core, sorted in each folder."""
    folders = (*(folder for _, folder in giving("robots")), _FOLDER)
    return {file.stem: file for folder in folders for file in sorted(folder.glob(f"*{SUFFIX}"))}


MACHINES: Final = tuple(sorted(file.stem for file in _FOLDER.glob(f"*{SUFFIX}")))
"""The robots of the core: machines that people build."""


def robot_names() -> tuple[str, ...]:
    """Return the names of the robots that StepTwin brings: those of features, then those of the core."""
    return tuple(_brought())


def brought_text(name: str) -> str:
    """Return the robot file that StepTwin brings for a robot, with the tables that features add to it.

    Raises:
        InputError: there is no such robot; the message has the nearest name.
    """
    brought = _brought()
    if name not in brought:
        raise unknown("robot", name, tuple(brought))
    text = brought[name].read_text(encoding="utf-8")
    return text + "".join(tables(name) for _, tables in giving("robot_tables"))


def load_robot(name: Path | str) -> Robot:
    """Return a robot by its name, or by the path of a .toml file; raise InputError with the key of a wrong value."""
    name = str(name)
    if name.endswith(SUFFIX):
        return load_robot_file(name)
    if name not in robot_names() and is_file(Path(f"{name}{SUFFIX}")):
        raise InputError(f"robot {name!r} is unknown: did you mean {name}{SUFFIX}, the file here?")
    return _load_brought(name)


@cache
def _load_brought(name: str) -> Robot:
    """Return a robot that StepTwin brings; it is read once."""
    return parse_robot(brought_text(name), f"{name}{SUFFIX}")


def load_robot_file(path: Path | str) -> Robot:
    """Return the robot in a file of any name; raise InputError as `load_robot` does."""
    with prefixed(f"{path}: "):
        text = read_text(path, ROBOT_BYTES_MAX)
    return parse_robot(text, str(path))
