"""Read the points of a CSV trajectory line by line, so only the numbers are in memory."""

from array import array
from dataclasses import dataclass
from math import isfinite
from reprlib import repr as short
from typing import Final, Self, TextIO

import numpy as np

from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import COLUMNS_MAX, POINTS_MAX
from steptwin.host.common.numbers import LARGEST, check_once, fields_of, numbered_lines, numbers_of
from steptwin.host.planning.motions.sampled import NumberedPlaces
from steptwin.host.planning.trajectory_file.points import VELOCITY, Points, derived_in
from steptwin.host.robots.poses import PLACE

_ELBOW: Final = "elbow"
"""Header of the branch of the inverse kinematics in a file of poses."""


def read_csv(file: TextIO) -> Points:
    """Return the points; skip empty lines and those that begin with #. InputErrors begin with the line's number."""
    lines = numbered_lines(file)
    head = next(lines, None)
    if head is None:
        raise InputError("is empty: a header t,<joint>,... was expected")
    header = fields_of(*head)
    elbow, derived = _ElbowColumn.of(header), derived_in(header)
    kept = [i for i in range(len(header)) if i not in derived and not (elbow and i == elbow.index)]
    chosen = [header[i] for i in kept]
    with prefixed(f"line {head[0]}: "):
        _check_width(header)
        names, moving = _columns(chosen)
    numbers, line_numbers = array("d"), array("q")
    for i, line in lines:
        if len(line_numbers) == POINTS_MAX:
            raise InputError(f"line {i}: is beyond {POINTS_MAX} points, one each millisecond of an hour")
        numbers.extend(_numbers(line, header, kept, elbow, i))
        line_numbers.append(i)
    table = np.frombuffer(numbers).reshape(len(line_numbers), len(chosen))
    columns = {name: i for i, name in enumerate(chosen)}
    return Points(
        names,
        NumberedPlaces("line {}, t", line_numbers),
        table[:, 0],
        table[:, [columns[name] for name in names]],
        table[:, [columns[VELOCITY + name] for name in names]] if moving else None,
        elbow.value if elbow else None,
        unread=tuple(header[i] for i in sorted(derived)),
    )


@dataclass(slots=True)
class _ElbowColumn:
    """The column of a branch's name besides the tool's coordinates; a file has one branch, which may be given once.

    Attributes:
        index: the column's index in the header.
        value: the branch, once a line has named it.
    """

    index: int
    value: str | None = None

    @classmethod
    def of(cls, header: list[str]) -> Self | None:
        """Return the column; None without one. Beside joints, `elbow` is the name of a joint."""
        if _ELBOW in header and set(PLACE) <= set(header):  # phi may be missing
            return cls(header.index(_ELBOW))
        return None

    def read(self, field: str, line: int) -> None:
        """Read a line's branch; raise InputError if it differs from the last one."""
        if field and self.value is not None and field != self.value:
            raise InputError(
                f"line {line}, elbow: {short(field)} after {short(self.value)}: a file of poses keeps its branch;"
                " a file of joints can change it"
            )
        self.value = field or self.value


def _numbers(line: str, header: list[str], kept: list[int], elbow: _ElbowColumn | None, i: int) -> list[float]:
    """Return the numbers of a line in the kept columns."""
    if elbow is None and (plain := _plain_row(line, len(header), kept)):
        return plain
    fields = fields_of(i, line)
    if len(fields) != len(header):
        return numbers_of(i, fields, header)
    if elbow:
        elbow.read(fields[elbow.index], i)
    return numbers_of(i, [fields[column] for column in kept], [header[column] for column in kept])


def _check_width(header: list[str]) -> None:
    if len(header) > COLUMNS_MAX:
        raise InputError(
            f"{len(header)} columns, more than {COLUMNS_MAX}: t, position, velocity and acceleration of 8 joints,"
            " and the tool's pose"
        )


def _columns(header: list[str]) -> tuple[list[str], bool]:
    """Return the joints, and whether there are velocities."""
    if header[0] != "t":
        raise InputError(
            f"the header begins with {short(header[0])} instead of 't'; it names the columns, separated by commas:"
            " t and the joints, such as t,th1,th2, or t,x,y,z,phi"
        )
    check_once(header)
    joints = [name for name in header[1:] if not name.startswith(VELOCITY)]
    wanted = [VELOCITY + name for name in joints]
    given = [name for name in header if name.startswith(VELOCITY)]
    for name in given:
        if name not in wanted:
            raise unknown("column", name, wanted)
    if given and len(given) < len(wanted):
        missing = next(name for name in wanted if name not in given)
        raise InputError(f"column {missing!r} is missing: velocities are given for all joints or for none")
    return joints, bool(given)


def _plain_row(line: str, columns: int, kept: list[int]) -> list[float] | None:
    """Return a row of plain numbers, in a quarter of the time; None for a row that needs `numbers_of`."""
    fields = line.split(",")
    if len(fields) != columns or "_" in line or not line.isascii() or '"' in line:
        return None
    if len(kept) < columns:
        fields = [fields[column] for column in kept]
    try:
        values = [*map(float, fields)]
    except ValueError:  # also of a quoted field
        return None
    return values if isfinite(sum(values)) and max(map(abs, values)) <= LARGEST else None
