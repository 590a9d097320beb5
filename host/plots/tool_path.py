"""The tool's path, planned and as counted, true to scale and with the error magnified."""

from math import floor, log10

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from host.plots.canvas import COUNTED, PLANNED, new_figure, tool_paths
from host.trajectory import FloatArray
from host.verify import Comparison, RunInfo

PANEL_INCHES = 4.2
INSTANTS = 20_001
MAGNIFIED_PART = 0.04
"""How large the magnified error may look, as a part of the path's extent."""

FLAT_PART = 0.01
"""A coordinate that moves by less than this part of the largest one gets no view of its own."""


def draw_tool_path(comparison: Comparison, run: RunInfo) -> Figure:
    """One row a view: the plane of the two coordinates that move most, then the third one if it moves."""
    t_s = np.linspace(0.0, comparison.plan.trajectory.duration_s, INSTANTS)
    planned_mm, counted_mm = tool_paths(comparison, t_s)
    errors_mm = counted_mm - planned_mm
    views = _views(planned_mm)
    gain = _gain(float(np.ptp(planned_mm, axis=0).max()), float(np.abs(errors_mm).max()))
    figure = new_figure(run, "tool path", PANEL_INCHES * len(views))
    for (left, right), view in zip(figure.subplots(len(views), 2, squeeze=False), views, strict=True):
        _draw_view(left, planned_mm, counted_mm, view)
        left.set_title("true to scale", loc="left")
        _draw_view(right, planned_mm, planned_mm + gain * errors_mm, view)
        right.set_title(f"error magnified {gain:g} times", loc="left")
    figure.axes[0].legend(loc="best")
    return figure


def _views(planned_mm: FloatArray) -> list[tuple[int, int]]:
    """The coordinates across and up of each view worth drawing."""
    extents_mm = np.ptp(planned_mm, axis=0)
    third, second, first = np.argsort(extents_mm, kind="stable").tolist()
    main = (min(first, second), max(first, second))
    flat = extents_mm[third] <= FLAT_PART * extents_mm[first]
    return [main] if flat else [main, (min(first, third), max(first, third))]


def _gain(extent_mm: float, error_mm: float) -> float:
    """1, 2 or 5 times a power of ten that makes the error visible, but not larger than the path."""
    wanted = MAGNIFIED_PART * extent_mm / error_mm if error_mm > 0.0 else 1.0
    if wanted <= 1.0:
        return 1.0
    decade = 10.0 ** floor(log10(wanted))
    return decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= wanted)


def _draw_view(axes: Axes, planned_mm: FloatArray, counted_mm: FloatArray, view: tuple[int, int]) -> None:
    across, up = view
    axes.plot(planned_mm[:, across], planned_mm[:, up], color=PLANNED, linewidth=5, label="planned")
    axes.plot(counted_mm[:, across], counted_mm[:, up], color=COUNTED, linewidth=0.6, label="counted")
    axes.plot(*planned_mm[0, [across, up]], marker="o", color="black", linestyle="none", label="start")
    axes.plot(*planned_mm[-1, [across, up]], marker="s", color="black", linestyle="none", label="end")
    axes.set_xlabel(f"{'xyz'[across]} [mm]")
    axes.set_ylabel(f"{'xyz'[up]} [mm]")
    axes.set_aspect("equal", adjustable="datalim")
