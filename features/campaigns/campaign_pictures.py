"""Draw the results of a campaign: pass rates with their intervals, and margins over each varied parameter."""

import re
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.features.campaigns.margins import all_margins
from steptwin.features.campaigns.row import Row
from steptwin.features.campaigns.summary import PassRate, Summary
from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.record.plots.canvas import COUNTED, LIMIT, WIDTH_INCHES, save_figure

_ROW_INCHES: Final = 0.28
_RATES_MAX: Final = 5
"""Largest number of rates drawn of each group; the report lists all."""
_MARGIN_INCHES: Final = 1.7
_BINS: Final = 24
_POINTS_MAX: Final = 5000
"""Largest number of points for each margin; the line of least margins includes all runs."""
_BEYOND: Final = -1.0
"""Lowest margin on the axis, at twice the limit; runs below it are drawn there."""
_MANY_POINTS: Final = 300
_PARAMETERS_MAX: Final = 16
"""Largest number of parameters with a picture; those of most runs are drawn."""
_FEW_VALUES: Final = 8
"""Largest number of values that get a column each; more values share an axis."""
_COLUMN_HALF: Final = 0.3
"""Half the width of a column, relative to the distance of two."""
_HEAP_BELOW: Final = 5.0
"""Positive values get a logarithmic axis if half of them are below the greatest divided by this."""
_GOLDEN_RATIO: Final = (5.0**0.5 - 1.0) / 2.0
_LEAST_LABEL: Final = "least of all runs"
_LEAST_LINE: Final[Mapping[str, Any]] = {"color": "0.3", "linewidth": 1.0}
_NAME_CHARS_MAX: Final = 200
"""Longest part of a picture's name for a parameter; file names have up to 255 characters."""
_PICTURE_CHARS: Final = re.compile(r"[^A-Za-z0-9]+")


@dataclass(slots=True)
class _MarginSeries:
    """Values of a parameter and of each margin, run by run; NaN for a margin that a run does not have."""

    values: "array[float]" = field(default_factory=lambda: array("d"))
    margins: "dict[str, array[float]]" = field(default_factory=lambda: {name: array("d") for name in all_margins()})
    passed: "array[int]" = field(default_factory=lambda: array("b"))

    def add(self, value: float, row: Row) -> None:
        self.values.append(value)
        self.passed.append(row.passed)
        for name, margin in self.margins.items():
            margin.append(row.margins.get(name, float("nan")))


def draw_campaign(summary: Summary, rows: Callable[[], Iterable[Row]], title: str, folder: Path) -> list[str]:
    """Write the pictures into a folder; return their names. `rows` is called twice for all rows."""
    names = ["rates.png"]
    save_figure(_draw_rates(summary, title), folder / names[0], {})
    series = {parameter: _MarginSeries() for parameter in _shown(rows())}
    for row in rows():
        for parameter in series.keys() & row.parameters.keys():
            series[parameter].add(row.parameters[parameter], row)
    for parameter, each in series.items():
        names.append(f"margins-{_PICTURE_CHARS.sub('-', parameter).strip('-')[:_NAME_CHARS_MAX]}.png")
        save_figure(_draw_margins(parameter, each, title), folder / names[-1], {})
    return names


def _shown(rows: Iterable[Row]) -> list[str]:
    """Return the parameters to draw: the most frequent ones that vary and whose runs have a margin.

    A campaign has ten names of parameters for each of its scenarios, so little is kept of each.
    """
    runs: Counter[str] = Counter()
    first: dict[str, float] = {}
    varied, judged = set[str](), set[str]()
    for row in rows:
        runs.update(row.parameters)
        judged.update(row.parameters if row.margins else ())
        varied.update(name for name, value in row.parameters.items() if first.setdefault(name, value) != value)
    return [name for name, _ in runs.most_common() if name in varied & judged][:_PARAMETERS_MAX]


def _draw_rates(summary: Summary, title: str) -> Figure:
    """Draw a point with its interval for all runs, and for the least certain robots, motions, scenarios, invariants."""
    groups: list[tuple[str, Mapping[str, PassRate]]] = [
        ("", {"all runs": summary.all}),
        *((_titled(what, rates), _least_certain(rates)) for what, rates in summary.groups.items()),
        (_titled("invariants", summary.invariants), _least_certain(summary.invariants)),
    ]
    rows = sum(len(rates) for _, rates in groups)
    figure = Figure(figsize=(WIDTH_INCHES, 1.4 + _ROW_INCHES * (rows + len(groups))), layout="constrained")
    figure.suptitle(f"{title}: runs in which every invariant held, with intervals of 95 %", x=0.01, ha="left")
    grid = figure.subplots(
        len(groups), 1, sharex=True, squeeze=False, height_ratios=[len(rates) + 0.6 for _, rates in groups]
    )
    lowest = min(rate.interval[0] for _, rates in groups for rate in rates.values())
    for axes, (what, rates) in zip(grid[:, 0], groups, strict=True):
        _draw_group(axes, what, rates, lowest)
    grid[-1, 0].set_xlabel("part of the runs")
    return figure


def _least_certain(rates: Mapping[str, PassRate]) -> Mapping[str, PassRate]:
    """Return the rates whose intervals begin lowest, the lowest first."""
    return dict(sorted(rates.items(), key=lambda item: item[1].interval[0])[:_RATES_MAX])


def _titled(what: str, rates: Mapping[str, PassRate]) -> str:
    return what if len(rates) <= _RATES_MAX else f"{what}: the {_RATES_MAX} least certain of {len(rates)}"


def _draw_group(axes: Axes, what: str, rates: Mapping[str, PassRate], lowest: float) -> None:
    for place, rate in enumerate(rates.values()):
        lower, upper = rate.interval
        colour = COUNTED if rate.passed == rate.runs else LIMIT
        axes.plot([lower, upper], [place, place], color=colour, linewidth=2.0, alpha=0.5)
        axes.plot([rate.rate], [place], "o", color=colour, markersize=4)
        axes.text(1.01, place, f"{rate.passed:,}/{rate.runs:,}", transform=axes.get_yaxis_transform(), va="center")
    axes.set_yticks(range(len(rates)), list(rates))
    axes.set_ylim(len(rates) - 0.4, -0.6)
    axes.set_xlim(lowest - 0.02 * (1.0 - lowest), 1.0 + 0.02 * (1.0 - lowest))
    axes.grid(axis="x", color="0.9")
    if what:
        axes.set_title(what, loc="left", size=9)


def _draw_margins(parameter: str, series: _MarginSeries, title: str) -> Figure:
    """Draw each margin over a parameter: a point a run, and the least of all runs."""
    values, passed = np.array(series.values), np.array(series.passed, dtype=bool)
    known = {name: np.array(margin) for name, margin in series.margins.items() if not np.isnan(margin).all()}
    across = _across(values)
    figure = Figure(figsize=(WIDTH_INCHES, 0.9 + _MARGIN_INCHES * len(known)), layout="constrained")
    figure.suptitle(f"{title}: what was left to each limit, over {parameter}", x=0.01, ha="left")
    grid = figure.subplots(len(known), 1, sharex=True, squeeze=False)
    for axes, (name, margins) in zip(grid[:, 0], known.items(), strict=True):
        there = ~np.isnan(margins)
        beyond = np.count_nonzero(margins < _BEYOND)
        margin = np.maximum(margins, _BEYOND)
        across.prepare(axes)
        _draw_points(axes, across.places(values)[there], margin[there], passed[there])
        across.draw_least(axes, values[there], margin[there])
        axes.axhline(0.0, color=LIMIT, linestyle="--", linewidth=0.8)
        axes.set_ylabel(name)
        axes.set_ylim(max(min(0.0, float(margin[there].min())), _BEYOND) - 0.03, 1.03)
        said = f"{all_margins()[name].what}; {np.count_nonzero(there):,} runs"
        axes.set_title(said + (f", {beyond:,} below the lower edge" if beyond else ""), loc="left", size=8)
        axes.grid(color="0.9")
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=3, fontsize=8)
    grid[-1, 0].set_xlabel(parameter)
    return figure


def _draw_points(axes: Axes, places: FloatArray, margin: FloatArray, passed: BoolArray) -> None:
    thinned = slice(None, None, max(1, len(places) // _POINTS_MAX))
    size = 2.5 if len(places) > _MANY_POINTS else 6.0
    for which, colour, label in ((passed, COUNTED, "passed"), (~passed, LIMIT, "failed")):
        shown = which[thinned]
        x, y = places[thinned][shown], margin[thinned][shown]
        axes.plot(x, y, ".", color=colour, label=label, markersize=size, alpha=0.5)


class _Across(Protocol):
    """Layout of a parameter's values across a picture."""

    def prepare(self, axes: Axes) -> None:
        """Set the axis."""

    def places(self, values: FloatArray) -> FloatArray:
        """Return the positions of values."""

    def draw_least(self, axes: Axes, values: FloatArray, margin: FloatArray) -> None:
        """Draw the least margin of the runs."""


def _across(values: FloatArray) -> _Across:
    distinct = np.unique(values)
    return _Columns(distinct) if len(distinct) <= _FEW_VALUES else _Scale(over_decades(values))


@dataclass(frozen=True, slots=True)
class _Columns:
    """A column for each of a few values; its points are spread side by side."""

    values: FloatArray

    def prepare(self, axes: Axes) -> None:
        axes.set_xticks(range(len(self.values)), [f"{value:,.9g}" for value in self.values])
        axes.set_xlim(-0.5, len(self.values) - 0.5)

    def places(self, values: FloatArray) -> FloatArray:
        # Multiples of the golden ratio fill a column evenly, whatever the number of points.
        aside = np.arange(len(values)) * _GOLDEN_RATIO % 1.0
        return np.searchsorted(self.values, values) + _COLUMN_HALF * (2.0 * aside - 1.0)

    def draw_least(self, axes: Axes, values: FloatArray, margin: FloatArray) -> None:
        held, least = least_in_bins(values, margin)
        middles = np.searchsorted(self.values, held)
        axes.hlines(least, middles - _COLUMN_HALF, middles + _COLUMN_HALF, label=_LEAST_LABEL, **_LEAST_LINE)


@dataclass(frozen=True, slots=True)
class _Scale:
    """An axis of values, logarithmic if they span decades."""

    logarithmic: bool

    def prepare(self, axes: Axes) -> None:
        if self.logarithmic:
            axes.set_xscale("log")

    def places(self, values: FloatArray) -> FloatArray:
        return values

    def draw_least(self, axes: Axes, values: FloatArray, margin: FloatArray) -> None:
        held, least = least_in_bins(np.log10(values) if self.logarithmic else values, margin)
        middles = 10.0**held if self.logarithmic else held
        axes.plot(middles, least, drawstyle="steps-mid", label=_LEAST_LABEL, **_LEAST_LINE)


def over_decades(values: FloatArray) -> bool:
    """Return whether most values are so small that a linear axis would put them in one heap.

    Of values drawn with equal likelihood for each factor over two decades, half are below a tenth of the greatest.
    """
    return bool(values.min() > 0.0 and np.median(values) <= values.max() / _HEAP_BELOW)


def least_in_bins(values: FloatArray, margin: FloatArray, bins: int = _BINS) -> tuple[FloatArray, FloatArray]:
    """Return the least margin at each value, or in each of `bins` even bins if there are more values.

    Returns:
        The values, or the middles of the bins with any, and the least margins; both shape (n,), sorted by value.
    """
    distinct = np.unique(values)
    if len(distinct) <= bins:
        return distinct, np.array([margin[values == each].min() for each in distinct])
    borders = np.linspace(distinct[0], distinct[-1], bins + 1)
    number = np.clip(np.searchsorted(borders, values, side="right") - 1, 0, bins - 1)
    held = np.unique(number)
    return (borders[held] + borders[held + 1]) / 2, np.array([margin[number == each].min() for each in held])
