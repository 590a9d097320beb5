"""The robots that come along, one TOML file each; a user's own file of the same form works the same."""

from importlib.resources import files
from pathlib import Path

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.robots.reader import parse_robot
from steptwin.host.robots.robot import Robot

__all__ = ["load_robot", "load_robot_file", "parse_robot", "robot_names"]

_SUFFIX = ".toml"


def robot_names() -> tuple[str, ...]:
    """The names of the robots that come along, sorted."""
    entries = (entry.name for entry in files(__name__).iterdir())
    return tuple(sorted(name.removesuffix(_SUFFIX) for name in entries if name.endswith(_SUFFIX)))


def load_robot(name: str) -> Robot:
    """A robot by its name, or by the path of a file that ends in .toml.

    Raises:
        InputError: no such robot or file, or one that says something wrong; the message names the key.
    """
    if name.endswith(_SUFFIX):
        return load_robot_file(name)
    if name not in robot_names():
        raise unknown("robot", name, robot_names())
    file = files(__name__) / f"{name}{_SUFFIX}"
    return parse_robot(file.read_text(encoding="utf-8"), file.name)


def load_robot_file(path: str) -> Robot:
    """A robot of one's own from a file of any name; raises InputError as `load_robot` does."""
    return parse_robot(_read(Path(path)), path)


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text") from error
    except ValueError as error:  # a NUL
        raise InputError(f"{path}: is no name of a file: {error}") from error
