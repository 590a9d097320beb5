"""Write and read trajectory.csv: the planned motion as points with velocities, cubic between two points.

`steptwin run ROBOT trajectory.csv` makes the same motion again. The columns after the velocities are derived, for
people and their plots: the joints' accelerations and the tool's pose.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.whole_file import whole_file
from steptwin.host.planning.motion import Motion, OutputChange
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.trajectory_file import read_trajectory_until
from steptwin.host.planning.trajectory_file.points import TOOL_AXES, VELOCITY, derived_columns
from steptwin.host.record.folder.layout import TRAJECTORY, existing_file
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import tool_frames
from steptwin.host.robots.robot import Robot

CUBICS_OFF_STEPS: Final = 1e-4
"""Largest distance of the stored cubics from the planned motion: a 75th of the verifier's tolerance."""


_DECIMALS: Final = 6
"""Decimals of accelerations and tool positions: nanometres."""
_COSINE_DECIMALS: Final = 9
_ROWS: Final = 16_384
"""Number of points with derived columns computed at once; bounds the memory."""


def write_motion(path: Path, plan: Plan) -> None:
    """Write the plan's PVT points, or every millisecond if cubics between points deviate too much.

    Times, positions and velocities are written with all their digits, so that reading gives the same values.
    """
    t_s = _stored_ms(plan) / 1000
    positions, velocities = plan.motion.positions(t_s), plan.motion.velocities(t_s)
    rows = zip(t_s.tolist(), positions.tolist(), velocities.tolist(), strict=True)
    derived = _derived_texts(plan.robot, t_s, positions, velocities)
    with whole_file(path) as file:
        file.write(
            trajectory_head(
                plan.robot, derived_columns(plan.robot.joint_names, make_kinematics(plan.robot).task)
            ).encode()
        )
        file.writelines(trajectory_row(*row, text).encode() for row, text in zip(rows, derived, strict=True))


def trajectory_head(robot: Robot, derived: Sequence[str] = ()) -> str:
    """Return the file's first line; `derived` are the derived columns."""
    names = robot.joint_names
    return ",".join(("t", *names, *(VELOCITY + name for name in names), *derived)) + "\n"


def trajectory_row(t_s: float, positions: Sequence[float], velocities: Sequence[float], derived: str = "") -> str:
    """Return the line of a point: time in s, positions in mm and deg, velocities in mm/s and deg/s.

    `derived` is the text of the derived columns, with a comma before each.
    """
    return ",".join(map(repr, (t_s, *positions, *velocities))) + derived + "\n"


def read_motion(folder: Path, robot: Robot, output_changes: Sequence[OutputChange], until_s: float = inf) -> Motion:
    """Return the stored motion, or its part up to an instant, with the planned changes of outputs.

    Raises:
        InputError: the file is missing, or `read_trajectory_until` refuses it.
    """
    path = existing_file(folder, TRAJECTORY)
    end_s = min((until_s, *(change.from_s for change in output_changes if change.until_s > until_s)))
    known = tuple(change for change in output_changes if change.until_s <= end_s)
    return replace(read_trajectory_until(end_s, path, robot), output_changes=known)


def _derived_texts(robot: Robot, t_s: FloatArray, positions: FloatArray, velocities: FloatArray) -> Iterator[str]:
    """Yield the text of the derived columns for each of n points, with a comma before each column.

    Accelerations are those of the cubics just after each point; for the last point just before it.
    """
    kinematics = make_kinematics(robot)
    third, second = _cubics(t_s, positions, velocities)[:2]
    end_s = t_s[-1] - t_s[-2]
    accelerations = np.concatenate([2 * second, 2 * second[-1:] + third[-1:] * end_s * 6])
    task = kinematics.task
    cosines = len(TOOL_AXES) if task.width else 0
    rounded = len(robot.joints) + len(task.coordinates)
    template = f",%.{_DECIMALS}f" * rounded + f",%.{_COSINE_DECIMALS}f" * cosines
    for first in range(0, len(t_s), _ROWS):
        part = slice(first, first + _ROWS)
        values = [accelerations[part], task.figures(kinematics.forward(positions[part]))]
        if cosines:
            axes = tool_frames(kinematics, positions[part])[:, :3, :2]
            values.append(axes.swapaxes(1, 2).reshape(-1, cosines))
        figures = np.column_stack(values)
        figures[:, :rounded] = np.round(figures[:, :rounded], _DECIMALS)
        figures[:, rounded:] = np.round(figures[:, rounded:], _COSINE_DECIMALS)
        yield from (template % tuple(row) for row in (figures + 0.0).tolist())  # a rounded 0 has no sign


def _stored_ms(plan: Plan) -> Int64Array:
    """Return the times of the points to store, in milliseconds."""
    every_ms = np.arange(plan.times_ms[-1] + 1)
    t_s, point_s = every_ms / 1000, plan.times_ms / 1000
    motion = plan.motion
    cubics = _cubics(point_s, motion.positions(point_s), motion.velocities(point_s))
    nearest = np.searchsorted(plan.times_ms[1:-1], every_ms, side="right")
    third, second, first, start = cubics[:, nearest]
    since_s = (t_s - point_s[nearest])[:, np.newaxis]
    positions = ((third * since_s + second) * since_s + first) * since_s + start
    off_steps = np.abs(plan.robot.to_steps(positions - motion.positions(t_s)))
    return plan.times_ms if off_steps.max() <= CUBICS_OFF_STEPS else every_ms


def _cubics(t_s: FloatArray, positions: FloatArray, velocities: FloatArray) -> FloatArray:
    """Return the cubics between points, of shape (4, points - 1, joints): in powers of the time since the point before.

    The highest power comes first. They are those of `scipy.interpolate.CubicHermiteSpline` to the last bit; to import
    that would take longer than to write the folder.
    """
    dt_s = np.diff(t_s)[:, np.newaxis]
    slopes = np.diff(positions, axis=0) / dt_s
    bend = (velocities[:-1] + velocities[1:] - 2 * slopes) / dt_s
    return np.array([bend / dt_s, (slopes - velocities[:-1]) / dt_s - bend, velocities[:-1], positions[:-1]])
