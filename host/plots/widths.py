"""How long CLK is high and low, and how far its rises are apart, beside what the drivers ask for."""

from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from host.plots.canvas import COUNTED, LIMIT, moving_axes, new_figure, note_still_axes, rows_of_axes
from host.trajectory import FloatArray
from host.verify import COUNTS_PER_SECOND, AxisEvidence, Comparison, RunInfo

ROW_INCHES: Final = 1.6
BINS_PER_DECADE: Final = 40
_COUNTS_PER_US: Final = COUNTS_PER_SECOND / 1e6
_ROOM: Final = 1.4
"""How far the picture goes beyond the least and the greatest duration, as a factor."""


class _Durations(NamedTuple):
    """One kind of duration of one axis, and what its driver asks for."""

    name: str
    us: FloatArray
    limits_us: list[float]
    style: dict[str, Any]


def draw_widths(comparison: Comparison, run: RunInfo) -> Figure:
    """One row an axis, all over the same durations; dashed, the driver's limits: below them pulses get lost."""
    moving = moving_axes(comparison)
    figure = new_figure(run, "CLK against the drivers' limits", ROW_INCHES * max(len(moving), 1))
    rows = [row[0] for row in rows_of_axes(figure, len(moving))]
    shown = [_durations(comparison.evidence.axes[i]) for i in moving]
    bins_us = _bins_us([one for of_axis in shown for one in of_axis])
    for axes, of_axis, i in zip(rows, shown, moving, strict=False):
        _draw(axes, of_axis, bins_us)
        axes.set_ylabel(f"{comparison.joint_names[i]} [times]")
    if moving:
        figure.legend(*rows[0].get_legend_handles_labels(), loc="outside upper right", ncols=4)
        rows[-1].set_xlim(bins_us[0], bins_us[-1])
    rows[-1].set_xlabel("duration [us]")
    note_still_axes(figure, comparison, moving)
    return figure


def _durations(axis: AxisEvidence) -> list[_Durations]:
    rises, falls = axis.clk_rise_counts, axis.clk_fall_counts
    kinds: list[tuple[str, str, Any, dict[str, Any]]] = [
        ("clk_high", "high", falls - rises, {"color": COUNTED}),
        ("clk_low", "low", rises[1:] - falls[:-1], {"color": "0.75"}),
        ("clk_period", "rise to rise", np.diff(rises), {"color": "black", "histtype": "step", "linewidth": 0.8}),
    ]
    return [
        _Durations(name, counts / _COUNTS_PER_US, _limits_us(axis, rule), style) for rule, name, counts, style in kinds
    ]


def _limits_us(axis: AxisEvidence, rule: str) -> list[float]:
    """Those that ask for something: a module of wires lists limits of 0."""
    return [limit.limit for limit in axis.violations.limits if limit.rule == rule and limit.limit > 0.0]


def _bins_us(shown: list[_Durations]) -> FloatArray:
    every = np.concatenate([np.empty(0), *(np.append(one.us, one.limits_us) for one in shown)])
    every = every[every > 0.0]
    if every.size == 0:
        return np.array([1.0, 10.0])
    first_us, last_us = every.min() / _ROOM, every.max() * _ROOM
    return np.geomspace(first_us, last_us, int(BINS_PER_DECADE * np.log10(last_us / first_us)) + 2)


def _draw(axes: Axes, of_axis: list[_Durations], bins_us: FloatArray) -> None:
    for one in of_axis:
        axes.hist(one.us, bins=bins_us.tolist(), label=one.name, **one.style)
        for limit_us in one.limits_us:
            axes.axvline(limit_us, color=LIMIT, linestyle="--", linewidth=0.9)
            _name_limit(axes, one.name, limit_us)
    axes.set_xscale("log")
    if any(one.us.size for one in of_axis):
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.7)
    axes.set_title("; ".join(filter(None, map(_margins, of_axis))), loc="right", size=8)


def _name_limit(axes: Axes, name: str, limit_us: float) -> None:
    text = axes.text(limit_us, 0.97, f"{name} {limit_us:.4g} ", transform=axes.get_xaxis_transform())
    text.set(rotation=90, ha="right", va="top", size=7, color=LIMIT)


def _margins(one: _Durations) -> str:
    """The shortest of them, and how far that is from the limits."""
    if one.us.size == 0:
        return ""
    least_us = float(one.us.min())
    apart = [
        f", {abs(least_us - limit):.2f} {'above' if least_us >= limit else 'below'} its limit"
        for limit in one.limits_us
    ]
    return f"{one.name} >= {least_us:.2f} us{''.join(apart)}"
