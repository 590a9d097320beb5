"""Draw planned position, speed and acceleration of every moving joint, beside their limits."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.record.plots.canvas import (
    COUNTED,
    LIMIT,
    PLANNED,
    moving_axes,
    new_figure,
    note_still_axes,
    planned_instants,
    rows_of_axes,
    thinned,
    write_inside,
)
from steptwin.host.robots.joint import Joint
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


ROW_INCHES = 1.6

NEAR: Final = 1.0
"""Greatest distance of a limit, as a multiple of the curve's height, where it is drawn: a farther one would flatten
the curve, and stands as a number in the panel's title only."""

HALF_S: Final = 0.5e-3
"""Half the time over which a mean acceleration is taken, as the planner takes it to compare it with its limit."""


@dataclass(frozen=True, slots=True)
class _Curve:
    """A quantity of one joint over time, of shape (n,), with its unit and, of a known robot, its limits."""

    values: FloatArray
    unit: str
    limits: tuple[float, float] | None

    @property
    def is_rate(self) -> bool:
        """True for a speed or an acceleration, whose sign is a direction."""
        return "/s" in self.unit

    @property
    def height(self) -> float:
        """Extent of the panel: of the values, and of 0 for a speed or an acceleration."""
        return float(np.ptp([*self.values, 0.0] if self.is_rate else self.values))


def draw_joints(comparison: Comparison, run: RunInfo) -> Figure:
    """Draw a row for each moving joint: position, speed and acceleration, from left to right."""
    moving = moving_axes(comparison)
    figure = new_figure(run, "planned joint motion", ROW_INCHES * max(len(moving), 1))
    rows = rows_of_axes(figure, len(moving), 3)
    t_s = planned_instants(comparison)
    trajectory, robot = comparison.expected.trajectory, comparison.expected.robot
    motion = (trajectory.positions(t_s), trajectory.velocities(t_s), mean_accelerations(trajectory, t_s))
    for row, i in zip(rows, moving, strict=False):
        unit = comparison.expected.joint_units[i]
        limits = _limits(robot.joints[i]) if robot else (None, None, None)
        units = (unit, f"{unit}/s", f"{unit}/s^2")
        for axes, values, own_unit, own_limits in zip(row, motion, units, limits, strict=True):
            _draw(axes, t_s, _Curve(values[:, i], own_unit, own_limits))
        row[0].set_ylabel(f"{comparison.joint_names[i]} [{unit}]")
    for axes, what in zip(rows[0], ("position", "speed", "acceleration"), strict=True):
        axes.set_title(what, loc="left")
    for axes in rows[-1]:
        axes.set_xlabel("time [s]")
        axes.set_xlim(0.0, t_s[-1])
    note_still_axes(figure, comparison, moving)
    return figure


def mean_accelerations(trajectory: Trajectory, t_s: FloatArray) -> FloatArray:
    """Return the joints' mean accelerations over the millisecond around each instant, shape (n, joints).

    At both ends it is the half millisecond within the motion.
    """
    before_s, after_s = np.clip([t_s - HALF_S, t_s + HALF_S], 0.0, trajectory.duration_s)
    changes = trajectory.velocities(after_s) - trajectory.velocities(before_s)
    return np.asarray(changes / (after_s - before_s)[:, np.newaxis])


def _limits(joint: Joint) -> tuple[tuple[float, float], ...]:
    """Return the lower and the upper limit of position, speed and acceleration."""
    fastest, steepest = joint.speed_max, joint.acceleration_max
    return (joint.lower, joint.upper), (-fastest, fastest), (-steepest, steepest)


def _draw(axes: Axes, t_s: FloatArray, curve: _Curve) -> None:
    axes.plot(t_s, curve.values, color=COUNTED)
    axes.set_ylabel(f"[{curve.unit}]")
    if curve.is_rate:
        axes.axhline(0.0, color="0.5", linewidth=0.6)
    if curve.limits is None:
        return
    lower, upper = curve.limits
    text = f"limit ±{upper:g}" if lower == -upper else f"limits {lower:g}, {upper:g}"
    axes.set_title(text, loc="right", size=7, color=LIMIT)
    for limit in curve.limits:
        if np.abs(curve.values - limit).min() <= NEAR * curve.height:
            axes.axhline(limit, color=LIMIT, linestyle="--", linewidth=0.8)
