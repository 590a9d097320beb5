"""Draw the tool's pose over time, planned and counted: position, attitude, direction cosines and speed."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.plots.canvas import COUNTED, PLANNED, new_figure, planned_instants, rows_of_axes
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.frames import tool_frames
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import Comparison, RunInfo

ROW_INCHES: Final = 1.45
WIDE_MM: Final = 1.0
"""Least height of a panel in mm, deg or mm/s: below it rounding errors would look like motion."""

_COORDINATES: Final = ("x [mm]", "y [mm]", "z [mm]", "attitude [deg]")
_AXES: Final = ("n, the tool's x axis", "o, its y axis", "a, its z axis")
_STYLES: Final = ("-", "--", ":")
"""Lines of the direction cosines with x, y and z, which colours alone would not tell apart in print."""


def draw_tool_pose(comparison: Comparison, run: RunInfo) -> Figure:
    """Draw x, y, z and the attitude at the left; at the right the direction cosines of a known robot, and the speed."""
    robot = comparison.expected.robot
    figure = new_figure(run, "tool pose", ROW_INCHES * len(_COORDINATES))
    rows = rows_of_axes(figure, len(_COORDINATES), 2)
    t_s = planned_instants(comparison)
    planned, counted = comparison.expected.trajectory.positions(t_s), _counted(comparison, t_s)
    poses, counted_poses = (_unwrapped(comparison.expected.forward(joints)) for joints in (planned, counted))
    for (axes, _), values, counted_values, label in zip(rows, poses.T, counted_poses.T, _COORDINATES, strict=True):
        _draw_both(axes, t_s, values, counted_values)
        axes.set_ylabel(label)
    if robot is None:
        for _, axes in rows[:-1]:
            axes.set_axis_off()
    else:
        _draw_cosines([axes for _, axes in rows[:-1]], t_s, robot, counted)
    _draw_speed(rows[-1][1], t_s, poses[:, :3])
    rows[0][0].set_title("position and attitude", loc="left")
    rows[0][0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0, ncols=2)
    for axes in rows[-1]:
        axes.set_xlabel("time [s]")
        axes.set_xlim(0.0, t_s[-1])
    return figure


def _counted(comparison: Comparison, t_s: FloatArray) -> FloatArray:
    """Return the joints, of shape (n, joints), at which the drivers' counts stand just after each instant."""
    return comparison.expected.joints(np.column_stack([axis.around(t_s)[1] for axis in comparison.counted]))


def _unwrapped(poses: FloatArray) -> FloatArray:
    """Return poses over time whose attitude does not jump by a whole turn."""
    return np.column_stack([poses[:, :3], np.unwrap(poses[:, 3], period=360.0)])


def _draw_both(axes: Axes, t_s: FloatArray, planned: FloatArray, counted: FloatArray) -> None:
    axes.plot(t_s, planned, color=PLANNED, linewidth=4, label="planned")
    axes.plot(t_s, counted, color=COUNTED, linewidth=0.8, label="counted")
    _widen(axes, planned)


def _widen(axes: Axes, values: FloatArray) -> None:
    middle = (values.min() + values.max()) / 2
    axes.update_datalim([(0.0, middle - WIDE_MM / 2), (0.0, middle + WIDE_MM / 2)])


def _draw_cosines(column: list[Axes], t_s: FloatArray, robot: Robot, joints: FloatArray) -> None:
    frames = tool_frames(make_kinematics(robot), joints)
    for k, (axes, what) in enumerate(zip(column, _AXES, strict=True)):
        for coordinate, style in enumerate(_STYLES):
            axes.plot(t_s, frames[:, coordinate, k], color=COUNTED, linestyle=style, label="xyz"[coordinate])
        axes.set_ylim(-1.1, 1.1)
        axes.set_ylabel(f"cosines of {what[0]} [1]")
        axes.set_title(what, loc="left")
    column[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0, ncols=3)


def _draw_speed(axes: Axes, t_s: FloatArray, planned_mm: FloatArray) -> None:
    speeds = np.linalg.norm(np.diff(planned_mm, axis=0), axis=1) / np.diff(t_s)
    axes.plot((t_s[1:] + t_s[:-1]) / 2, speeds, color=COUNTED)
    _widen(axes, speeds)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("[mm/s]")
    axes.set_title("planned speed along the path", loc="left")
