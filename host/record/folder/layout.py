"""Which files a run folder has, and the version of their format; docs/run-folder.md describes them."""

from pathlib import Path
from typing import Final

from steptwin.host.common.errors import InputError

FOLDER_VERSION: Final = 1
"""Stands in report.json and edges.npz; grows when a reader of this version could misread a folder."""

VERSION_KEY: Final = "folder_version"

REPORT: Final = "report.json"
ROBOT: Final = "robot.toml"
TRAJECTORY: Final = "trajectory.csv"
EDGES: Final = "edges.npz"
BUS_LOG: Final = "bus.log"


class ContradictionError(InputError):
    """The files of a folder contradict themselves or each other: no run leaves such a folder."""


def existing(folder: Path, name: str) -> Path:
    """A file of a folder; InputError, naming it, if it or the folder is not there."""
    if not folder.is_dir():
        raise InputError(f"{folder}: is no folder of a run")
    path = folder / name
    if not path.is_file():
        raise InputError(f"{path}: is missing")
    return path


def check_version(version: object) -> None:
    """InputError unless it is one that can be read."""
    if version != FOLDER_VERSION:
        raise InputError(f"{VERSION_KEY}: is {version!r}; this steptwin reads {FOLDER_VERSION}")
