"""Robots: one TOML file for each robot that StepTwin brings; a user's own file has the same form.

The folder `papers` holds the robots of papers, `machines` those that people build and no paper describes.
"""

from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from operator import attrgetter
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


def _brought(folder: str) -> dict[str, Traversable]:
    """Return the robot files of one folder of this package, by the robots' names, sorted."""
    found = (entry for entry in (files(__name__) / folder).iterdir() if entry.name.endswith(SUFFIX))
    return {file.name.removesuffix(SUFFIX): file for file in sorted(found, key=attrgetter("name"))}


_PAPERS: Final = _brought("papers")
_MACHINES: Final = _brought("machines")

MACHINES: Final = tuple(_MACHINES)
"""The robots of machines that people build, which no paper describes."""


def robot_names() -> tuple[str, ...]:
    """Return the names of the robots that StepTwin brings: those of papers, sorted, then the machines."""
    return (*_PAPERS, *MACHINES)


def brought_text(name: str) -> str:
    """Return the robot file that StepTwin brings for a robot, with the tables that features add to it.

    Raises:
        InputError: there is no such robot; the message has the nearest name.
    """
    if name not in robot_names():
        raise unknown("robot", name, robot_names())
    text = {**_PAPERS, **_MACHINES}[name].read_text(encoding="utf-8")
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
