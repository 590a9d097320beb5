"""Read the points of a CSV trajectory."""

import csv
from reprlib import repr as short
from typing import Final

from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import LARGEST
from steptwin.host.planning.trajectory_file.points import Points

_VELOCITY: Final = "v_"
"""Prefix of a joint's name in the header of its velocities."""


def read_csv(text: str) -> Points:
    """Return the points; skip empty lines and those that begin with #. InputErrors begin with the line's number."""
    lines = [(i, line) for i, line in enumerate(text.split("\n"), start=1) if line.strip() and line.strip()[0] != "#"]
    if not lines:
        raise InputError("is empty: a header t,<joint>,... was expected")
    header = _fields(*lines[0])
    with prefixed(f"line {lines[0][0]}: "):
        joints, moving = _columns(header)
    rows = [_row(_fields(i, line), header, i) for i, line in lines[1:]]
    columns = {name: i for i, name in enumerate(header)}
    return Points(
        joints,
        [f"line {i}, t" for i, _ in lines[1:]],
        [row[0] for row in rows],
        [[row[columns[name]] for name in joints] for row in rows],
        [[row[columns[_VELOCITY + name]] for name in joints] for row in rows] if moving else None,
    )


def _fields(i: int, line: str) -> list[str]:
    """Return the fields of one line; a quoted field that continues in the next line is an error."""
    try:
        (fields,) = csv.reader([line], strict=True)
    except csv.Error as error:
        raise InputError(f"line {i}: is not CSV: {error}") from error
    return [field.strip() for field in fields]


def _columns(header: list[str]) -> tuple[list[str], bool]:
    """Return the joints, and whether there are velocities."""
    if header[0] != "t":
        raise InputError(f"the header begins with {short(header[0])} instead of 't'")
    for name in header:
        if header.count(name) > 1:
            raise InputError(f"column {name!r} appears {header.count(name)} times")
    joints = [name for name in header[1:] if not name.startswith(_VELOCITY)]
    wanted = [_VELOCITY + name for name in joints]
    given = [name for name in header if name.startswith(_VELOCITY)]
    for name in given:
        if name not in wanted:
            raise unknown("column", name, wanted)
    if given and len(given) < len(wanted):
        missing = next(name for name in wanted if name not in given)
        raise InputError(f"column {missing!r} is missing: velocities are given for all joints or for none")
    return joints, bool(given)


def _row(row: list[str], header: list[str], line: int) -> list[float]:
    if len(row) != len(header):
        raise InputError(f"line {line}: {len(row)} fields, the header has {len(header)}")
    return [_number(field, f"line {line}, {name}") for field, name in zip(row, header, strict=True)]


def _number(field: str, place: str) -> float:
    try:
        value = float(field)
    except ValueError:
        raise InputError(f"{place}: {short(field)} is not a number") from None
    if not abs(value) <= LARGEST:
        raise InputError(f"{place}: {short(field)} is not a finite number up to {LARGEST:g}")
    return value
