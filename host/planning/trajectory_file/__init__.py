"""Read trajectories from files: CSV, or JSON in the shape of ROS trajectory_msgs/JointTrajectory.

Positions are in mm and degrees, times in seconds from 0. Without velocities the motion is a C2 spline through the
points, from rest to rest, which stands still where points repeat. With velocities it is a cubic from point to point,
and the times are whole milliseconds.

CSV has a header `t,<joint>,...` with the joints in any order, and for velocities a column `v_<joint>` for each. JSON
has `joint_names`, and `points` with `positions`, `time_from_start` and optional `velocities`.
"""

from io import StringIO
from math import inf
from typing import Final

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.file_limits import CSV_BYTES_MAX, JSON_BYTES_MAX
from steptwin.host.common.text_file import opened_text, read_text
from steptwin.host.planning.motions.sampled import Sampled
from steptwin.host.planning.motions.sequence import Sequence
from steptwin.host.planning.trajectory_file.csv_points import read_csv
from steptwin.host.planning.trajectory_file.json_points import read_json
from steptwin.host.planning.trajectory_file.points import LONGEST_S, Points
from steptwin.host.robots.robot import Robot

__all__ = [
    "LONGEST_S",
    "SUFFIXES",
    "is_trajectory_file",
    "read_trajectory",
    "read_trajectory_until",
    "trajectory_of_csv",
]

SUFFIXES: Final = (".csv", ".json")

_ENCODING: Final = "utf-8-sig"
"""UTF-8, with a byte order mark or without."""


def is_trajectory_file(name: str) -> bool:
    """Return whether a job's name is the name of a file."""
    return name.lower().endswith(SUFFIXES)


def read_trajectory(path: str, robot: Robot) -> Sampled | Sequence:
    """Return the trajectory in a file whose name ends in .csv or .json.

    Raises:
        InputError: the file cannot be read or a value in it is wrong; the message names the file and the place in it.
    """
    return read_trajectory_until(inf, path, robot)


def read_trajectory_until(until_s: float, path: str, robot: Robot) -> Sampled | Sequence:
    """Return the trajectory in a file up to its last point at or before an instant.

    Raises:
        InputError: as `read_trajectory` does, or there are not two points up to that instant.
    """
    with prefixed(f"{path}: "):
        return _points(path).until(until_s).motion(robot)


def trajectory_of_csv(text: str, robot: Robot, until_s: float = inf) -> Sampled | Sequence:
    """Return the trajectory in the text of a CSV file; raises as `read_trajectory` does, without the path."""
    return read_csv(StringIO(text)).until(until_s).motion(robot)


def _points(path: str) -> Points:
    if path.lower().endswith(".json"):
        return read_json(read_text(path, JSON_BYTES_MAX, _ENCODING))
    with opened_text(path, CSV_BYTES_MAX, _ENCODING) as file:
        return read_csv(file)
