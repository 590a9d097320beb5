"""Name the files of a run's folder and the version of their format; docs/run-folder.md describes them."""

from pathlib import Path
from typing import Final, NamedTuple

from steptwin.host.common.errors import InputError
from steptwin.host.common.features import giving
from steptwin.protocol.timer import COUNTS_PER_SECOND

FOLDER_VERSION: Final = 1
"""Version in report.json and edges.npz; it increases when this reader could misread newer folders."""

VERSION_KEY: Final = "folder_version"

LIVE_JOB: Final = "live"
"""Name of a live board's job in its report."""
TEST_JOB: Final = "test"
"""Job of a board in virtual time that a program has driven, such as a test."""
REPLAY_JOB: Final = "replay"
"""Job of a recorded bus that was replayed."""

REPORT: Final = "report.json"
ROBOT: Final = "robot.toml"
TRAJECTORY: Final = "trajectory.csv"
EDGES: Final = "edges.npz"
BUS_LOG: Final = "bus.log"
FILES: Final = "files"
"""Key of report.json for the digests of the other files."""
RECORDING: Final = "recording.part"
"""Subfolder for a live board's recording without an end."""


def feature_file(name: str) -> str:
    """Return the name of a feature's file."""
    return f"{name}.json"


def feature_files() -> tuple[str, ...]:
    """Return the names of the files that features may write."""
    return tuple(feature_file(feature.name) for feature, _ in giving("judge"))


class MachineStop(NamedTuple):
    """A stop of a live board's machine.

    Attributes:
        counts: the instant.
        by: cause of the stop, as text.
        in_motion: True if the machine moved.
    """

    counts: int
    by: str
    in_motion: bool

    def __str__(self) -> str:
        """Return cause and time."""
        way = "on its way" if self.in_motion else "at rest"
        return f"stopped {way} by {self.by}, {self.counts / COUNTS_PER_SECOND:.3f} s after power-up"


class StoppedError(InputError):
    """A live board's machine was stopped before the end of its plan."""


class ContradictionError(InputError):
    """The files of a folder contradict themselves or each other; no run leaves such files."""


def existing_file(folder: Path, name: str) -> Path:
    """Return the path of a folder's file; raise InputError, naming it, if the file or the folder is missing."""
    if not folder.is_dir():
        raise InputError(f"{folder}: is not a folder of a run")
    path = folder / name
    if not path.is_file():
        raise InputError(f"{path}: is missing")
    return path


def check_version(version: object) -> None:
    """Raise InputError if this version of the program cannot read the folder's version."""
    if version != FOLDER_VERSION:
        raise InputError(f"{VERSION_KEY}: is {version!r}; this steptwin reads {FOLDER_VERSION}")
