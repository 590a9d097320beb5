"""Draw how late accepted edges came after their ideal crossings: a histogram for every moving axis."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.plots.canvas import COUNTED, moving_axes, new_figure, note_still_axes, rows_of_axes
from steptwin.host.verify import Comparison, RunInfo
from steptwin.protocol.timer import COUNTS_PER_SECOND

ROW_INCHES = 1.45
BINS_PER_DECADE = 16
LINEAR_US = 1e6 / COUNTS_PER_SECOND
"""One count of the board's timer: no finer error can occur. The time axis is linear up to one count and logarithmic
beyond, so that the histograms of fast and slow axes keep a shape on the same time axis, in spite of the few late edges
near a reversal.
"""
LINEAR_DECADES = 0.5
"""Width of the linear part on each side, in decades."""


def draw_timing(comparison: Comparison, run: RunInfo) -> Figure:
    """Draw a row for each moving axis, all with the same bins, which look equally wide on the time axis."""
    moving = moving_axes(comparison)
    figure = new_figure(run, "edge timing against the ideal crossings", ROW_INCHES * max(len(moving), 1))
    rows = [row[0] for row in rows_of_axes(figure, len(moving))]
    late_us = [comparison.timing_errors_us(i) for i in moving]
    bins_us = _bins_us(max([0.0, *(float(np.abs(late).max()) for late in late_us if late.size)]))
    for axes, i, late in zip(rows, moving, late_us, strict=False):
        _draw(axes, late, bins_us)
        axes.set_ylabel(f"{comparison.joint_names[i]} [edges]")
    rows[-1].set_xscale("symlog", linthresh=LINEAR_US, linscale=LINEAR_DECADES)
    rows[-1].set_xlim(bins_us[0], bins_us[-1])
    rows[-1].set_xlabel(
        "accepted edge minus ideal crossing [us], positive is late; linear within one count of the board's timer,"
        f" +-{LINEAR_US:.3f} us, logarithmic beyond"
    )
    note_still_axes(figure, comparison, moving)
    return figure


def _bins_us(widest_us: float) -> FloatArray:
    """Return borders of bins on both sides of zero that reach `widest_us` and leave the linear part."""
    decades = np.log10(max(widest_us / LINEAR_US, 1.0))
    bins = int(decades * BINS_PER_DECADE) + 1
    beyond_us = LINEAR_US * 10.0 ** (np.arange(1, bins + 1) / BINS_PER_DECADE)
    linear = int(LINEAR_DECADES * BINS_PER_DECADE)
    positive_us = np.concatenate([LINEAR_US / linear * np.arange(1, linear + 1), beyond_us])
    return np.concatenate([-positive_us[::-1], [0.0], positive_us])


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
