"""Draw the timing of steps: lateness of edges, jitter of intervals, and durations of the chips' CLK.

Lateness and jitter refer to the ideal crossings. Limits and durations refer to the same signal, CLK, whichever edge of
the board's STEP the driver counts.
"""

from itertools import groupby
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.plots.canvas import COUNTED, LIMIT, Sheet, thinned
from steptwin.host.record.plots.shown_run import ShownRun
from steptwin.host.verify import AxisEvidence, Comparison
from steptwin.host.verify.counted import clk_durations
from steptwin.host.verify.matching import MICROSECONDS, SLOW_CROSSING
from steptwin.protocol.drivers import ActiveEdge
from steptwin.protocol.timer import COUNTS_PER_SECOND, COUNTS_PER_US

LATENESS_BINS_PER_DECADE = 16
LINEAR_US = 1e6 / COUNTS_PER_SECOND
"""One count of the board's timer: the smallest possible error. The time axis is linear up to one count and logarithmic
beyond. So the histograms of fast and slow axes have a shape on the same time axis, in spite of the few late edges near
a reversal.
"""
LINEAR_DECADES = 0.5
"""Width of the linear part on each side, in decades."""


def draw_timing(sheet: Sheet, shown: ShownRun) -> None:
    """Draw a row for each moving axis, all with the same bins, equally wide on the time axis."""
    comparison, moving = shown.comparison, shown.moving
    rows = [row[0] for row in sheet.panels(len(moving), note=shown.still)]
    late_us = [comparison.timing_errors_us(i) for i in moving]
    bins_us = _lateness_bins_us(max([0.0, *(float(np.abs(late).max()) for late in late_us if late.size)]))
    for axes, i, late in zip(rows, moving, late_us, strict=False):
        _draw_lateness(axes, late, bins_us)
        sheet.label(axes, comparison.axis_names[i], "edges")
    rows[-1].set_xscale("symlog", linthresh=LINEAR_US, linscale=LINEAR_DECADES)
    rows[-1].set_xlim(bins_us[0], bins_us[-1])


def _lateness_bins_us(widest_us: float) -> FloatArray:
    """Return bin borders on both sides of zero, from the linear part to `widest_us`."""
    decades = np.log10(max(widest_us / LINEAR_US, 1.0))
    bins = int(decades * LATENESS_BINS_PER_DECADE) + 1
    beyond_us = LINEAR_US * 10.0 ** (np.arange(1, bins + 1) / LATENESS_BINS_PER_DECADE)
    linear = int(LINEAR_DECADES * LATENESS_BINS_PER_DECADE)
    positive_us = np.concatenate([LINEAR_US / linear * np.arange(1, linear + 1), beyond_us])
    return np.concatenate([-positive_us[::-1], [0.0], positive_us])


def _draw_lateness(axes: Axes, late_us: FloatArray, bins_us: FloatArray) -> None:
    axes.set_title(_lateness_summary(late_us), loc="right", size=9.5)
    if late_us.size:
        axes.stairs(*np.histogram(late_us, bins_us), fill=True, color=COUNTED)
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.7)


def _lateness_summary(late_us: FloatArray) -> str:
    if late_us.size == 0:
        return "no edge to judge"
    p50, p99, worst = np.percentile(np.abs(late_us), [50, 99, 100])
    return f"{late_us.size} edges, |error|: median {p50:.3g}, 99 % {p99:.3g}, max {worst:.3g} us"


BINS = 81
SMALLEST_RANGE_US = 0.02
"""A little more than one count of the board's timer, the smallest possible jitter."""


def draw_jitter(sheet: Sheet, shown: ShownRun) -> None:
    """Draw a row for each moving axis: jitter over time, and its histogram beside it."""
    rows = sheet.panels(len(shown.moving), note=shown.still, share="column", apart_inches=0.4)
    for (left, right), i in zip(rows, shown.moving, strict=False):
        sheet.label(left, shown.comparison.axis_names[i], "us")
        _draw_jitter(left, right, *_jitter(shown.comparison, i))
    rows[-1][0].set_xlim(0.0, shown.end_s)


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


def _draw_jitter(left: Axes, right: Axes, t_s: FloatArray, jitter_us: FloatArray, intervals_us: FloatArray) -> None:
    left.set_title(_jitter_summary(jitter_us, intervals_us), loc="right", size=9.5)
    widest_us = 1.05 * max(SMALLEST_RANGE_US, float(np.abs(jitter_us).max(initial=0.0)))
    left.plot(*thinned(t_s, jitter_us), color=COUNTED, linestyle="none", marker=".", markersize=1.5)
    left.set_ylim(-widest_us, widest_us)
    if jitter_us.size == 0:
        right.set_axis_off()
        return
    bins_us = np.linspace(-widest_us, widest_us, BINS + 1)
    right.stairs(*np.histogram(jitter_us, bins_us), orientation="horizontal", fill=True, color=COUNTED)
    right.set_xscale("log")
    right.set_xlim(left=0.7)
    right.set_ylim(-widest_us, widest_us)
    right.tick_params(labelleft=False)


def _jitter_summary(jitter_us: FloatArray, intervals_us: FloatArray) -> str:
    if jitter_us.size == 0:
        return "no interval to judge"
    rms_us, worst = float(np.sqrt(np.mean(jitter_us**2))), int(np.argmax(np.abs(jitter_us)))
    part = 100.0 * abs(jitter_us[worst]) / intervals_us[worst]
    return (
        f"{jitter_us.size} intervals, rms {rms_us:.3g} us, max {abs(jitter_us[worst]):.3g} us"
        f" = {part:.2g} % of {intervals_us[worst] / 1e3:.4g} ms"
    )


WIDTH_BINS_PER_DECADE: Final = 40
_ROOM: Final = 1.4
"""Factor by which the picture extends beyond the least and the greatest duration."""
_LABEL_PART: Final = 0.02
"""Width of a limit's label, relative to the picture; closer limits share a label."""

_EDGES: Final = {ActiveEdge.RISING: "rises", ActiveEdge.FALLING: "falls"}


class _Durations(NamedTuple):
    """One kind of duration of one axis, and its driver's minimum; None without a limit."""

    name: str
    us: FloatArray
    limit_us: float | None
    style: dict[str, Any]


def draw_widths(sheet: Sheet, shown: ShownRun) -> None:
    """Draw a row for each moving axis over the same durations; dashed lines are limits, below them pulses get lost."""
    moving = [shown.comparison.evidence.axes[i] for i in shown.moving]
    rows = [row[0] for row in sheet.panels(len(moving), note=shown.still, band_lines=1)]
    durations = [_durations(axis) for axis in moving]
    bins_us = _duration_bins_us([one for of_axis in durations for one in of_axis])
    for axes, of_axis, axis in zip(rows, durations, moving, strict=False):
        _draw_durations(axes, of_axis, bins_us)
        sheet.label(axes, axis.name, "times")
    if moving:
        sheet.legend(rows[0], 4)
        rows[-1].set_xlim(bins_us[0], bins_us[-1])
    rows[-1].set_xlabel(f"duration [us]{_where_clk_rises(moving)}")


def _where_clk_rises(axes: list[AxisEvidence]) -> str:
    edges = sorted({_EDGES[axis.active_edge] for axis in axes})
    return f"; a driver's CLK rises where the board's STEP {' or '.join(edges)}" if edges else ""


def _durations(axis: AxisEvidence) -> list[_Durations]:
    clk = clk_durations(axis)
    kinds: list[tuple[str, str, Any, dict[str, Any]]] = [
        ("clk_high", "high", clk.high_counts, {"color": COUNTED, "fill": True}),
        ("clk_low", "low", clk.low_counts, {"color": "0.75", "fill": True}),
        ("clk_period", "rise to rise", clk.period_counts, {"color": "black", "linewidth": 0.8}),
    ]
    return [
        _Durations(name, counts / COUNTS_PER_US, _limit_us(axis, rule), style) for rule, name, counts, style in kinds
    ]


def _limit_us(axis: AxisEvidence, rule: str) -> float | None:
    """Return the strictest limit of module and chip. A limit of one count is left out: no level is shorter."""
    limits_us = [limit.limit for limit in axis.violations.limits if limit.rule == rule]
    return max((limit_us for limit_us in limits_us if round(limit_us * COUNTS_PER_US) > 1), default=None)


def _duration_bins_us(shown: list[_Durations]) -> FloatArray:
    limits_us = np.array([one.limit_us for one in shown if one.limit_us is not None])
    every = np.concatenate([limits_us, *(one.us for one in shown)])
    every = every[every > 0.0]
    if every.size == 0:
        return np.array([1.0, 10.0])
    first_us, last_us = every.min() / _ROOM, every.max() * _ROOM
    return np.geomspace(first_us, last_us, int(WIDTH_BINS_PER_DECADE * np.log10(last_us / first_us)) + 2)


def _draw_durations(axes: Axes, of_axis: list[_Durations], bins_us: FloatArray) -> None:
    for one in of_axis:
        axes.stairs(*np.histogram(one.us, bins_us), label=one.name, **one.style)
    _draw_duration_limits(axes, of_axis, float(np.log(bins_us[-1] / bins_us[0])))
    axes.set_xscale("log")
    if any(one.us.size for one in of_axis):
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.7)
    axes.set_title("; ".join(filter(None, map(_margin, of_axis))), loc="right", size=9.5)


def _draw_duration_limits(axes: Axes, of_axis: list[_Durations], width_log: float) -> None:
    """Draw a line for each limit; close limits share a label, with a line of text for each."""
    limits = sorted((one.limit_us, one.name) for one in of_axis if one.limit_us is not None)
    for limit_us, _ in limits:
        axes.axvline(limit_us, color=LIMIT, linestyle="--", linewidth=0.9)
    starts = np.cumsum(np.diff(np.log([us for us, _ in limits]), prepend=-np.inf) > _LABEL_PART * width_log)
    for _, group in groupby(zip(starts, limits, strict=True), key=lambda item: item[0]):
        together = [limit for _, limit in group]
        label = "\n".join(f"{name} {limit_us:.4g} " for limit_us, name in together)
        text = axes.text(together[0][0], 0.97, label, transform=axes.get_xaxis_transform())
        text.set(rotation=90, ha="right", va="top", size=9, color=LIMIT)


def _margin(one: _Durations) -> str:
    """Return the shortest duration as text, with its distance from the limit."""
    if one.us.size == 0:
        return ""
    least_us = float(one.us.min())
    said = f"{one.name} >= {least_us:.2f} us"
    if one.limit_us is None:
        return said
    return f"{said}, {abs(least_us - one.limit_us):.2f} {'above' if least_us >= one.limit_us else 'below'} its limit"
