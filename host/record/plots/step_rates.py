"""Draw the step rate of every moving axis, planned and accepted by its driver, above its DIR pin."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.plots.canvas import (
    COUNTED,
    PLANNED,
    moving_axes,
    new_figure,
    note_still_axes,
    planned_instants,
    rows_of_axes,
    thinned,
    write_inside,
)
from steptwin.host.verify import Comparison, RunInfo
from steptwin.protocol.timer import COUNTS_PER_SECOND

RATE_INCHES = 1.5
DIR_INCHES = 0.35


def draw_step_rates(comparison: Comparison, run: RunInfo) -> Figure:
    """Draw two rows for each moving axis: the rate, and DIR below it."""
    moving = moving_axes(comparison)
    count = max(len(moving), 1)
    figure = new_figure(run, "step rates", (RATE_INCHES + DIR_INCHES) * count)
    rows = rows_of_axes(figure, 2 * len(moving), height_ratios=[RATE_INCHES, DIR_INCHES] * len(moving) or None)
    for n, i in enumerate(moving):
        _draw_rate(rows[2 * n][0], comparison, i)
        _draw_dir(rows[2 * n + 1][0], comparison, i)
    if moving:
        rows[0][0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0, ncols=2)
    rows[-1][0].set_xlabel("time [s]")
    rows[-1][0].set_xlim(left=0.0)
    note_still_axes(figure, comparison, moving)
    return figure


def _draw_rate(axes: Axes, comparison: Comparison, i: int) -> None:
    t_s = planned_instants(comparison)
    rates_hz = comparison.expected.axis_steps(comparison.expected.trajectory.velocities(t_s))[:, i]
    axes.plot(t_s, np.abs(rates_hz), color=PLANNED, linewidth=4, label="planned")
    axes.plot(
        *thinned(*_accepted_rates(comparison, i)),
        color=COUNTED,
        linestyle="none",
        marker=".",
        markersize=1.5,
        label="accepted: 1 / interval",
    )
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel(f"{comparison.joint_names[i]} [steps/s]")


def _accepted_rates(comparison: Comparison, i: int) -> tuple[FloatArray, FloatArray]:
    """Return middle and inverse of every interval between two successive steps of one direction."""
    counted = comparison.counted[i]
    same_way = counted.signs[1:] == counted.signs[:-1]
    t_s = (counted.time_s[1:] + counted.time_s[:-1])[same_way] / 2.0
    return t_s, 1.0 / np.diff(counted.time_s)[same_way]


def _draw_dir(axes: Axes, comparison: Comparison, i: int) -> None:
    evidence = comparison.evidence.axes[i]
    axes.set_ylabel("DIR", rotation=0, ha="right", va="center")
    axes.set_yticks([0, 1])
    axes.set_ylim(-0.3, 1.3)
    if len(evidence.dir_levels) == 0:
        write_inside(axes, "no change", color="0.4")
        return
    end_s = comparison.expected.trajectory.duration_s
    edges_s = (evidence.dir_edge_counts - comparison.evidence.start_counts) / COUNTS_PER_SECOND
    levels = np.concatenate(([1 - evidence.dir_levels[0]], evidence.dir_levels, evidence.dir_levels[-1:]))
    t_s = np.concatenate(([min(0.0, edges_s[0])], edges_s, [max(end_s, edges_s[-1])]))
    axes.step(t_s, levels, where="post", color=COUNTED)
