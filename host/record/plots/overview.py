"""Draw a run at a glance: the verdict in words, the arm and its tool's path, the error, and the rates of the steps."""

import textwrap
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes

from steptwin.host.record.path_error import path_error
from steptwin.host.record.plots.canvas import (
    COUNTED,
    LANE_HIGH,
    LEFT_INCHES,
    LIMIT,
    PLANNED,
    Sheet,
    envelope,
    make_lanes,
    room_for,
    thinned,
)
from steptwin.host.record.plots.shown_run import ShownRun, accepted_rates, planned_rates
from steptwin.host.record.plots.tool_path import draw_arm_and_path
from steptwin.host.record.verdict_words import verdict_words

PASSED: Final = "#1b6e3a"
PATH_INCHES: Final = 3.9
ERROR_INCHES: Final = 1.4
LANE_INCHES: Final = 0.42
"""Height of an axis' rates."""
_POINTS: Final = 700
"""Number of groups of intervals drawn for each axis."""

_WORDS_CHARS: Final = 78
_REASONS_MAX: Final = 4


def draw_overview(sheet: Sheet, shown: ShownRun) -> None:
    """Draw panels below each other; a machine without a tool has no path."""
    comparison = shown.comparison
    verdict, *reasons = verdict_words(shown.document)
    words = [line for reason in reasons[:_REASONS_MAX] for line in textwrap.wrap(reason, _WORDS_CHARS)]
    if len(reasons) > _REASONS_MAX:
        words.append(f"and {len(reasons) - _REASONS_MAX} more, in report.json")
    words += _figures(shown.document)
    lanes = max(len(shown.moving), 1)
    heights = [PATH_INCHES] * bool(comparison.expected.task.width) + [ERROR_INCHES, LANE_INCHES * lanes]
    names = [comparison.axis_names[i] for i in shown.moving]
    rows = sheet.panels(len(heights), note=shown.still, band_lines=1 + len(words), heights_inches=heights, share="none",
                        left_inches=max(LEFT_INCHES, room_for(names)), right_inches=1.15)  # fmt: skip
    sheet.write(verdict, size=20, weight="bold", color=PASSED if verdict == "PASSED" else LIMIT)
    sheet.write("\n".join(words), below_inches=0.42)
    *path, error, rates = (row[0] for row in rows)
    for axes in path:
        _draw_path(axes, shown)
    _draw_error(error, shown)
    _draw_rates(rates, shown)
    for axes in (error, rates):
        axes.set_xlim(0.0, shown.end_s)
        axes.set_xlabel("time [s]")


def _figures(document: Mapping[str, Any]) -> list[str]:
    """Return the figures of a report as text; empty for a machine that has not moved."""
    moving = [axis for axis in document.get("axes", ()) if axis["pulses"]]
    if not moving:
        return []
    pulses = sum(axis["pulses"] for axis in moving)
    steps = max(axis["position_error_steps_max"] for axis in moving)
    late_us = max(axis["timing_error_us_p99"] for axis in moving)
    words = [f"{pulses:,} pulses; counted minus planned: at most {steps:.3g} steps, 99 % within {late_us:.3g} us"]
    if tool := document.get("tool"):
        far_mm, off_deg = tool["position_error_mm_max"], tool["attitude_error_deg_max"]
        words.append(f"tool: at most {far_mm:.3g} mm and {off_deg:.3g} deg from the plan")
    return words


def _draw_path(axes: Axes, shown: ShownRun) -> None:
    draw_arm_and_path(axes, shown.comparison, path_error(shown.comparison, shown.planned_s))
    axes.set_title("tool path, true to scale", loc="left", weight="bold")
    axes.set_xlabel(f"{axes.get_xlabel()}; ● start, ■ end; dashed: arm at the end")


def _draw_error(axes: Axes, shown: ShownRun) -> None:
    """Draw the tool's distance from its plan; without a tool, the largest error of all axes, with its limit."""
    comparison = shown.comparison
    tool = next((each for each in shown.other_errors if each.name == "tool"), None)
    if tool:
        title, unit, t_s, values = "tool error: counted minus planned", "mm", tool.t_s, tool.values
    elif shown.axis_errors:
        title, unit, t_s = "largest error of all axes", "steps", shown.axis_errors[0].t_s
        values = np.max([np.abs(each.values) for each in shown.axis_errors], axis=0)
        limit = max(comparison.gates.position_limit_steps(comparison.expected.microsteps_of(i)) for i in shown.moving)
        axes.axhline(limit, color=LIMIT, linestyle="--", linewidth=1.0)
        title += f"; dashed: limit of {limit:g} steps"
    else:
        title, unit, t_s, values = "no joint moves", "steps", shown.planned_s, np.zeros_like(shown.planned_s)
    middle_s, _, highs = envelope(t_s, values, max(shown.end_s, float(t_s[-1])))
    axes.fill_between(middle_s, highs, color=COUNTED, alpha=0.2, linewidth=0.0)
    axes.plot(middle_s, highs, color=COUNTED)
    axes.set_ylim(0.0, max(1.1 * float(highs.max()), 1e-3, axes.get_ylim()[1] if not tool else 0.0))
    axes.set_title(title, loc="left", weight="bold")
    axes.set_ylabel(f"[{unit}]")


def _draw_rates(axes: Axes, shown: ShownRun) -> None:
    """Draw a lane for each moving axis, scaled to its own greatest rate, which is written beside it."""
    comparison, moving = shown.comparison, shown.moving
    planned = planned_rates(comparison, shown.planned_s)
    for lane, i in enumerate(moving):
        t_s, accepted = thinned(*accepted_rates(comparison, i), groups=_POINTS)
        peak = max(float(planned[:, i].max()), float(accepted.max(initial=0.0)), 1e-9)
        axes.plot(shown.planned_s, LANE_HIGH * planned[:, i] / peak - lane, color=PLANNED, linewidth=3.5)
        axes.plot(t_s, LANE_HIGH * accepted / peak - lane, ".", color=COUNTED, markersize=2.0)
        axes.text(1.01, 0.4 - lane, f"{peak:,.0f}/s", transform=axes.get_yaxis_transform(), va="center")
    make_lanes(axes, [comparison.axis_names[i] for i in moving])
    axes.set_title("step rates: planned (grey), accepted (dots), greatest (right)", loc="left", weight="bold")
