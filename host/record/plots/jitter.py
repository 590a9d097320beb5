"""Draw interval jitter: the interval between two steps minus the interval between their ideal crossings."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.plots.canvas import COUNTED, moving_axes, new_figure, note_still_axes, rows_of_axes, thinned
from steptwin.host.verify import Comparison, RunInfo
from steptwin.host.verify.matching import MICROSECONDS, SLOW_CROSSING

ROW_INCHES = 1.45
WIDTH_RATIOS = (3.0, 1.0)
BINS = 81
SMALLEST_RANGE_US = 0.02
"""A little more than one count of the board's timer: finer jitter cannot occur."""


def draw_jitter(comparison: Comparison, run: RunInfo) -> Figure:
    """Draw a row for each moving axis: jitter over time, and its histogram beside it."""
    moving = moving_axes(comparison)
    figure = new_figure(run, "interval jitter against the ideal crossings", ROW_INCHES * max(len(moving), 1))
    rows = rows_of_axes(figure, len(moving), 2, width_ratios=WIDTH_RATIOS, sharex="col")
    for (left, right), i in zip(rows, moving, strict=False):
        left.set_ylabel(f"{comparison.joint_names[i]} [us]")
        _draw(left, right, *_jitter(comparison, i))
    rows[-1][0].set_xlabel("time [s]")
    rows[-1][0].set_xlim(0.0, comparison.expected.trajectory.duration_s)
    rows[-1][1].set_xlabel("intervals")
    note_still_axes(figure, comparison, moving)
    return figure


def _jitter(comparison: Comparison, i: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times in s, jitter and ideal intervals in us of successive steps of one direction, without slow steps."""
    ideal, counted, matching = comparison.ideal[i], comparison.counted[i], comparison.matchings[i]
    fast = ideal.speeds_hz >= SLOW_CROSSING * ideal.speeds_hz.max(initial=0.0)
    first, second = matching.ideal[:-1], matching.ideal[1:]
    follows = (second == first + 1) & (np.diff(matching.counted) == 1) & (ideal.signs[first] == ideal.signs[second])
    chosen = np.flatnonzero(follows & fast[first] & fast[second])
    intervals_s = np.diff(ideal.time_s[matching.ideal])[chosen]
    jitter_s = np.diff(counted.time_s[matching.counted])[chosen] - intervals_s
    return counted.time_s[matching.counted][chosen], MICROSECONDS * jitter_s, MICROSECONDS * intervals_s


def _draw(left: Axes, right: Axes, t_s: FloatArray, jitter_us: FloatArray, intervals_us: FloatArray) -> None:
    left.set_title(_summary(jitter_us, intervals_us), loc="right", size=8)
    widest_us = 1.05 * max(SMALLEST_RANGE_US, float(np.abs(jitter_us).max(initial=0.0)))
    left.plot(*thinned(t_s, jitter_us), color=COUNTED, linestyle="none", marker=".", markersize=1.5)
    left.set_ylim(-widest_us, widest_us)
    if jitter_us.size == 0:
        right.set_axis_off()
        return
    bins_us = np.linspace(-widest_us, widest_us, BINS + 1)
    right.hist(jitter_us, bins=bins_us.tolist(), orientation="horizontal", color=COUNTED)
    right.set_xscale("log")
    right.set_xlim(left=0.7)
    right.set_ylim(-widest_us, widest_us)
    right.tick_params(labelleft=False)


def _summary(jitter_us: FloatArray, intervals_us: FloatArray) -> str:
    if jitter_us.size == 0:
        return "no interval to judge"
    rms_us, worst = float(np.sqrt(np.mean(jitter_us**2))), int(np.argmax(np.abs(jitter_us)))
    part = 100.0 * abs(jitter_us[worst]) / intervals_us[worst]
    return (
        f"{jitter_us.size} intervals, rms {rms_us:.3g} us, max {abs(jitter_us[worst]):.3g} us"
        f" = {part:.2g} % of an interval of {intervals_us[worst] / 1e3:.4g} ms"
    )
