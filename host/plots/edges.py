"""The pins of all axes around an instant, as a logic analyser shows them."""

from itertools import groupby
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from host.plots.canvas import COUNTED, LIMIT, new_figure
from host.plots.moment import Moment, View
from host.trajectory import FloatArray
from host.verify import COUNTS_PER_SECOND, Comparison, RunInfo
from host.waveforms import Signal, Window, whole_record, wires

LANE_INCHES: Final = 0.3
INTERVALS: Final = 12
_HIGH: Final = 0.6
"""How high a level is drawn, in lanes."""

_ALWAYS: Final = ("step", "dir")
_MARKED_MAX: Final = 200
"""With more steps in view their marks would be a band."""


def draw_edges(comparison: Comparison, run: RunInfo, view: View) -> Figure:
    """A lane for STEP and DIR of each axis and for every other pin that changes; marks where drivers counted a step."""
    moment = view.moment(comparison, INTERVALS)
    window = _window(comparison, moment)
    lanes = _lanes(comparison, window)
    figure = new_figure(run, f"pins around t = {moment.at_s:.6f} s", LANE_INCHES * len(lanes) + 0.4)
    axes = figure.subplots()
    for lane, signal in enumerate(lanes):
        times_s, levels = _course(signal, window)
        axes.plot(_shown_ms(times_s, moment), levels * _HIGH - lane, color=COUNTED, drawstyle="steps-post")
    for i, evidence in enumerate(comparison.evidence.axes):
        lane = next(lane for lane, signal in enumerate(lanes) if signal.axis == evidence.name)
        _mark_steps(axes, comparison, i, lane, moment)
    _finish(axes, lanes, moment)
    return figure


def _window(comparison: Comparison, moment: Moment) -> Window:
    """What there is of the part that is shown."""
    whole = whole_record(comparison.evidence)
    return Window(
        max(whole.counts(moment.from_s), whole.from_counts), whole.counts(moment.to_s), comparison.evidence.start_counts
    )


def _lanes(comparison: Comparison, window: Window) -> list[Signal]:
    return [
        signal
        for signal in wires(comparison.evidence)
        if signal.what in _ALWAYS or signal.changes.between(window.from_counts, window.to_counts)[0].size
    ]


def _course(signal: Signal, window: Window) -> tuple[FloatArray, FloatArray]:
    """Times of the motion and levels from each of them on, from one end of the window to the other."""
    counts, levels = signal.changes.between(window.from_counts, window.to_counts)
    first = signal.changes.at(window.from_counts)
    counts = np.concatenate([[window.from_counts], counts, [window.to_counts]])
    levels = np.concatenate([[first], levels, levels[-1:] if levels.size else [first]])
    return (counts - window.start_counts) / COUNTS_PER_SECOND, levels.astype(np.float64)


def _mark_steps(axes: Axes, comparison: Comparison, i: int, lane: int, moment: Moment) -> None:
    """A triangle up or down above each counted step, and at the right how long the interval in the middle is."""
    counted = comparison.counted[i]
    first, last = np.searchsorted(counted.time_s, (moment.from_s, moment.to_s)).tolist()
    times_ms = _shown_ms(counted.time_s[first:last], moment)
    if last - first <= _MARKED_MAX:
        for sign, marker in ((1, "^"), (-1, "v")):
            chosen = times_ms[counted.signs[first:last] == sign]
            axes.plot(chosen, np.full(chosen.size, _HIGH + 0.15 - lane), marker, color=LIMIT, markersize=3.5)
    middle = int(np.searchsorted(counted.time_s, moment.at_s))
    if 0 < middle < counted.time_s.size:
        interval_us = 1e6 * (counted.time_s[middle] - counted.time_s[middle - 1])
        axes.text(1.01, _HIGH / 2 - lane, f"{interval_us:.2f} us", transform=axes.get_yaxis_transform(), va="center")


def _finish(axes: Axes, lanes: list[Signal], moment: Moment) -> None:
    axes.set_yticks([_HIGH / 2 - lane for lane in range(len(lanes))], [f"{s.axis} {s.what.upper()}" for s in lanes])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(-len(lanes) + 0.8, 1.0)
    axes.grid(visible=False, axis="y")
    lane = 0
    for n, (_, group) in enumerate(groupby(lanes, key=lambda signal: signal.axis)):
        count = len(list(group))
        if n % 2:
            axes.axhspan(0.85 - lane, 0.85 - lane - count, color="0.95", zorder=0)
        lane += count
    axes.axvline(0.0, color="0.4", linestyle=":", linewidth=0.8)
    axes.set_xlim(*_shown_ms(np.array([moment.from_s, moment.to_s]), moment))
    axes.set_xlabel(f"time from t = {moment.at_s:.6f} s [ms]; triangles: steps that the driver counted, up or down")
    axes.text(1.01, 1.0, "step interval at 0", transform=axes.transAxes, va="center", size=8)


def _shown_ms(times_s: FloatArray, moment: Moment) -> FloatArray:
    shown: FloatArray = 1e3 * (times_s - moment.at_s)
    return shown
