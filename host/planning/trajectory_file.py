"""Trajectories from files: CSV, or JSON in the shape of ROS trajectory_msgs/JointTrajectory.

Positions are in mm and degrees, times in seconds from 0. Without velocities the motion is a C2 spline through the
points, from rest to rest, which stands where points repeat; with them it is a cubic from point to point, and the times
are whole milliseconds.

CSV has a header `t,<joint>,...` with the joints in any order, and for velocities a column `v_<joint>` for each. JSON
has `joint_names`, and `points` with `positions`, `time_from_start` and perhaps `velocities`.
"""

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from reprlib import repr as short
from typing import Final

import numpy as np

from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motions.sampled import Sampled, check_times
from steptwin.host.planning.motions.sequence import Sequence as MotionSequence
from steptwin.host.planning.motions.through_points import through_points
from steptwin.host.robots.robot import Robot

SUFFIXES: Final = (".csv", ".json")

LONGEST_S: Final = 3600.0
"""A longer motion is taken for one whose times are not in seconds; it would not fit into memory either."""

_LARGEST: Final = 1e9
_VELOCITY: Final = "v_"
_POINT_KEYS: Final = ("positions", "velocities", "accelerations", "effort", "time_from_start")
_ROS_TIMES: Final = (("sec", "nanosec"), ("secs", "nsecs"))
"""The two parts of a time in ROS 2 and in ROS 1."""


@dataclass(frozen=True, slots=True)
class _Points:
    """What a file says: names for the columns, a row of numbers for each point, and where its time stands."""

    joint_names: tuple[str, ...]
    places: list[str]
    times_s: list[float]
    positions: list[list[float]]
    velocities: list[list[float]] | None


def is_trajectory_file(name: str) -> bool:
    """Whether a job's name is a file's."""
    return name.lower().endswith(SUFFIXES)


def read_trajectory(path: str, robot: Robot) -> Sampled | MotionSequence:
    """The trajectory in a file that ends in .csv or .json.

    Raises:
        InputError: the file cannot be read, or says something wrong; the message begins with the file and says where.
    """
    with prefixed(f"{path}: "):
        text = _read(Path(path))
        points = _from_json(text) if path.lower().endswith(".json") else _from_csv(text)
        return _motion(points, robot)


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(error.strerror or "cannot be read") from error
    except UnicodeDecodeError as error:
        raise InputError("is not UTF-8 text") from error
    except ValueError as error:  # a NUL
        raise InputError(f"is no name of a file: {error}") from error


def _motion(points: _Points, robot: Robot) -> Sampled | MotionSequence:
    order = _order(points.joint_names, robot)
    shape = len(points.times_s), len(order)  # what an empty list lacks
    times_s = np.array(points.times_s)
    positions = np.array(points.positions).reshape(shape)[:, order]
    for place, t_s in zip(points.places, points.times_s, strict=True):
        if t_s > LONGEST_S:
            raise InputError(f"{place}: {t_s:.9g} s is more than {LONGEST_S:g} s")
    check_times(times_s, points.places, all_whole_ms=points.velocities is not None)
    if points.velocities is None:
        return through_points(robot.joint_names, times_s, positions, points.places)
    velocities = np.array(points.velocities).reshape(shape)[:, order]
    return Sampled.hermite(robot.joint_names, times_s, positions, velocities)


def _order(names: tuple[str, ...], robot: Robot) -> list[int]:
    """The column of each of the robot's joints."""
    for name in names:
        if name not in robot.joint_names:
            raise unknown("joint", name, robot.joint_names)
        if names.count(name) > 1:
            raise InputError(f"joint {name!r} is there {names.count(name)} times")
    for name in robot.joint_names:
        if name not in names:
            raise InputError(f"joint {name!r} is missing: {robot.name} has {' '.join(robot.joint_names)}")
    return [names.index(name) for name in robot.joint_names]


# --- CSV


def _from_csv(text: str) -> _Points:
    lines = [(i, line) for i, line in enumerate(text.split("\n"), start=1) if line.strip() and line.strip()[0] != "#"]
    if not lines:
        raise InputError("is empty: a header t,<joint>,... was expected")
    header = _csv_fields(*lines[0])
    with prefixed(f"line {lines[0][0]}: "):
        joints, moving = _csv_columns(header)
    numbers = [_csv_row(_csv_fields(i, line), header, i) for i, line in lines[1:]]
    columns = {name: i for i, name in enumerate(header)}
    return _Points(
        tuple(joints),
        [f"line {i}, t" for i, _ in lines[1:]],
        [row[0] for row in numbers],
        [[row[columns[name]] for name in joints] for row in numbers],
        [[row[columns[_VELOCITY + name]] for name in joints] for row in numbers] if moving else None,
    )


def _csv_fields(i: int, line: str) -> list[str]:
    """The fields of a line on its own: a quoted field that goes on in the next one is an error."""
    try:
        (fields,) = csv.reader([line], strict=True)
    except csv.Error as error:
        raise InputError(f"line {i}: is not CSV: {error}") from error
    return [field.strip() for field in fields]


def _csv_columns(header: list[str]) -> tuple[list[str], bool]:
    """The joints, and whether there are velocities."""
    if header[0] != "t":
        raise InputError(f"the header begins with {short(header[0])} instead of 't'")
    for name in header:
        if header.count(name) > 1:
            raise InputError(f"column {name!r} is there {header.count(name)} times")
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


def _csv_row(row: list[str], header: list[str], line: int) -> list[float]:
    if len(row) != len(header):
        raise InputError(f"line {line}: {len(row)} fields, the header has {len(header)}")
    return [_csv_number(field, f"line {line}, {name}") for field, name in zip(row, header, strict=True)]


def _csv_number(field: str, where: str) -> float:
    try:
        value = float(field)
    except ValueError:
        raise InputError(f"{where}: {short(field)} is not a number") from None
    if not abs(value) <= _LARGEST:
        raise InputError(f"{where}: {short(field)} is not a finite number up to {_LARGEST:g}")
    return value


# --- JSON


def _from_json(text: str) -> _Points:
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"is not JSON: {error}") from error
    table = _table(document, "the document", ("header", "joint_names", "points"))
    names = [_name(name) for name in _list(table, "joint_names", "the document")]
    points = [
        _table(point, f"point {i}", _POINT_KEYS)
        for i, point in enumerate(_list(table, "points", "the document"), start=1)
    ]
    for i, point in enumerate(points, start=1):
        for key in ("accelerations", "effort"):
            if point.get(key):
                raise InputError(f"point {i}, {key}: would not be obeyed; leave it out")
    moving = [bool(point.get("velocities")) for point in points]
    if any(moving) and not all(moving):
        raise InputError(f"point {moving.index(False) + 1}: has no velocities, other points have some")
    places = [f"point {i}, time_from_start" for i in range(1, len(points) + 1)]
    return _Points(
        tuple(names),
        places,
        [_seconds(point.get("time_from_start"), place) for point, place in zip(points, places, strict=True)],
        [_numbers(point, "positions", names, i) for i, point in enumerate(points, start=1)],
        [_numbers(point, "velocities", names, i) for i, point in enumerate(points, start=1)] if any(moving) else None,
    )


def _table(value: object, what: str, keys: Sequence[str]) -> Mapping[str, object]:
    if not isinstance(value, dict):
        raise InputError(f"{what}: is not a JSON object")
    for key in value:
        if key not in keys:
            raise unknown(f"{what}: key", key, keys)
    return value


def _list(table: Mapping[str, object], key: str, what: str) -> list[object]:
    value = table.get(key)
    if not isinstance(value, list):
        raise InputError(f"{what}, {key}: is missing or not a list")
    return value


def _name(value: object) -> str:
    if not isinstance(value, str):
        raise InputError(f"joint_names: {short(value)} is not a name")
    return value


def _numbers(point: Mapping[str, object], key: str, names: list[str], i: int) -> list[float]:
    values = _list(point, key, f"point {i}")
    if len(values) != len(names):
        raise InputError(f"point {i}, {key}: {len(values)} of them for {len(names)} joints")
    return [_number(value, f"point {i}, {key}, {name}") for value, name in zip(values, names, strict=True)]


def _number(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{where}: {short(value)} is not a number")
    if not abs(value) <= _LARGEST:
        raise InputError(f"{where}: {short(value)} is not a finite number up to {_LARGEST:g}")
    return float(value)


def _seconds(value: object, where: str) -> float:
    if isinstance(value, dict):
        for whole, billionths in _ROS_TIMES:
            if set(value) == {whole, billionths}:
                return _number(value[whole], where) + _number(value[billionths], where) / 1e9
        raise InputError(f"{where}: has the keys {short(list(value))} instead of sec and nanosec")
    if value is None:
        raise InputError(f"{where}: is missing")
    return _number(value, where)
