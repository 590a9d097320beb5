"""Read the points of a CSV or JSON trajectory; of CSV line by line, so that memory holds no more than the numbers."""

from array import array
from dataclasses import dataclass
from math import isfinite
from reprlib import repr as short
from typing import Final, Self, TextIO

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import COLUMNS_MAX, POINTS_MAX
from steptwin.host.common.numbers import LARGEST, check_once, fields_of, numbered_lines, numbers_of
from steptwin.host.common.tables import Table, json_table, number_at
from steptwin.host.planning.motions.sampled import NumberedPlaces
from steptwin.host.planning.trajectory_file.points import VELOCITY, Points, derived_in
from steptwin.host.robots.poses import PLACE
from steptwin.host.robots.robot import AXES_MAX

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
    """The column of a branch's name beside the tool's coordinates; a file has one branch, which may be given once.

    Attributes:
        index: the column's index in the header.
        value: the branch, as soon as a line has named it.
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
        """Take a line's branch; raise InputError if it is another one than before."""
        if field and self.value is not None and field != self.value:
            raise InputError(
                f"line {line}, elbow: {short(field)} after {short(self.value)}: a file of poses keeps its branch;"
                " a file of joints can change it"
            )
        self.value = field or self.value


def _numbers(line: str, header: list[str], kept: list[int], elbow: _ElbowColumn | None, i: int) -> list[float]:
    """Return the numbers of a line in the columns that are kept."""
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
    """Return a row of plain numbers, in a quarter of the time; None for a row that `numbers_of` must read or refuse."""
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


_ROBOT_TRAJECTORY: Final = ("joint_trajectory", "multi_dof_joint_trajectory")
"""Keys of what MoveIt plans; the motion of joints with several degrees of freedom must be empty."""
_DOCUMENT_KEYS: Final = ("header", "joint_names", "points")
_POINT_KEYS: Final = ("positions", "velocities", "accelerations", "effort", "time_from_start")
_ACCELERATIONS: Final = "accelerations"
"""Values of a point that follow from the others: positions and velocities alone make the motion."""
_EFFORT: Final = "effort"
"""Values of a point that StepTwin cannot obey; they may be empty."""
_TIME: Final = "time_from_start"
_TIME_PARTS: Final = (("sec", "nanosec"), ("secs", "nsecs"))
"""The two keys of a time in ROS 2 and in ROS 1."""


def read_json(text: str) -> Points:
    """Return the points of a file in the shape of ROS trajectory_msgs/JointTrajectory.

    MoveIt writes the same inside of a moveit_msgs/RobotTrajectory, under `joint_trajectory`, with accelerations, and
    with times to the nanosecond. InputErrors begin with the point's number, counted from 1, and the key.
    """
    document = _joint_trajectory(json_table(text))
    document.check_keys(_DOCUMENT_KEYS)
    names = [_name(name) for name in document.elements("joint_names")]
    points = [_point(value, i) for i, value in enumerate(document.elements("points"), start=1)]
    moving = [bool(point.values.get("velocities")) for point in points]
    if any(moving) and not all(moving):
        raise InputError(f"point {moving.index(False) + 1}: has no velocities, other points have some")
    if len(names) > AXES_MAX:
        raise InputError(f"joint_names: {len(names)} names, more than the {AXES_MAX} joints that a board drives")
    times_s = np.array([_seconds(point, i) for i, point in enumerate(points, start=1)])
    in_parts = any(isinstance(point.values.get(_TIME), dict) for point in points)
    whole_s = _whole_ms(times_s, every=any(moving)) if in_parts else times_s
    if given := [i for i, point in enumerate(points, start=1) if point.values.get(_ACCELERATIONS)]:
        for i in given:
            _json_numbers(points[i - 1], _ACCELERATIONS, names, i)
    return Points(
        names,
        NumberedPlaces("point {}, time_from_start", range(1, len(points) + 1)),
        whole_s,
        _rows(points, "positions", names),
        _rows(points, "velocities", names) if any(moving) else None,
        unread=(_ACCELERATIONS,) if given else (),
        rounded_s=float(np.abs(whole_s - times_s).max(initial=0.0)),
    )


def _joint_trajectory(document: Table) -> Table:
    """Return the joints' trajectory in what MoveIt plans; any other document as it is."""
    if _ROBOT_TRAJECTORY[0] not in document:
        return document
    document.check_keys(_ROBOT_TRAJECTORY)
    other = document.values.get(_ROBOT_TRAJECTORY[1])
    if isinstance(other, dict) and other.get("points"):
        raise InputError(f"{_ROBOT_TRAJECTORY[1]}: has points; a motion of joints alone can be run")
    with prefixed(f"{_ROBOT_TRAJECTORY[0]}: "):
        return Table(document.values[_ROBOT_TRAJECTORY[0]], "JSON object")


def _whole_ms(times_s: FloatArray, *, every: bool) -> FloatArray:
    """Return times that are all, or at the end, a whole millisecond, as motions need it; ROS has nanoseconds."""
    whole_s = np.rint(1000.0 * times_s) / 1000.0
    return np.asarray(whole_s if every else np.concatenate((times_s[:-1], whole_s[-1:])))


def _rows(points: list[Table], key: str, names: list[str]) -> FloatArray:
    """Return an array of shape (points, names), for no points too."""
    rows = [_json_numbers(point, key, names, i) for i, point in enumerate(points, start=1)]
    return np.array(rows).reshape(len(points), len(names))


def _name(value: object) -> str:
    if not isinstance(value, str):
        raise InputError(f"joint_names: {short(value)} is not a name")
    return value


def _point(value: object, i: int) -> Table:
    with prefixed(f"point {i}: "):
        point = Table(value, "JSON object")
    with prefixed(f"point {i}, "):
        point.check_keys(_POINT_KEYS)
        if point.values.get(_EFFORT):
            raise InputError(f"{_EFFORT}: would not be obeyed; leave it out")
    return point


def _json_numbers(point: Table, key: str, names: list[str], i: int) -> list[float]:
    with prefixed(f"point {i}, "):
        values = point.elements(key)
        if len(values) != len(names):
            raise InputError(f"{key}: {len(values)} of them for {len(names)} joints")
        return [number_at(f"{key}, {name}", value) for value, name in zip(values, names, strict=True)]


def _seconds(point: Table, i: int) -> float:
    """Return a point's time, written as a number of seconds or as ROS writes a duration."""
    key = _TIME
    time = point.values.get(key)
    with prefixed(f"point {i}, "):
        if not isinstance(time, dict):
            return point.number(key)
        for whole, billionths in _TIME_PARTS:
            if set(time) == {whole, billionths}:
                return number_at(key, time[whole]) + number_at(key, time[billionths]) / 1e9
        raise InputError(f"{key}: has the keys {short(list(time))} instead of sec and nanosec")
