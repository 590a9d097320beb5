"""Draw every moving joint: planned position, speed and acceleration; and the rates of its steps."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.motion import Motion
from steptwin.host.record.plots.canvas import COUNTED, LIMIT, PLANNED, Sheet, thinned, write_inside
from steptwin.host.record.plots.shown_run import ShownRun, accepted_rates, planned_rates
from steptwin.host.robots.joint import Joint
from steptwin.host.verify import Comparison

DIR_INCHES: Final = 0.35


def draw_step_rates(sheet: Sheet, shown: ShownRun) -> None:
    """Draw two rows for each moving axis: the rate, and DIR below it."""
    moving, comparison = shown.moving, shown.comparison
    heights = [sheet.picture.row_inches, DIR_INCHES] * len(moving)
    rows = sheet.panels(2 * len(moving), note=shown.still, band_lines=1, heights_inches=heights)
    rates_hz = planned_rates(comparison, shown.planned_s)
    for n, i in enumerate(moving):
        axes = rows[2 * n][0]
        axes.plot(shown.planned_s, rates_hz[:, i], color=PLANNED, linewidth=4, label="planned")
        axes.plot(
            *thinned(*accepted_rates(comparison, i)),
            color=COUNTED,
            linestyle="none",
            marker=".",
            markersize=1.5,
            label="accepted: 1 / interval",
        )
        axes.set_ylim(bottom=0.0)
        sheet.label(axes, comparison.axis_names[i], "steps/s")
        _draw_dir(rows[2 * n + 1][0], comparison, i)
    if moving:
        sheet.legend(rows[0][0], 2)
    rows[-1][0].set_xlim(left=0.0)


def _draw_dir(axes: Axes, comparison: Comparison, i: int) -> None:
    evidence = comparison.evidence.axes[i]
    axes.set_ylabel("DIR", rotation=0, ha="right", va="center")
    axes.set_yticks([0, 1])
    axes.set_ylim(-0.3, 1.3)
    if len(evidence.dir_levels) == 0:
        write_inside(axes, "no change", color="0.4")
        return
    end_s = comparison.expected.motion.duration_s
    edges_s = evidence.rates.trajectory_s(evidence.dir_edge_counts, comparison.evidence.start_counts)
    levels = np.concatenate(([1 - evidence.dir_levels[0]], evidence.dir_levels, evidence.dir_levels[-1:]))
    t_s = np.concatenate(([min(0.0, edges_s[0])], edges_s, [max(end_s, edges_s[-1])]))
    axes.step(t_s, levels, where="post", color=COUNTED)


NEAR: Final = 1.0
"""Largest distance of a drawn limit, relative to the curve's height. A farther one would flatten the curve,
and is a number in the panel's title only.
"""

HALF_S: Final = 0.5e-3
"""Half the averaging time of mean accelerations, as in the planner's check of its limit."""


def draw_joints(sheet: Sheet, shown: ShownRun) -> None:
    """Draw a row for each moving joint: position, speed and acceleration, from left to right."""
    comparison, t_s = shown.comparison, shown.planned_s
    motion, robot = comparison.expected.motion, comparison.expected.robot
    moving = [i for i in shown.moving if i < len(comparison.joint_names)]
    rows = sheet.panels(len(moving), note=shown.still)
    columns = (motion.positions(t_s), motion.velocities(t_s), mean_accelerations(motion, t_s))
    for row, i in zip(rows, moving, strict=False):
        unit = comparison.expected.joint_units[i]
        limits = _limits(robot.joints[i]) if robot else (None, None, None)
        for axes, values, own_limits in zip(row, columns, limits, strict=True):
            _draw(axes, t_s, values[:, i], own_limits, is_rate=axes is not row[0])
        sheet.label(row[0], comparison.joint_names[i], unit)
        for axes, per in zip(row[1:], ("/s", "/s^2"), strict=True):
            axes.set_ylabel(f"[{unit}{per}]")
    rows[-1][0].set_xlim(0.0, shown.end_s)


def mean_accelerations(motion: Motion, t_s: FloatArray) -> FloatArray:
    """Return the joints' mean accelerations over the millisecond around each instant, shape (n, joints).

    At both ends it is the half millisecond within the motion.
    """
    before_s, after_s = np.clip([t_s - HALF_S, t_s + HALF_S], 0.0, motion.duration_s)
    changes = motion.velocities(after_s) - motion.velocities(before_s)
    return np.asarray(changes / (after_s - before_s)[:, np.newaxis])


def _limits(joint: Joint) -> tuple[tuple[float, float], ...]:
    """Return the lower and the upper limit of position, speed and acceleration."""
    fastest, steepest = joint.speed_max, joint.acceleration_max
    return (joint.lower, joint.upper), (-fastest, fastest), (-steepest, steepest)


def _draw(
    axes: Axes, t_s: FloatArray, values: FloatArray, limits: tuple[float, float] | None, *, is_rate: bool
) -> None:
    """Draw a quantity of one joint, with its near limits; speeds and accelerations also show 0."""
    axes.plot(t_s, values, color=COUNTED)
    if is_rate:
        axes.axhline(0.0, color="0.5", linewidth=0.6)
    if limits is None:
        return
    lower, upper = limits
    text = f"limit ±{upper:g}" if lower == -upper else f"limits {lower:g}, {upper:g}"
    axes.set_title(text, loc="right", size=9.5, color=LIMIT)
    height = float(np.ptp([*values, 0.0] if is_rate else values))
    for limit in limits:
        if np.abs(values - limit).min() <= NEAR * height:
            axes.axhline(limit, color=LIMIT, linestyle="--", linewidth=0.8)
