"""Draw the tool's path, planned, counted and really reached, and how far the last two are from the plan over time."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.path_error import PathError
from steptwin.host.record.plots.canvas import COUNTED, PLANNED, new_figure, thinned
from steptwin.host.robots.kinematics.planar2r import wrapped_deg
from steptwin.host.twin.motors import MotorRun
from steptwin.host.verify import RunInfo

_HEIGHT_INCHES: Final = 5.0
REACHED: Final = "#d1661b"
"""Colour of what the rotors really do: orange, of a middle grey in print."""


def draw_tool(ran: MotorRun, run: RunInfo) -> Figure:
    """Draw the path at the left, in the plane of the two coordinates that move most; errors over time at the right."""
    figure = new_figure(run, "tool, planned, counted and really reached", _HEIGHT_INCHES)
    spaces = figure.add_gridspec(2, 2)
    _draw_path(figure.add_subplot(spaces[:, 0]), ran)
    distance, attitude = figure.add_subplot(spaces[0, 1]), figure.add_subplot(spaces[1, 1])
    paths = ran.paths
    for poses, colour, label in ((paths.counted, COUNTED, "counted"), (paths.reached, REACHED, "really reached")):
        apart = poses - paths.planned
        distance.plot(*thinned(paths.t_s, np.linalg.norm(apart[:, :3], axis=1)), color=colour, label=label)
        attitude.plot(*thinned(paths.t_s, wrapped_deg(apart[:, 3])), color=colour)
    distance.set_title("distance from the plan", loc="left")
    distance.set_ylabel("[mm]")
    distance.set_ylim(bottom=0.0)
    for axes in (distance, attitude):
        axes.set_xlim(paths.t_s[0], paths.t_s[-1])
    attitude.set_title("angle from the plan", loc="left")
    attitude.set_ylabel("[deg]")
    attitude.set_xlabel("time [s]")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=4)
    return figure


def _draw_path(axes: Axes, ran: MotorRun) -> None:
    planned = ran.paths.planned[:, :3]
    reached = PathError(planned, np.nan_to_num(ran.paths.reached[:, :3] - planned))
    counted = PathError(planned, ran.paths.counted[:, :3] - planned)
    gain = reached.gain
    first, second = sorted(np.argsort(-reached.extents_mm, kind="stable")[:2].tolist())

    def across(points: FloatArray) -> FloatArray:
        return np.asarray(points[:, [first, second]].T)

    axes.plot(*across(planned), color=PLANNED, linewidth=5, label="planned")
    axes.plot(*across(counted.counted_mm(gain)), color=COUNTED, linewidth=0.6, label="counted")
    axes.plot(*across(reached.counted_mm(gain)), color=REACHED, linewidth=1.0, label="really reached")
    axes.plot(*across(planned[:1]), marker="o", color="black", linestyle="none", label="start")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"{'xyz'[first]} [mm]")
    axes.set_ylabel(f"{'xyz'[second]} [mm]")
    axes.set_title(f"errors magnified {gain:g} times" if gain > 1.0 else "errors not magnified", loc="left")
