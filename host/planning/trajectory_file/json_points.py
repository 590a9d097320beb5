"""Read the points of a JSON trajectory, in the shape of ROS trajectory_msgs/JointTrajectory.

MoveIt writes the same inside of a moveit_msgs/RobotTrajectory, under `joint_trajectory`, with accelerations, and with
times to the nanosecond.
"""

from reprlib import repr as short
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Table, json_table, number_at
from steptwin.host.planning.motions.sampled import NumberedPlaces
from steptwin.host.planning.trajectory_file.points import Points
from steptwin.host.robots.robot import AXES_MAX

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
    """Return the points. InputErrors begin with the point's number, counted from 1, and the key."""
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
            _numbers(points[i - 1], _ACCELERATIONS, names, i)
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
    """Return times of which every one, or the last, is a whole millisecond, as motions need it; ROS has nanoseconds."""
    whole_s = np.rint(1000.0 * times_s) / 1000.0
    return np.asarray(whole_s if every else np.concatenate((times_s[:-1], whole_s[-1:])))


def _rows(points: list[Table], key: str, names: list[str]) -> FloatArray:
    """Return an array of shape (points, names), for no points too."""
    rows = [_numbers(point, key, names, i) for i, point in enumerate(points, start=1)]
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


def _numbers(point: Table, key: str, names: list[str], i: int) -> list[float]:
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
