"""Positions in a program: of joints or of the tool, written down where they are needed or under a name."""

from collections.abc import Mapping
from dataclasses import dataclass

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Table
from steptwin.host.planning.paths import COORDINATES


@dataclass(frozen=True, slots=True)
class JointPosition:
    """Positions of some joints, by name, in mm and degrees; the others stay where they are."""

    joints: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class ToolPosition:
    """A pose of the tool, of which some coordinates may be left out: these stay as they are.

    Attributes:
        coordinates: x, y and z in mm and phi in degrees, by name.
        branch: branch of the inverse kinematics; None for the one on which the arm is.
    """

    coordinates: Mapping[str, float]
    branch: str | None = None


Position = JointPosition | ToolPosition
Target = Position | str
"""A position, or the name of one."""


def read_target(table: Table, key: str) -> Target:
    """Return the position under a key: its name, or a table of joints or of the tool's coordinates."""
    if isinstance(table.values.get(key), str):
        return table.text(key, empty=False)
    if key not in table:
        raise InputError(f"{key}: is missing")
    with prefixed(f"{key}: "):
        return read_position(Table(table.values[key], "name or table"))


def read_position(table: Table) -> Position:
    """Return a position from a table; raise InputError for an empty one or for joints beside tool coordinates."""
    branch = table.text("branch", empty=False) if "branch" in table else None
    numbers = {key: table.number(key) for key in table if key != "branch"}
    if not numbers:
        raise InputError(f"names neither a joint nor one of the tool's coordinates {', '.join(COORDINATES)}")
    of_tool = [key for key in numbers if key in COORDINATES]
    if not of_tool:
        if branch is not None:
            raise InputError(f"branch: {branch!r} goes with the tool's coordinates, not with joints")
        return JointPosition(numbers)
    if len(of_tool) < len(numbers):
        joint = next(key for key in numbers if key not in COORDINATES)
        raise InputError(f"{joint}: beside {of_tool[0]}; a position is either of joints or of the tool")
    return ToolPosition(numbers, branch)
