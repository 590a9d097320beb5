"""Robots: one TOML file for each robot that StepTwin brings; a user's own file has the same form."""

from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Final

from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import ROBOT_BYTES_MAX
from steptwin.host.common.own_files import is_file, read_text
from steptwin.host.robots.reader import parse_robot, read_robot
from steptwin.host.robots.robot import Robot

__all__ = ["MACHINES", "SUFFIX", "load_robot", "load_robot_file", "parse_robot", "read_robot", "robot_names"]

SUFFIX: Final = ".toml"
"""End of the name of a robot's file."""

MACHINES: Final = ("ar4-mk3",)
"""The robots of machines that people build, which no paper describes."""


def robot_names() -> tuple[str, ...]:
    """Return the names of the robots that StepTwin brings: those of papers, sorted, then the machines."""
    entries = (entry.name for entry in files(__name__).iterdir())
    names = {name.removesuffix(SUFFIX) for name in entries if name.endswith(SUFFIX)}
    return (*sorted(names.difference(MACHINES)), *MACHINES)


def load_robot(name: str) -> Robot:
    """Return a robot by its name, or by the path of a .toml file; raise InputError with the key of a wrong value."""
    if name.endswith(SUFFIX):
        return load_robot_file(name)
    if name not in robot_names():
        if is_file(Path(f"{name}{SUFFIX}")):
            raise InputError(f"robot {name!r} is unknown: did you mean {name}{SUFFIX}, the file here?")
        raise unknown("robot", name, robot_names())
    return _brought(name)


@cache
def _brought(name: str) -> Robot:
    """Return a robot that StepTwin brings; it is read once."""
    file = files(__name__) / f"{name}{SUFFIX}"
    return parse_robot(file.read_text(encoding="utf-8"), file.name)


def load_robot_file(path: str) -> Robot:
    """Return the robot in a file of any name; raise InputError as `load_robot` does."""
    with prefixed(f"{path}: "):
        text = read_text(path, ROBOT_BYTES_MAX)
    return parse_robot(text, path)
