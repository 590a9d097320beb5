"""Draw every moving joint: planned position, speed and acceleration, step rates, and counted minus planned.

The error is in steps; that of the tool, in millimetres and degrees, stands below.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.record.plots.canvas import (
    COLUMNS,
    COUNTED,
    LIMIT,
    PLANNED,
    around,
    drawn_instants,
    envelope,
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
from steptwin.host.verify.deviation import ToolDeviation, deviations

_ANGLES: Final = {"scara": "attitude", "direction": "direction", "position": ""}
"""The angle by which a tool is turned from its plan, by its task; a tool without an orientation is never turned."""

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
    axes.set_ylabel(f"{comparison.axis_names[i]} [steps/s]")


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
    edges_s = evidence.rates.trajectory_s(evidence.dir_edge_counts, comparison.evidence.start_counts)
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
    moving = [i for i in moving_axes(comparison) if i < len(comparison.joint_names)]
    figure = new_figure(run, "planned joint motion", ROW_INCHES * max(len(moving), 1))
    note_still_axes(figure, comparison, moving_axes(comparison))
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


ERROR_ROW_INCHES = 1.45
WIDTH_RATIOS = (3.0, 1.0)
CLOSE_EDGES = 5
"""Number of edges that the close view shows on each side of the largest error."""
SPARSE_EDGES = COLUMNS // 4
"""Greatest number of edges in the whole motion that are drawn one by one."""


@dataclass(frozen=True, slots=True)
class _Series:
    """An error with its name and unit: t_s of shape (n,), values just before and after t_s of shape (2, n)."""

    label: str
    t_s: FloatArray
    values: FloatArray

    @property
    def edges(self) -> Int64Array:
        """Indexes of the instants when the error jumps, because a step was counted."""
        return np.flatnonzero(self.values[0] != self.values[1])


def draw_error(comparison: Comparison, run: RunInfo) -> Figure:
    """Draw a row for each moving axis, with the limit, then the tool's; at the right the largest error close up."""
    moving = moving_axes(comparison)
    series = _all_series(comparison, moving)
    figure = new_figure(run, "counted minus planned", ERROR_ROW_INCHES * len(series))
    ratios = WIDTH_RATIOS if any(one.edges.size for one in series) else WIDTH_RATIOS[:1]
    rows = figure.subplots(len(series), len(ratios), squeeze=False, width_ratios=ratios)
    end_s = comparison.expected.trajectory.duration_s
    limits_steps = [comparison.gates.position_limit_steps(comparison.expected.microsteps_of(axis)) for axis in moving]
    for n, (row, one) in enumerate(zip(rows, series, strict=True)):
        _draw_whole(row[0], one, end_s)
        for right in row[1:]:
            _draw_close(right, one)
        if n < len(moving):
            _draw_error_limits(row, limits_steps[n])
        row[0].tick_params(labelbottom=n == len(series) - 1)
    for right in rows[0][1:]:
        right.set_title("the largest, close up", loc="left")
    limits = " or ".join(f"{limit:g}" for limit in sorted(set(limits_steps)))
    dashed = f"; dashed: limit of {limits} steps" if moving else ""
    rows[0][0].set_title(f"whole motion{dashed}", loc="left")
    rows[-1][0].set_xlabel("time [s]")
    note_still_axes(figure, comparison, moving)
    return figure


def _all_series(comparison: Comparison, moving: list[int]) -> list[_Series]:
    t_s = drawn_instants(comparison)
    parts = list(deviations(comparison, t_s))
    steps = np.concatenate([part.steps for part in parts], axis=1)
    axes = [_Series(f"{comparison.axis_names[i]} [steps]", t_s, steps[..., i]) for i in moving]
    skews = np.concatenate([part.skews for part in parts], axis=1)
    seconds = comparison.axis_names[len(comparison.joint_names) :]
    units = (comparison.expected.joint_units[joint] for joint in comparison.expected.coupling.seconds)
    apart = [
        _Series(f"{name} ahead [{unit}]", t_s, skews[..., i])
        for i, (name, unit) in enumerate(zip(seconds, units, strict=True))
    ]
    angle = _ANGLES.get(comparison.expected.task.name, "orientation")
    tools = _tool_series("", angle, t_s, [part.tool for part in parts])
    return [*axes, *apart, *tools, *_tool_series("actual ", angle, t_s, [part.actual_tool for part in parts])]


def _tool_series(which: str, angle: str, t_s: FloatArray, chunks: list[ToolDeviation | None]) -> list[_Series]:
    """Return the errors of a tool, without that of an angle of no name; nothing without a tool."""
    parts = [part for part in chunks if part is not None]
    if not parts:
        return []
    distance_mm = np.concatenate([part.distance_mm for part in parts], axis=1)
    place = _Series(f"{which}tool [mm]", t_s, distance_mm)
    if not angle:
        return [place]
    turned_deg = np.concatenate([part.attitude_deg for part in parts], axis=1)
    return [place, _Series(f"{which}{angle} [deg]", t_s, turned_deg)]


def _draw_whole(axes: Axes, series: _Series, end_s: float) -> None:
    """Draw the error as a line; if that had edges in most columns of pixels, its least and greatest values instead."""
    end_s = max(end_s, series.t_s[-1])
    if series.edges.size <= SPARSE_EDGES:
        _draw_line(axes, series.t_s, series.values)
    else:
        t_s, lows, highs = envelope(series.t_s, series.values, end_s)
        axes.fill_between(t_s, lows, highs, color=COUNTED, alpha=0.15, linewidth=0.0)
        for extremes in (lows, highs):
            axes.plot(t_s, extremes, color=COUNTED, linewidth=0.7)
    axes.set_xlim(0.0, end_s)
    axes.set_ylabel(series.label)


def _draw_close(axes: Axes, series: _Series) -> None:
    """Draw the few edges around the largest error, where single steps are visible."""
    worst = int(np.abs(series.values).max(axis=0).argmax())
    edges = series.edges
    near = int(np.searchsorted(edges, worst))
    close = edges[max(near - CLOSE_EDGES, 0) : near + CLOSE_EDGES + 1]
    if close.size == 0:
        axes.set_axis_off()
        write_inside(axes, "no step counted")
        return
    part = slice(max(min(int(close[0]), worst) - 1, 0), max(int(close[-1]), worst) + 2)
    t_ms = 1e3 * (series.t_s[part] - series.t_s[worst])
    _draw_line(axes, t_ms, series.values[:, part])
    axes.locator_params(axis="x", nbins=5)
    axes.set_xlabel(around(series.t_s[worst]), size=8)


def _draw_line(axes: Axes, times: FloatArray, values: FloatArray) -> None:
    """Draw a line that jumps at each instant from the value before it to the value after it."""
    axes.plot(np.repeat(times, 2), values.T.ravel(), color=COUNTED, linewidth=0.9)


def _draw_error_limits(row: Iterable[Axes], limit_steps: float) -> None:
    for axes in row:
        for limit in (-limit_steps, limit_steps):
            if axes.axison:
                axes.axhline(limit, color=LIMIT, linestyle="--", linewidth=0.8)
