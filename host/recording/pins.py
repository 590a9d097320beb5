"""pins.csv: every change of the pins that the firmware holds at a level, and of the robot's outputs among them."""

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Final, TextIO

from controller.pins import PinChange
from host.errors import InputError
from host.robot import Robot
from host.verify import OutputChange
from host.wiring import wired_outputs

_FIELDS: Final = ("counts", "joint", "pin", "level", "output")
"""When, in counts since boot; which pin of which joint's axis; the level that it takes; what the robot calls it."""


class PinLog:
    """Writes pin changes into an open file, from its beginning."""

    def __init__(self, file: TextIO, robot: Robot) -> None:
        self._writer = csv.writer(file, lineterminator="\n")
        self._joint_names = robot.joint_names
        self._outputs = wired_outputs(robot)
        self._writer.writerow(_FIELDS)

    def append(self, changes: Iterable[PinChange]) -> None:
        """A line for each."""
        self._writer.writerows(
            (
                change.counts,
                self._joint_names[change.axis],
                change.pin.value,
                change.level,
                self._outputs.get((change.axis, change.pin), ""),
            )
            for change in changes
        )


def read_outputs(path: Path) -> tuple[OutputChange, ...]:
    """The changes of the outputs that have names.

    Raises:
        InputError: there is no such file, or it is not one of these.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = csv.DictReader(file)
            if tuple(rows.fieldnames or ()) != _FIELDS:
                raise InputError(f"{path}: does not begin with {','.join(_FIELDS)}")
            return tuple(
                OutputChange(row["output"], int(row["counts"]), int(row["level"])) for row in rows if row["output"]
            )
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from error
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}: is no pins.csv: {error}") from error
