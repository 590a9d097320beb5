"""How late the accepted edges came, against the ideal crossings: a histogram for every moving axis."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from host.plots.canvas import COUNTED, moving_axes, new_figure, note_still_axes, rows_of_axes
from host.trajectory import FloatArray
from host.verify import Comparison, RunInfo

ROW_INCHES = 1.45
BINS = 101
SMALLEST_RANGE_US = 0.02
"""A little more than one count of the board's timer: nothing finer is real."""


def draw_timing(comparison: Comparison, run: RunInfo) -> Figure:
    """One row an axis, all with the same bins."""
    moving = moving_axes(comparison)
    figure = new_figure(run, "edge timing against the ideal crossings", ROW_INCHES * max(len(moving), 1))
    rows = [row[0] for row in rows_of_axes(figure, len(moving))]
    late_us = [comparison.timing_errors_us(i) for i in moving]
    widest_us = max([SMALLEST_RANGE_US, *(float(np.abs(late).max()) for late in late_us if late.size)])
    bins_us = np.linspace(-widest_us, widest_us, BINS + 1)
    for axes, i, late in zip(rows, moving, late_us, strict=False):
        _draw(axes, late, bins_us)
        axes.set_ylabel(f"{comparison.joint_names[i]} [edges]")
    rows[-1].set_xlabel("accepted edge minus ideal crossing [us]; positive is late")
    note_still_axes(figure, comparison, moving)
    return figure


def _draw(axes: Axes, late_us: FloatArray, bins_us: FloatArray) -> None:
    axes.set_title(_summary(late_us), loc="right", size=8)
    if late_us.size:
        axes.hist(late_us, bins=bins_us.tolist(), color=COUNTED)
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.7)


def _summary(late_us: FloatArray) -> str:
    if late_us.size == 0:
        return "no edge to judge"
    p50, p99, worst = np.percentile(np.abs(late_us), [50, 99, 100])
    return f"{late_us.size} edges, |error|: median {p50:.3g}, 99 % {p99:.3g}, max {worst:.3g} us"
