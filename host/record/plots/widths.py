"""Draw how long the chips' CLK is high, is low, and takes from rise to rise, beside the drivers' limits.

Limits and durations refer to the same signal, CLK, whichever edge of the board's STEP the driver counts.
"""

from itertools import groupby
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.plots.canvas import COUNTED, LIMIT, moving_axes, new_figure, note_still_axes, rows_of_axes
from steptwin.host.robots.board_settings import ActiveEdge
from steptwin.host.verify import AxisEvidence, Comparison, RunInfo
from steptwin.host.verify.pulses import clk_durations
from steptwin.protocol.timer import COUNTS_PER_US

ROW_INCHES: Final = 1.6
BINS_PER_DECADE: Final = 40
_ROOM: Final = 1.4
"""Factor by which the picture extends beyond the least and the greatest duration."""
_LABEL_PART: Final = 0.02
"""Width of a limit's label, as a fraction of the picture; limits nearer to each other share a label."""

_EDGES: Final = {ActiveEdge.RISING: "rises", ActiveEdge.FALLING: "falls"}


class _Durations(NamedTuple):
    """One kind of duration of one axis, and its driver's least duration; None without a limit."""

    name: str
    us: FloatArray
    limit_us: float | None
    style: dict[str, Any]


def draw_widths(comparison: Comparison, run: RunInfo) -> Figure:
    """Draw a row for each moving axis over the same durations; dashed lines are limits, below which pulses get lost."""
    moving = moving_axes(comparison)
    figure = new_figure(run, "CLK against the drivers' limits", ROW_INCHES * max(len(moving), 1))
    rows = [row[0] for row in rows_of_axes(figure, len(moving))]
    axes_shown = [comparison.evidence.axes[i] for i in moving]
    shown = [_durations(axis) for axis in axes_shown]
    bins_us = _bins_us([one for of_axis in shown for one in of_axis])
    for axes, of_axis, axis in zip(rows, shown, axes_shown, strict=False):
        _draw(axes, of_axis, bins_us)
        axes.set_ylabel(f"{axis.name} [times]")
    if moving:
        figure.legend(*rows[0].get_legend_handles_labels(), loc="outside upper right", ncols=4)
        rows[-1].set_xlim(bins_us[0], bins_us[-1])
    rows[-1].set_xlabel(f"duration [us]{_where_clk_rises(axes_shown)}")
    note_still_axes(figure, comparison, moving)
    return figure


def _where_clk_rises(axes: list[AxisEvidence]) -> str:
    edges = sorted({_EDGES[axis.active_edge] for axis in axes})
    return f"; a driver's CLK rises where the board's STEP {' or '.join(edges)}" if edges else ""


def _durations(axis: AxisEvidence) -> list[_Durations]:
    clk = clk_durations(axis)
    kinds: list[tuple[str, str, Any, dict[str, Any]]] = [
        ("clk_high", "high", clk.high_counts, {"color": COUNTED}),
        ("clk_low", "low", clk.low_counts, {"color": "0.75"}),
        ("clk_period", "rise to rise", clk.period_counts, {"color": "black", "histtype": "step", "linewidth": 0.8}),
    ]
    return [
        _Durations(name, counts / COUNTS_PER_US, _limit_us(axis, rule), style) for rule, name, counts, style in kinds
    ]


def _limit_us(axis: AxisEvidence, rule: str) -> float | None:
    """Return the strictest limit of module and chip. A limit of one count is left out: no level on a pin is shorter."""
    limits_us = [limit.limit for limit in axis.violations.limits if limit.rule == rule]
    return max((limit_us for limit_us in limits_us if round(limit_us * COUNTS_PER_US) > 1), default=None)


def _bins_us(shown: list[_Durations]) -> FloatArray:
    limits_us = np.array([one.limit_us for one in shown if one.limit_us is not None])
    every = np.concatenate([limits_us, *(one.us for one in shown)])
    every = every[every > 0.0]
    if every.size == 0:
        return np.array([1.0, 10.0])
    first_us, last_us = every.min() / _ROOM, every.max() * _ROOM
    return np.geomspace(first_us, last_us, int(BINS_PER_DECADE * np.log10(last_us / first_us)) + 2)


def _draw(axes: Axes, of_axis: list[_Durations], bins_us: FloatArray) -> None:
    for one in of_axis:
        axes.hist(one.us, bins=bins_us.tolist(), label=one.name, **one.style)
    _draw_limits(axes, of_axis, float(np.log(bins_us[-1] / bins_us[0])))
    axes.set_xscale("log")
    if any(one.us.size for one in of_axis):
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.7)
    axes.set_title("; ".join(filter(None, map(_margin, of_axis))), loc="right", size=8)


def _draw_limits(axes: Axes, of_axis: list[_Durations], width_log: float) -> None:
    """Draw a line for each limit; limits too near to each other share a label, with a line of text for each."""
    limits = sorted((one.limit_us, one.name) for one in of_axis if one.limit_us is not None)
    for limit_us, _ in limits:
        axes.axvline(limit_us, color=LIMIT, linestyle="--", linewidth=0.9)
    starts = np.cumsum(np.diff(np.log([us for us, _ in limits]), prepend=-np.inf) > _LABEL_PART * width_log)
    for _, group in groupby(zip(starts, limits, strict=True), key=lambda item: item[0]):
        together = [limit for _, limit in group]
        label = "\n".join(f"{name} {limit_us:.4g} " for limit_us, name in together)
        text = axes.text(together[0][0], 0.97, label, transform=axes.get_xaxis_transform())
        text.set(rotation=90, ha="right", va="top", size=7, color=LIMIT)


def _margin(one: _Durations) -> str:
    """Return the shortest duration in words, and its distance from the limit."""
    if one.us.size == 0:
        return ""
    least_us = float(one.us.min())
    said = f"{one.name} >= {least_us:.2f} us"
    if one.limit_us is None:
        return said
    return f"{said}, {abs(least_us - one.limit_us):.2f} {'above' if least_us >= one.limit_us else 'below'} its limit"
