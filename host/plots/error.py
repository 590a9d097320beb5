"""Counted minus planned over time: every moving axis in steps, the tool in millimetres and degrees."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from host.plots.canvas import COUNTED, LIMIT, moving_axes, new_figure, note_still_axes, rows_of_axes, thinned
from host.trajectory import FloatArray
from host.verify import POSITION_ERROR_LIMIT_STEPS, Comparison, RunInfo
from host.verify.deviation import critical_instants, deviations

ROW_INCHES = 1.3


def draw_error(comparison: Comparison, run: RunInfo) -> Figure:
    """One row an axis with the limit drawn in, then the tool's position and attitude."""
    moving = moving_axes(comparison)
    figure = new_figure(run, "counted minus planned", ROW_INCHES * (len(moving) + 2))
    rows = [row[0] for row in rows_of_axes(figure, len(moving) + 2)]
    instants_s = critical_instants(comparison.plan, comparison.ideal, comparison.counted)
    parts = list(deviations(comparison.plan, comparison.counted, instants_s))
    t_s = np.repeat(instants_s, 2)
    for axes, i in zip(rows, moving, strict=False):
        _draw(axes, t_s, _edges([part.steps[..., i] for part in parts]))
        axes.set_ylabel(f"{comparison.joint_names[i]} [steps]")
        for limit in (-POSITION_ERROR_LIMIT_STEPS, POSITION_ERROR_LIMIT_STEPS):
            axes.axhline(limit, color=LIMIT, linestyle="--", linewidth=0.8)
    _draw(rows[-2], t_s, _edges([part.distance_mm for part in parts]))
    rows[-2].set_ylabel("tool [mm]")
    _draw(rows[-1], t_s, _edges([part.attitude_deg for part in parts]))
    rows[-1].set_ylabel("attitude [deg]")
    rows[0].set_title(f"dashed: limit of {POSITION_ERROR_LIMIT_STEPS:g} steps", loc="left")
    rows[-1].set_xlabel("time [s]")
    note_still_axes(figure, comparison, moving)
    return figure


def _edges(sides: list[FloatArray]) -> FloatArray:
    """Chunks of shape (2, n) in order of time: before and after the first edge, then the second, ..."""
    return np.concatenate([part.T.ravel() for part in sides])


def _draw(axes: Axes, t_s: FloatArray, values: FloatArray) -> None:
    axes.plot(*thinned(t_s, values), color=COUNTED, linewidth=0.5)
