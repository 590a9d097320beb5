"""Draw counted minus planned: a lane for each moving axis, in steps, then those of the tool, in mm and degrees."""

from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
from matplotlib.axes import Axes

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.plots.canvas import (
    COLUMNS,
    COUNTED,
    LANE_HIGH,
    LIMIT,
    NO_MOTION,
    Sheet,
    envelope,
    make_lanes,
    room_for,
    write_inside,
)
from steptwin.host.record.plots.shown_run import ErrorSeries, ShownRun

CLOSE_EDGES: Final = 5
"""Number of edges that the close view shows on each side of the largest error."""
SPARSE_EDGES: Final = COLUMNS // 4
"""Greatest number of edges in the whole motion that are drawn one by one."""
LEAST_ERROR: Final = 1e-4
"""Least height of a lane in steps, mm or deg; in a smaller one rounding would look like an error."""
ROOM: Final = 1.08
"""Height of a lane, relative to its content."""


def draw_error(sheet: Sheet, shown: ShownRun) -> None:
    """Draw the whole motion at the left, with the limits of axes, and the largest error close up at the right."""
    comparison, moving = shown.comparison, shown.moving
    series = [*shown.axis_errors, *shown.other_errors]
    limits = [comparison.gates.position_limit_steps(comparison.expected.microsteps_of(axis)) for axis in moving]
    said = " or ".join(f"{limit:g}" for limit in sorted(set(limits)))
    whole, close_up = sheet.picture.heads
    heads = (f"{whole}; dashed: limit of {said} steps" if moving else whole, close_up)
    labels = [f"{one.name}\n{np.abs(one.values).max():.3g} {one.unit}" for one in series]
    ((left, right),) = sheet.panels(
        1,
        heads=heads,
        note=shown.still,
        heights_inches=[sheet.picture.row_inches * max(len(series), 1)],
        left_inches=room_for(labels),
        apart_inches=0.3,
        share="none",
    )
    make_lanes(left, labels)
    make_lanes(right, [""] * len(series))
    zeros, dashed = list[float](), list[float]()
    for number, one in enumerate(series):
        limit = limits[number] if number < len(moving) else 0.0
        lane = _Lane.around(number, one, limit)
        _draw_whole(left, one, lane, shown.end_s)
        _draw_close(right, one, lane)
        zeros.append(lane.up(0.0))
        dashed += [lane.up(-limit), lane.up(limit)] if limit else []
    for axes in (left, right):
        across = axes.get_yaxis_transform()
        axes.hlines(zeros, 0.0, 1.0, transform=across, color="0.7", linewidth=0.6, zorder=0.5)
        axes.hlines(dashed, 0.0, 1.0, transform=across, color=LIMIT, linestyle="--", linewidth=0.9)
    left.set_xlim(0.0, shown.end_s)
    right.set_xlim(-1.0, 1.0)
    right.set_xticks([])
    if not series:
        write_inside(left, NO_MOTION)


@dataclass(frozen=True, slots=True)
class _Lane:
    """A lane with its least and greatest value."""

    number: int
    least: float
    most: float

    @classmethod
    def around(cls, number: int, series: ErrorSeries, limit: float) -> Self:
        """Return a lane with room for all values, 0, and both limits."""
        least, most = min(0.0, -limit, float(series.values.min())), max(0.0, limit, float(series.values.max()))
        room = max(ROOM * (most - least), LEAST_ERROR)
        return cls(number, (least + most - room) / 2, (least + most + room) / 2)

    def up(self, values: FloatArray | float) -> Any:
        """Return the vertical positions of values."""
        return LANE_HIGH * (np.asarray(values) - self.least) / (self.most - self.least) - self.number


def _draw_whole(axes: Axes, series: ErrorSeries, lane: _Lane, end_s: float) -> None:
    """Draw the error as a line, or its least and greatest values if most columns of pixels have edges."""
    if series.edges.size <= SPARSE_EDGES:
        _draw_line(axes, series.t_s, lane.up(series.values))
        return
    t_s, lows, highs = envelope(series.t_s, series.values, max(end_s, float(series.t_s[-1])))
    axes.fill_between(t_s, lane.up(lows), lane.up(highs), color=COUNTED, alpha=0.15, linewidth=0.0)
    for extremes in (lows, highs):
        axes.plot(t_s, lane.up(extremes), color=COUNTED, linewidth=0.8)


def _draw_close(axes: Axes, series: ErrorSeries, lane: _Lane) -> None:
    """Draw the few edges around the largest error, where single steps are visible, as wide as the panel."""
    worst = int(np.abs(series.values).max(axis=0).argmax())
    edges = series.edges
    near = int(np.searchsorted(edges, worst))
    close = edges[max(near - CLOSE_EDGES, 0) : near + CLOSE_EDGES + 1]
    if close.size == 0:
        axes.text(0.0, LANE_HIGH / 2 - lane.number, "no step counted", ha="center", va="center")
        return
    part = slice(max(min(int(close[0]), worst) - 1, 0), max(int(close[-1]), worst) + 2)
    since_s = series.t_s[part] - series.t_s[worst]
    half_s = float(np.abs(since_s).max()) or 1.0
    _draw_line(axes, since_s / half_s, lane.up(series.values[:, part]))
    said = f"{series.t_s[worst]:.4f} s ± {1e3 * half_s:.4g} ms"
    axes.text(0.0, LANE_HIGH + 0.03 - lane.number, said, ha="center", va="bottom", size=10)


def _draw_line(axes: Axes, times: FloatArray, values: FloatArray) -> None:
    """Draw a step function that jumps at each instant."""
    axes.plot(np.repeat(times, 2), values.T.ravel(), color=COUNTED, linewidth=0.9)
