"""Draw counted minus planned over time: every moving axis in steps, the tool in millimetres and degrees."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.record.plots.canvas import (
    COLUMNS,
    COUNTED,
    LIMIT,
    around,
    drawn_instants,
    envelope,
    moving_axes,
    new_figure,
    note_still_axes,
    write_inside,
)
from steptwin.host.verify import POSITION_ERROR_LIMIT_STEPS, Comparison, RunInfo
from steptwin.host.verify.deviation import ToolDeviation, deviations

ROW_INCHES = 1.45
WIDTH_RATIOS = (3.0, 1.0)
CLOSE_EDGES = 5
"""Number of edges that the close view shows on each side of the largest error."""
SPARSE_EDGES = COLUMNS // 4
"""Greatest number of edges in the whole motion that are drawn one by one."""


@dataclass(frozen=True, slots=True)
class _Series:
    """An error with its name and unit: t_s of shape (n,), values just before and after t_s of shape (2, n)."""

    label: str
    t_s: FloatArray
    values: FloatArray

    @property
    def edges(self) -> Int64Array:
        """Indexes of the instants when the error jumps, because a step was counted."""
        return np.flatnonzero(self.values[0] != self.values[1])


def draw_error(comparison: Comparison, run: RunInfo) -> Figure:
    """Draw a row for each moving axis, with the limit, then the tool's; at the right the largest error close up."""
    moving = moving_axes(comparison)
    series = _all_series(comparison, moving)
    figure = new_figure(run, "counted minus planned", ROW_INCHES * len(series))
    ratios = WIDTH_RATIOS if any(one.edges.size for one in series) else WIDTH_RATIOS[:1]
    rows = figure.subplots(len(series), len(ratios), squeeze=False, width_ratios=ratios)
    end_s = comparison.expected.trajectory.duration_s
    for n, (row, one) in enumerate(zip(rows, series, strict=True)):
        _draw_whole(row[0], one, end_s)
        for right in row[1:]:
            _draw_close(right, one)
        if n < len(moving):
            _draw_limits(row)
        row[0].tick_params(labelbottom=n == len(series) - 1)
    for right in rows[0][1:]:
        right.set_title("the largest, close up", loc="left")
    dashed = f"; dashed: limit of {POSITION_ERROR_LIMIT_STEPS:g} steps" if moving else ""
    rows[0][0].set_title(f"whole motion{dashed}", loc="left")
    rows[-1][0].set_xlabel("time [s]")
    note_still_axes(figure, comparison, moving)
    return figure


def _all_series(comparison: Comparison, moving: list[int]) -> list[_Series]:
    t_s = drawn_instants(comparison)
    parts = list(deviations(comparison, t_s))
    steps = np.concatenate([part.steps for part in parts], axis=1)
    axes = [_Series(f"{comparison.joint_names[i]} [steps]", t_s, steps[..., i]) for i in moving]
    tools = _tool_series("", t_s, [part.tool for part in parts])
    actual = [part.actual_tool for part in parts if part.actual_tool]
    return [*axes, *tools, *(_tool_series("actual ", t_s, actual) if actual else [])]


def _tool_series(which: str, t_s: FloatArray, parts: list[ToolDeviation]) -> list[_Series]:
    distance_mm = np.concatenate([part.distance_mm for part in parts], axis=1)
    attitude_deg = np.concatenate([part.attitude_deg for part in parts], axis=1)
    return [_Series(f"{which}tool [mm]", t_s, distance_mm), _Series(f"{which}attitude [deg]", t_s, attitude_deg)]


def _draw_whole(axes: Axes, series: _Series, end_s: float) -> None:
    """Draw the error as a line; if that had edges in most columns of pixels, its least and greatest values instead."""
    end_s = max(end_s, series.t_s[-1])
    if series.edges.size <= SPARSE_EDGES:
        _draw_line(axes, series.t_s, series.values)
    else:
        t_s, lows, highs = envelope(series.t_s, series.values, end_s)
        axes.fill_between(t_s, lows, highs, color=COUNTED, alpha=0.15, linewidth=0.0)
        for extremes in (lows, highs):
            axes.plot(t_s, extremes, color=COUNTED, linewidth=0.7)
    axes.set_xlim(0.0, end_s)
    axes.set_ylabel(series.label)


def _draw_close(axes: Axes, series: _Series) -> None:
    """Draw the few edges around the largest error, where single steps are visible."""
    worst = int(np.abs(series.values).max(axis=0).argmax())
    edges = series.edges
    near = int(np.searchsorted(edges, worst))
    close = edges[max(near - CLOSE_EDGES, 0) : near + CLOSE_EDGES + 1]
    if close.size == 0:
        axes.set_axis_off()
        write_inside(axes, "no step counted")
        return
    part = slice(max(min(int(close[0]), worst) - 1, 0), max(int(close[-1]), worst) + 2)
    t_ms = 1e3 * (series.t_s[part] - series.t_s[worst])
    _draw_line(axes, t_ms, series.values[:, part])
    axes.locator_params(axis="x", nbins=5)
    axes.set_xlabel(around(series.t_s[worst]), size=8)


def _draw_line(axes: Axes, times: FloatArray, values: FloatArray) -> None:
    """Draw a line that jumps at each instant from the value before it to the value after it."""
    axes.plot(np.repeat(times, 2), values.T.ravel(), color=COUNTED, linewidth=0.9)


def _draw_limits(row: Iterable[Axes]) -> None:
    for axes in row:
        for limit in (-POSITION_ERROR_LIMIT_STEPS, POSITION_ERROR_LIMIT_STEPS):
            if axes.axison:
                axes.axhline(limit, color=LIMIT, linestyle="--", linewidth=0.8)
