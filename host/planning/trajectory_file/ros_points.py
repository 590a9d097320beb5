"""Read the points of a trajectory in a message of ROS, as JSON or YAML.

The motion is a trajectory_msgs/JointTrajectory. MoveIt and the tools of ROS put it into other messages, which are
searched by their keys. A YAML text is one document with scalars as in JSON: every number is a number, and any other
scalar is a text. (YAML 1.1 would read 1e-05, which Python writes, as a text and `on` as true.) Aliases are refused
before anything is built, since a few nested ones stand for millions of values.
"""

import re
from collections.abc import Iterator
from reprlib import repr as short
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import prefixed, shortened
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Table, json_table, number_at
from steptwin.host.planning.motions.sampled import NumberedPlaces
from steptwin.host.planning.trajectory_file.points import Points
from steptwin.host.robots.robot import AXES_MAX

YAML: Final = "YAML mapping"
"""Name of such a text's table in messages."""
_NUMBER: Final = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
_DEEP_MAX: Final = 16
"""Deepest nesting of lists and mappings; a value of a planned trajectory is ten deep."""
_AROUND: Final[dict[str, tuple[str, ...]]] = {
    "goal": ("header", "goal_id", "goal"),
    "trajectory": (
        *("model_id", "trajectory", "trajectory_start", "group_name", "planning_time", "error_code"),
        *("controller_names", "multi_dof_trajectory", "path_tolerance", "component_path_tolerance"),
        *("goal_tolerance", "component_goal_tolerance", "goal_time_tolerance"),
    ),
    "joint_trajectory": ("joint_trajectory", "multi_dof_joint_trajectory"),
}
"""Messages around a trajectory from the outermost one: the key of their content, and all keys that they may have.

goal              the goal of an action of ROS 1, as `rostopic echo` writes it
trajectory        moveit_msgs/DisplayTrajectory, MotionPlanResponse and ExecuteTrajectoryGoal; of control_msgs
                  FollowJointTrajectoryGoal
joint_trajectory  moveit_msgs/RobotTrajectory
"""
_OTHER_MOTIONS: Final = ("multi_dof_joint_trajectory", "multi_dof_trajectory")
"""Motions of joints with several degrees of freedom, which must be empty."""
_DOCUMENT_KEYS: Final = ("header", "joint_names", "points")
_POINT_KEYS: Final = ("positions", "velocities", "accelerations", "effort", "time_from_start")
_ACCELERATIONS: Final = "accelerations"
"""Derived values of a point: positions and velocities alone determine the motion."""
_EFFORT: Final = "effort"
"""Values of a point that StepTwin cannot use; they may be empty."""
_TIME: Final = "time_from_start"
_TIME_PARTS: Final = (("sec", "nanosec"), ("secs", "nsecs"))
"""The two keys of a time in ROS 2 and in ROS 1."""


_JSON: Final = "JSON object"
_CUT: Final = "..."
"""Last element of a list that `ros2 topic echo` has cut after 128 values."""


def yaml_table(text: str) -> Table:
    """Return the mapping of a YAML text; further documents must be empty, as after the last line of `rostopic echo`.

    Raises:
        InputError: the text is not YAML, is nested too deeply, has an alias, or has no or several documents.
    """
    import yaml

    loader = getattr(yaml, "CBaseLoader", yaml.BaseLoader)  # libyaml, if available, reads ten times as fast
    try:
        starts = list(_checked_starts(text, loader))
        documents = list(yaml.load_all(text, Loader=loader))
    except yaml.YAMLError as error:
        raise InputError(f"is not YAML: {_in_a_line(error)}") from error
    full = [(line, document) for line, document in zip(starts, documents, strict=True) if document]
    if len(full) > 1:
        lines = ", ".join(str(line) for line, _ in full[:_SHOWN])
        more = ", ..." if len(full) > _SHOWN else ""
        raise InputError(f"has {len(full)} messages, which begin at lines {lines}{more}: keep the one to be run")
    return Table(_with_numbers(full[0][1]) if full else {}, YAML)


_SHOWN: Final = 3


def _checked_starts(text: str, loader: type) -> Iterator[int]:
    """Yield the line at which each document begins; raise InputError for an alias or too deep a nesting."""
    import yaml

    deep = 0
    for event in yaml.parse(text, Loader=loader):
        line = event.start_mark.line + 1
        match event:
            case yaml.AliasEvent(anchor=anchor):
                raise InputError(
                    f"line {line}: *{shortened(anchor)} is an alias: write out the value that it stands for"
                )
            case yaml.CollectionStartEvent():
                deep += 1
                if deep > _DEEP_MAX:
                    raise InputError(f"line {line}: more than {_DEEP_MAX} lists and mappings within one another")
            case yaml.CollectionEndEvent():
                deep -= 1
            case yaml.DocumentStartEvent():
                yield line


def _in_a_line(error: Exception) -> str:
    """Return a parser's error with its line number, in one line."""
    mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", None)
    place = f"line {mark.line + 1}: " if mark else ""
    return place + " ".join(str(problem or error).split())


def _with_numbers(value: object) -> object:
    """Convert a document of texts to numbers where possible."""
    match value:
        case dict():
            return {key: _with_numbers(each) for key, each in value.items()}
        case list():
            return [_with_numbers(each) for each in value]
        case str() if _NUMBER.fullmatch(value):
            return float(value)
    return value


def read_json(text: str) -> Points:
    """Return the points of a JSON file; InputErrors begin with the point's number, counted from 1, and the key."""
    return _points(json_table(text), _JSON)


def read_yaml(text: str) -> Points:
    """Return the points of a YAML file; InputErrors begin as in `read_json`."""
    return _points(yaml_table(text), YAML)


def read_message(message: object) -> Points:
    """Return the points of a message decoded from JSON; InputErrors begin as in `read_json`."""
    return _points(Table(message, _JSON), _JSON)


def _points(message: Table, kind: str) -> Points:
    """Return the points of a message with tables of a kind.

    ROS times in nanoseconds are rounded where a motion needs it.
    """
    document = _joint_trajectory(message, kind)
    document.check_keys(_DOCUMENT_KEYS)
    names = [_name(name) for name in document.elements("joint_names")]
    points = [_point(value, i, kind) for i, value in enumerate(document.elements("points"), start=1)]
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
        is_goal=bool(points) and bool(whole_s[0] > 0.0),
    )


def _joint_trajectory(message: Table, kind: str) -> Table:
    """Return the joints' trajectory in a message; another document as it is."""
    for key, keys in _AROUND.items():
        if key not in message:
            continue
        message.check_keys(keys)
        for other in _OTHER_MOTIONS:
            motion = message.values.get(other)
            if isinstance(motion, dict) and motion.get("points"):
                raise InputError(f"{other}: has points; a motion of joints alone can be run")
        held = message.values[key]
        if isinstance(held, list) and key == "trajectory":
            if len(held) != 1:
                raise InputError(f"{key}: has {len(held)} motions: keep the one to be run")
            held = held[0]
        with prefixed(f"{key}: "):
            message = Table(held, kind)
    return message


def _whole_ms(times_s: FloatArray, *, every: bool) -> FloatArray:
    """Return times with all, or only the last one, rounded to whole milliseconds; ROS has nanoseconds."""
    whole_s = np.rint(1000.0 * times_s) / 1000.0
    return np.asarray(whole_s if every else np.concatenate((times_s[:-1], whole_s[-1:])))


def _rows(points: list[Table], key: str, names: list[str]) -> FloatArray:
    """Return an array of shape (points, names), even without points."""
    rows = [_json_numbers(point, key, names, i) for i, point in enumerate(points, start=1)]
    return np.array(rows).reshape(len(points), len(names))


def _name(value: object) -> str:
    if not isinstance(value, str):
        raise InputError(f"joint_names: {short(value)} is not a name")
    return value


def _point(value: object, i: int, kind: str) -> Table:
    with prefixed(f"point {i}: "):
        if value == _CUT:
            raise InputError("the list is cut here: `ros2 topic echo --full-length` prints all of it")
        point = Table(value, kind)
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
    """Return a point's time, from a number of seconds or a duration of ROS."""
    key = _TIME
    time = point.values.get(key)
    with prefixed(f"point {i}, "):
        if not isinstance(time, dict):
            return point.number(key)
        for whole, billionths in _TIME_PARTS:
            if set(time) == {whole, billionths}:
                return number_at(key, time[whole]) + number_at(key, time[billionths]) / 1e9
        raise InputError(f"{key}: has the keys {short(list(time))} instead of sec and nanosec")
