"""Read trajectories from files: CSV, or JSON or YAML in the shape of ROS trajectory_msgs/JointTrajectory.

Positions are in mm and degrees, or in other units that a caller names, times in seconds from 0. Without velocities the
motion is a C2 spline through the points, from rest to rest, with a pause where points repeat; or one of the other
interpolations. With velocities it consists of cubics, and the times are whole milliseconds.

CSV has a header `t,<joint>,...` with the joints in any order, and for velocities a column `v_<joint>` for each. JSON
has `joint_names`, and `points` with `positions`, `time_from_start` and optional `velocities`. In place of the joints
both may have the tool's coordinates x, y, z and phi. docs/motions.md describes all of it.
"""

from io import StringIO
from math import inf
from pathlib import Path
from typing import Final

from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import CSV_BYTES_MAX, JSON_BYTES_MAX, YAML_BYTES_MAX
from steptwin.host.common.own_files import opened_text, read_text
from steptwin.host.planning.drives import DriveLimits, check_drives
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.whole import FASTEST
from steptwin.host.planning.trajectory_file.csv_points import read_csv
from steptwin.host.planning.trajectory_file.file_motion import DEFAULT, FileMotion, PointCurve, doubt
from steptwin.host.planning.trajectory_file.points import LONGEST_S, USUAL, FileUnits, Points
from steptwin.host.planning.trajectory_file.ros_points import read_json, read_yaml
from steptwin.host.robots.robot import Robot

__all__ = [
    "DEFAULT",
    "LONGEST_S",
    "SUFFIXES",
    "FileMotion",
    "PointCurve",
    "doubt",
    "is_trajectory_file",
    "read_file_motion",
    "read_trajectory",
    "read_trajectory_until",
    "trajectory_of_csv",
]

SUFFIXES: Final = (".csv", ".json", ".yaml", ".yml")


def is_trajectory_file(name: str) -> bool:
    """Return whether a job's name is the name of a file."""
    return name.lower().endswith(SUFFIXES)


def read_trajectory(
    path: Path | str,
    robot: Robot,
    *,
    interpolate: str | None = None,
    ramps_s: float = 0.0,
    elbow: str | None = None,
    units: str | None = None,
    law: str | None = None,
    drives: DriveLimits | None = None,
) -> Motion:
    """Return the trajectory in a file whose name ends in one of SUFFIXES.

    Args:
        path: Path of the file.
        robot: Robot whose joints or tool the file moves.
        interpolate: Motion between points without velocities: `spline`, the default, `linear` or `stop`.
        ramps_s: Duration, a whole number of milliseconds, of a run-in and a run-out for a file that starts or ends in
            motion. Without velocities in the file its motion goes on at both ends as the points do.
        elbow: Branch of the inverse kinematics for a file of poses that does not name it; by default the first one that
            reaches all of them.
        units: Units of the file's angles, `deg` or `rad`, and of its lengths, `mm` or `m`, such as `rad,m`; by default
            degrees and millimetres. A robot's joint that slides has a length.
        law: `fastest` makes the motion through the points as fast as the robot's limits allow, from rest to rest; by
            default it takes the file's times.
        drives: What limits the fastest motion besides, such as `motor_limits` returns.

    Raises:
        InputError: the file cannot be read or a value in it is wrong; the message names the file and the place in it.
            Or an argument is wrong, or does not go with the file.
    """
    return read_file_motion(
        path, robot, interpolate=interpolate, ramps_s=ramps_s, elbow=elbow, units=units, law=law, drives=drives
    ).whole


def read_file_motion(
    path: Path | str,
    robot: Robot,
    *,
    interpolate: str | None = None,
    ramps_s: float = 0.0,
    elbow: str | None = None,
    units: str | None = None,
    law: str | None = None,
    drives: DriveLimits | None = None,
) -> FileMotion:
    """Return the motion in a file with its points, to compare both; arguments and errors are `read_trajectory`'s."""
    if interpolate is not None and interpolate not in list(PointCurve):
        raise unknown("interpolate:", interpolate, PointCurve)
    if law not in (None, FASTEST):
        raise InputError(f"law={law}: a trajectory file keeps its own times, or has law={FASTEST}")
    check_drives(drives, is_fastest=law is not None)
    interpolation = None if interpolate is None else PointCurve(interpolate)
    read_in = USUAL if units is None else FileUnits.named(units)
    with prefixed(f"{path}: "):
        all_whole_ms = interpolation in (PointCurve.LINEAR, PointCurve.STOP)
        in_file = _points(path).in_units(read_in, robot).begun_at_home_of(robot)
        points = in_file.joint_points(robot, elbow, all_whole_ms=all_whole_ms)
        points.check_within(robot)
        return FileMotion.of(robot, points, interpolation, ramps_s, is_fastest=law is not None, drives=drives)


def read_trajectory_until(until_s: float, path: Path | str, robot: Robot) -> Motion:
    """Return the trajectory in a file up to its last point at or before an instant.

    Raises:
        InputError: as `read_trajectory` does, or there are not two points up to that instant.
    """
    with prefixed(f"{path}: "):
        return _motion(_points(path), robot, until_s)


def trajectory_of_csv(text: str, robot: Robot, until_s: float = inf) -> Motion:
    """Return the trajectory in the text of a CSV file; raises as `read_trajectory` does, without the path."""
    return _motion(read_csv(StringIO(text)), robot, until_s)


def _motion(points: Points, robot: Robot, until_s: float) -> Motion:
    return FileMotion.of(robot, points.until(until_s).joint_points(robot), None, 0.0).whole


def _points(path: Path | str) -> Points:
    name = str(path).lower()
    if name.endswith(".json"):
        return read_json(read_text(path, JSON_BYTES_MAX))
    if name.endswith((".yaml", ".yml")):
        return read_yaml(read_text(path, YAML_BYTES_MAX))
    with opened_text(path, CSV_BYTES_MAX) as file:
        return read_csv(file)
