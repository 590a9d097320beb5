"""Draw the currents that the drivers regulate: B over A, which shows the field turn, and both over time."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.host.record.plots.canvas import (
    COUNTED,
    LIMIT,
    NO_MOTION,
    PlotMoment,
    PlotView,
    moving_axes,
    new_figure,
    note_still_axes,
    write_inside,
)
from steptwin.host.verify import Comparison, Phases, RunInfo
from steptwin.protocol.timer import COUNTS_PER_SECOND

ROW_INCHES: Final = 2.1
WIDTH_RATIOS: Final = (1.0, 4.0)
INTERVALS: Final = 160
"""Two and a half turns of the field at 1/16 step."""
_ROOM: Final = 1.15
_LEAST_A: Final = 0.1
"""Half the height of the picture if no current flows."""


def draw_phases(comparison: Comparison, run: RunInfo, view: PlotView) -> Figure:
    """Draw a row for each moving axis: B over A for the whole run at the left, A and B over time at the right."""
    moving = moving_axes(comparison)
    moment = view.moment(comparison, INTERVALS)
    count = max(len(moving), 1)
    figure = new_figure(run, f"phase currents around t = {moment.at_s:.6f} s", ROW_INCHES * count)
    rows = figure.subplots(count, 2, squeeze=False, width_ratios=WIDTH_RATIOS, sharex="col", sharey=True)
    if not moving:
        write_inside(rows[0, 1], NO_MOTION)
    for (left, right), i in zip(rows, moving, strict=False):
        phases = comparison.evidence.axes[i].phases
        _draw_field(left, phases)
        _draw_currents(right, phases, moment, comparison.evidence.start_counts)
        left.set_ylabel(f"{comparison.joint_names[i]} [A]")
        right.tick_params(labelleft=True)
    peak_a = _ROOM * max([_LEAST_A, *(_peak_a(comparison.evidence.axes[i].phases) for i in moving)])
    rows[0, 0].set_xlim(-peak_a, peak_a)
    rows[0, 0].set_ylim(-peak_a, peak_a)
    rows[0, 0].set_title("B over A, the whole run", loc="left")
    rows[-1, 0].set_xlabel("A [A]")
    rows[-1, 1].set_xlabel(moment.label)
    power_up_s = -comparison.evidence.start_counts / COUNTS_PER_SECOND  # the record begins at power-up
    rows[-1, 1].set_xlim(*moment.shown_ms(np.array([max(moment.from_s, power_up_s), moment.to_s])))
    if moving:
        figure.legend(*rows[0, 1].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    note_still_axes(figure, comparison, moving)
    return figure


def _peak_a(phases: Phases) -> float:
    return max(float(np.abs(values_ma).max(initial=0)) for values_ma in (phases.a_ma, phases.b_ma)) / 1e3


def _draw_field(axes: Axes, phases: Phases) -> None:
    """Draw every pair of currents that occurs."""
    pairs_a = np.unique(np.column_stack([phases.a_ma, phases.b_ma]), axis=0) / 1e3
    axes.plot(*pairs_a.T, color=COUNTED, linestyle="none", marker=".", markersize=4)
    axes.set_aspect("equal")


def _draw_currents(axes: Axes, phases: Phases, moment: PlotMoment, start_counts: int) -> None:
    times_s = (phases.counts - start_counts) / COUNTS_PER_SECOND
    first, last = np.searchsorted(times_s, (moment.from_s, moment.to_s), side="right").tolist()
    part = slice(max(first - 1, 0), last)
    shown_ms = moment.shown_ms(np.append(np.maximum(times_s[part], moment.from_s), moment.to_s))
    for name, values_ma, colour, dashes in (("A", phases.a_ma, COUNTED, "-"), ("B", phases.b_ma, LIMIT, "--")):
        values_a = values_ma[part] / 1e3
        course_a = np.append(values_a, values_a[-1:] if values_a.size else [0.0])
        axes.plot(shown_ms, course_a, color=colour, linestyle=dashes, drawstyle="steps-post", label=f"phase {name}")
    axes.axvline(0.0, color="0.4", linestyle=":", linewidth=0.8)
