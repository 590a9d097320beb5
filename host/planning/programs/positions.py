"""Positions in a program: of joints or of the tool, inline or named.

Entries are inserted and deleted line by line, which keeps comments, order and layout of the others. The new text is
read before it is written: an entry that is not on one line of its own is refused.
"""

import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Annotated, Any, Final

from steptwin.host.common.bad_input import prefixed, shortened, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import NAME_CHARS_MAX, PROGRAM_BYTES_MAX
from steptwin.host.common.file_models import FileReading, FileTable, read_table, read_toml, table_schema
from steptwin.host.common.file_values import Choice, ReadBy
from steptwin.host.common.findings import Part, UnreadError
from steptwin.host.common.own_files import read_text
from steptwin.host.common.tables import Table, number_at
from steptwin.host.common.whole_file import whole_file
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.poses import ORIENTATIONS, STEP_NAMES, Orientation
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class JointPosition:
    """Positions of some joints, by name, in mm and degrees; the others do not move."""

    joints: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class ToolPosition:
    """A pose of the tool; missing coordinates stay as they are.

    Attributes:
        coordinates: x, y and z in mm and phi in degrees, by name; of a relative move also rx, ry and rz in degrees.
        branch: branch of the inverse kinematics; None for the present one.
        orientation: orientation of a tool that turns in space; None if it stays.
    """

    coordinates: Mapping[str, float]
    branch: str | None = None
    orientation: Orientation | None = None

    @property
    def words(self) -> str:
        """The numbers as text."""
        numbers = [f"{name} {value:g}" for name, value in self.coordinates.items()]
        return ", ".join([*numbers, str(self.orientation)] if self.orientation else numbers)


Position = JointPosition | ToolPosition


@dataclass(frozen=True, slots=True)
class Beside(FileTable):
    """A position beside a named one, or beside the present cell of a pallet.

    Attributes:
        at: name of the position.
        cell: name of the pallet, in place of `at`.
        offset: distances to it in mm, and turn by phi in degrees; along a cell's frame, or the station's axes.
    """

    at: str = ""
    cell: str = ""
    offset: Mapping[Annotated[str, Choice("", ("x", "y", "z", "phi"))], float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.at and self.cell:
            raise InputError("at: beside cell; a position is beside one of them")


Target = Position | Beside | str
"""A position, an offset from one, or the name of one."""


def read_target(value: object, reading: FileReading) -> Target:
    """Return a position from its name, or from a table of joints or of the tool's coordinates."""
    if isinstance(value, str):
        return value
    table = Table(value, "name or table")
    if "cell" not in table and "at" not in table:
        return read_position(table)
    beside: Beside = read_table(Beside, value, reading)
    if isinstance(beside, Part):
        raise UnreadError
    return beside


def _target_schema() -> dict[str, Any]:
    return {"oneOf": [{"type": "string"}, position_schema(), table_schema(Beside)]}


def position_schema(**others: Any) -> dict[str, Any]:
    """Return the JSON schema of a position, with other keys beside those of joints and the tool."""
    turn = {"type": "array", "items": {"type": "number"}, "description": "orientation of a tool that turns in space"}
    branch = {"type": "string", "description": "branch of the inverse kinematics"}
    keys = {"branch": branch, **dict.fromkeys(ORIENTATIONS, turn), **others}
    return {"type": "object", "properties": keys, "additionalProperties": {"type": "number"}}


AnyTarget = Annotated[Target, ReadBy(read_target, _target_schema)]
"""A target as a file has it."""


def read_position(table: Table) -> Position:
    """Return a position from a table; raise InputError for an empty one or for joints beside tool coordinates."""
    branch = table.text("branch", empty=False) if "branch" in table else None
    orientation = _read_orientation(table)
    for key in table:
        if key not in ORIENTATIONS and isinstance(table.values[key], list):
            raise unknown("orientation", key, ORIENTATIONS)
    numbers = {key: table.number(key) for key in table if key not in ("branch", *ORIENTATIONS)}
    if not numbers and orientation is None:
        raise InputError("names neither a joint nor one of the tool's coordinates x, y, z, phi nor an orientation")
    of_tool = [key for key in numbers if key in STEP_NAMES] + ([orientation.key] if orientation else [])
    if not of_tool:
        if branch is not None:
            raise InputError(f"branch: {branch!r} goes with the tool's coordinates, not with joints")
        return JointPosition(numbers)
    if joint := next((key for key in numbers if key not in STEP_NAMES), None):
        raise InputError(f"{joint}: beside {of_tool[0]}; a position is either of joints or of the tool")
    return ToolPosition(numbers, branch, orientation)


def _read_orientation(table: Table) -> Orientation | None:
    """Return the orientation of a table, None without one; raise InputError for two."""
    keys = [key for key in ORIENTATIONS if key in table]
    if len(keys) > 1:
        raise InputError(f"{keys[1]}: beside {keys[0]}; a pose has one orientation")
    if not keys:
        return None
    values = (number_at(f"{keys[0]}[{i}]", value) for i, value in enumerate(table.elements(keys[0])))
    return Orientation(keys[0], tuple(values))


@dataclass(frozen=True, slots=True)
class PositionsFile(FileTable):
    """Positions of a robot.

    Attributes:
        title: one line about them.
        robot: name of the robot for which they were saved.
        positions: the positions by name.
    """

    title: str = ""
    robot: str | None = None
    positions: Mapping[
        str, Annotated[Position, ReadBy(lambda value, _: read_position(Table(value, "table")), position_schema)]
    ] = field(default_factory=dict)


_NAME: Final = re.compile(rf"[A-Za-z0-9_-]{{1,{NAME_CHARS_MAX}}}")
"""A name without quotes, as a bare key of TOML."""
_HEADER: Final = re.compile(r"\s*\[\s*positions\s*\]\s*(#.*)?")


def default_file(robot: Robot) -> str:
    """Return the name of the file in the working directory that holds a robot's positions."""
    return f"{robot.name}-positions.toml"


def read_positions(path: str, robot: Robot) -> dict[str, Position]:
    """Read the positions in a file, by name; raise InputError, with the file, if it is invalid or another robot's."""
    with prefixed(f"{path}: "):
        return _parse(read_text(path, PROGRAM_BYTES_MAX), robot)


def find_position(positions: Mapping[str, Position], name: str, path: str) -> Position:
    """Return a position by name; raise InputError, with the nearest names, if it does not exist."""
    if name not in positions:
        with prefixed(f"{path}: "):
            raise unknown("position", name, positions)
    return positions[name]


def check_saving(path: str, robot: Robot, name: str, *, replace: bool) -> None:
    """Raise InputError if a position may not be saved under a name: a new one, or with `replace` any."""
    if not _NAME.fullmatch(name):
        raise InputError(
            f"{shortened(name)!r} is not a position's name: up to {NAME_CHARS_MAX} letters, digits, - and _"
        )
    positions = read_positions(path, robot) if Path(path).exists() else {}
    if name in positions and not replace:
        raise InputError(f"{path}: holds a position {name!r} already: --replace replaces it")


def save_position(path: str, robot: Robot, name: str, joints: list[float], comment: str, *, replace: bool) -> None:
    """Save a position of all joints under a name, with a comment of one line; create a missing file.

    The numbers have the fewest decimals with the same wire units. Raises InputError as `check_saving` and OSError.
    """
    check_saving(path, robot, name, replace=replace)
    numbers = ", ".join(
        f"{_key(joint.name)} = {_shortest(joint, position)}"
        for joint, position in zip(robot.joints, joints, strict=True)
    )
    entry = f"{name} = {{ {numbers} }}" + (f"  # {comment}" if comment else "")
    text = read_text(path, PROGRAM_BYTES_MAX) if Path(path).exists() else _new_text(robot)
    wanted = _parse(text, robot) | _parse(f"[positions]\n{entry}", robot)
    _write(path, robot, name, _with_entry(text, name, entry), wanted)


def delete_position(path: str, robot: Robot, name: str) -> None:
    """Delete a position; raises as `find_position`, and OSError."""
    positions = read_positions(path, robot)
    find_position(positions, name, path)
    lines = read_text(path, PROGRAM_BYTES_MAX).splitlines(keepends=True)
    at = _line_of(lines, name)
    wanted = {other: position for other, position in positions.items() if other != name}
    _write(path, robot, name, "".join(lines if at is None else lines[:at] + lines[at + 1 :]), wanted)


def read_any_positions(path: str) -> PositionsFile:
    """Return the content of a file of positions; raise InputError, with the file, if it is wrong."""
    with prefixed(f"{path}: "):
        return read_toml(PositionsFile, read_text(path, PROGRAM_BYTES_MAX))


def _parse(text: str, robot: Robot) -> dict[str, Position]:
    file = read_toml(PositionsFile, text)
    if file.robot not in (None, robot.name):
        raise InputError(f"robot: the positions are for {file.robot}, not for {robot.name}")
    return dict(file.positions)


def _new_text(robot: Robot) -> str:
    return (
        f"# Positions of {robot.name}: joints in mm and degrees; the tool's pose beside them is a comment.\n"
        f"# `steptwin positions` writes this file; entries by hand, of the tool as well, are welcome.\n"
        f"robot = {_quoted(robot.name)}\n\n[positions]\n"
    )


def _key(name: str) -> str:
    return name if _NAME.fullmatch(name) else _quoted(name)


def _quoted(text: str) -> str:
    """Return a printable text as a TOML string; TOML escapes as JSON does."""
    return json.dumps(text, ensure_ascii=False)


def _shortest(joint: Joint, position: float) -> str:
    """Return a position with the fewest decimals, at least one, with the same wire units of the joint."""
    units = joint.transmission.to_units(position)
    texts = (f"{position + 0.0:.{decimals}f}" for decimals in count(1))
    return next(text for text in texts if joint.transmission.to_units(float(text)) == units)


# --- editing


def _with_entry(text: str, name: str, entry: str) -> str:
    """Return the text with an entry in place of one with its name, or at the end of [positions]."""
    lines = text.splitlines(keepends=True)
    at = _line_of(lines, name)
    if at is not None:
        lines[at] = f"{entry}\n"
        return "".join(lines)
    begin, end = _section(lines)
    if begin == end:
        return f"{text.rstrip()}\n\n[positions]\n{entry}\n"
    while not lines[end - 1].strip():
        end -= 1
    before = "".join(lines[:end])
    return before + ("" if before.endswith("\n") else "\n") + f"{entry}\n" + "".join(lines[end:])


def _section(lines: list[str]) -> tuple[int, int]:
    """Return the range of lines of [positions], with its header; an empty range if there is none."""
    begin = next((i for i, line in enumerate(lines) if _HEADER.fullmatch(line.rstrip("\r\n"))), len(lines))
    following = (i for i, line in enumerate(lines) if i > begin and line.lstrip().startswith("["))
    return begin, next(following, len(lines))


def _line_of(lines: list[str], name: str) -> int | None:
    """Return the line of [positions] with a whole entry of this name; None if there is none."""
    begin, end = _section(lines)
    return next((i for i in range(begin + 1, end) if _keys_of(lines[i]) == [name]), None)


def _keys_of(line: str) -> list[str]:
    try:
        return list(tomllib.loads(line))
    except ValueError:  # a part of an entry
        return []


def _write(path: str, robot: Robot, name: str, text: str, wanted: Mapping[str, Position]) -> None:
    """Write a new text whole, if it has the wanted positions."""
    with prefixed(f"{path}: "):
        try:
            right = _parse(text, robot) == wanted
        except InputError:
            right = False
        if not right:
            raise InputError(f"{name}: does not stand in one line of its own under [positions]: edit it by hand")
    with whole_file(Path(path)) as file:
        file.write(text.encode("utf-8"))
