"""The pictures of a run's motors."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.features.motors.sizing.resonance import draw_resonance
from steptwin.features.motors.turning import MotorRun
from steptwin.features.motors.turning.verdict import MARGIN_MIN
from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.path_error import PathError
from steptwin.host.record.plots.canvas import (
    COUNTED,
    LIMIT,
    PLANNED,
    STYLE,
    new_figure,
    rows_of_axes,
    save_figure,
    thinned,
)
from steptwin.host.verify import RunInfo
from steptwin.protocol.timer import COUNTS_PER_SECOND

__all__ = ["DEFAULT_PICTURES", "PICTURES", "write_motor_pictures"]

_TORQUE_ROW_INCHES: Final = 2.3
_TORQUE_COLUMNS: Final = 2
_NEEDED: Final = "0.45"


def draw_torque(ran: MotorRun, run: RunInfo) -> Figure:
    """Draw a panel for each joint: speed across, torque up."""
    joints = ran.verdict.joints
    rows = -(-len(joints) // _TORQUE_COLUMNS)
    figure = new_figure(run, "torque of the motors", _TORQUE_ROW_INCHES * rows)
    grid = figure.subplots(rows, _TORQUE_COLUMNS, squeeze=False).ravel()
    for axis, axes in enumerate(grid):
        if axis < len(joints):
            _draw_torque_of_joint(axes, ran, axis)
        else:
            axes.set_axis_off()
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower left", ncols=4, markerscale=1.5)
    return figure


def _draw_torque_of_joint(axes: Axes, ran: MotorRun, axis: int) -> None:
    torques, joint = ran.torques, ran.verdict.joints[axis]
    curve = torques.curves[axis]
    axes.plot(curve.rpm, curve.torque_nm, color=COUNTED, linewidth=1.6, label="pull-out torque")
    axes.plot(
        curve.rpm, (1.0 - MARGIN_MIN) * curve.torque_nm, color=COUNTED, linestyle="--",
        label=f"{100 * MARGIN_MIN:.0f} % less",
    )  # fmt: skip
    rpm, needed_nm = np.abs(torques.rpm[:, axis]), np.abs(torques.needed_nm[:, axis])
    axes.plot(rpm, needed_nm, ".", color=_NEEDED, markersize=2.5, markeredgewidth=0, label="needed, each ms")
    axes.plot(
        [joint.margin_rpm], [joint.torque_needed_nm], "o", color=LIMIT, markersize=6, fillstyle="none",
        markeredgewidth=1.5, label="least margin",
    )  # fmt: skip
    axes.set_title(f"{joint.name}: {joint.motor}, {100 * joint.margin:.0f} % left", loc="left")
    axes.set_xlim(0.0, float(curve.rpm[-1]))
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("turns a minute")
    axes.set_ylabel("torque [Nm]")


_TOOL_HEIGHT_INCHES: Final = 5.0
REACHED: Final = "#d1661b"
"""Colour of what the rotors really do: orange, of a middle grey in print."""


def draw_tool(ran: MotorRun, run: RunInfo) -> Figure:
    """Draw the path at the left, in the plane of the two coordinates that move most; errors over time at the right."""
    figure = new_figure(run, "tool, planned, counted and really reached", _TOOL_HEIGHT_INCHES)
    spaces = figure.add_gridspec(2, 2)
    _draw_path(figure.add_subplot(spaces[:, 0]), ran)
    distance, attitude = figure.add_subplot(spaces[0, 1]), figure.add_subplot(spaces[1, 1])
    paths = ran.paths
    for poses, colour, label in ((paths.counted, COUNTED, "counted"), (paths.reached, REACHED, "really reached")):
        apart = poses - paths.planned
        distance.plot(*thinned(paths.t_s, np.linalg.norm(apart[:, :3], axis=1)), color=colour, label=label)
        attitude.plot(*thinned(paths.t_s, paths.task.off_deg(poses, paths.planned)), color=colour)
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


_LOAD_ROW_INCHES: Final = 1.15
_WIDEST_DEG: Final = 190.0
_TORQUE_MAX_DEG: Final = 90.0
_LATE_PART: Final = 0.8
"""Part of the picture behind which a label stands on the left of its line."""


def draw_load_angle(ran: MotorRun, run: RunInfo) -> Figure:
    """Draw a row for each motor, from the start of the motion until the drivers go off."""
    names = ran.driving.robot.axis_names
    figure = new_figure(run, "load angle of the motors", _LOAD_ROW_INCHES * len(names))
    rows = rows_of_axes(figure, len(names))
    t_s = (ran.trace.counts - ran.driving.start_counts) / COUNTS_PER_SECOND
    shown = (t_s >= 0.0) & (ran.trace.counts < ran.driving.off_counts)
    end_s = max(float(t_s[shown][-1]), 1e-3)
    for axis, ((axes,), name) in enumerate(zip(rows, names, strict=True)):
        axes.plot(*thinned(t_s[shown], ran.trace.load_deg[shown, axis]), color=COUNTED)
        for limit_deg in (-_TORQUE_MAX_DEG, _TORQUE_MAX_DEG):
            axes.axhline(limit_deg, color=LIMIT, linestyle="--", label="greatest torque" if limit_deg > 0.0 else None)
        slip_counts = ran.trace.first_slip_counts[axis]
        if slip_counts is not None:
            _mark_slip(axes, ran.driving.seconds(slip_counts), end_s)
        _scale(axes, ran.trace.load_deg[shown, axis])
        axes.set_ylabel(f"{name} [deg]")
    rows[0][0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0, ncols=2)
    rows[0][0].set_title("electrical degrees between field and rotor, the greatest in each ms", loc="left")
    rows[-1][0].set_xlabel("time [s]")
    rows[-1][0].set_xlim(0.0, end_s)
    return figure


def _mark_slip(axes: Axes, at_s: float, end_s: float) -> None:
    """Draw a line at a slip, and its instant where the picture has room; before t = 0 there is no line."""
    left = at_s < _LATE_PART * end_s
    axes.axvline(at_s, color=LIMIT, linewidth=1.5)
    axes.annotate(
        f"slips at {at_s:.3f} s",
        (min(max(at_s, 0.0), end_s), 1.0),
        (3.0 if left else -3.0, -2.0),
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        ha="left" if left else "right",
        va="top",
        color=LIMIT,
        size=8,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0},
    )


def _scale(axes: Axes, load_deg: np.ndarray[tuple[int], np.dtype[np.float64]]) -> None:
    widest_deg = min(max(110.0, 1.1 * float(np.abs(load_deg).max(initial=0.0))), _WIDEST_DEG)
    axes.set_ylim(-widest_deg, widest_deg)
    axes.set_yticks([-90, 0, 90])


PICTURES: Final[dict[str, Callable[[MotorRun, RunInfo], Figure]]] = {
    "motor-load": draw_load_angle,
    "motor-torque": draw_torque,
    "motor-tool": draw_tool,
    "motor-resonance": draw_resonance,
}
"""Pictures by the names of their files."""


DEFAULT_PICTURES: Final = ("motor-load", "motor-torque", "motor-tool")
"""Pictures that are drawn into the folder of a run with --motors; the other takes longer than most runs."""


def write_motor_pictures(
    folder: Path, ran: MotorRun, run: RunInfo, names: Iterable[str] = DEFAULT_PICTURES
) -> list[Path]:
    """Draw the pictures into a folder, made if missing; return the paths of the files."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    with mpl.rc_context(STYLE):
        for name in names:
            if name == "motor-tool" and not ran.paths.task.width:
                continue
            path = folder / f"{name}.png"
            save_figure(PICTURES[name](ran, run), path, {})
            paths.append(path)
    return paths
