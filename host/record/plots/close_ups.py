"""Draw a run around an instant: the pins of all axes, as a logic analyser does, or the phase currents."""

from dataclasses import replace
from itertools import groupby
from typing import Final

import numpy as np
from matplotlib.axes import Axes

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.plots.canvas import COUNTED, LIMIT, Sheet, room_for
from steptwin.host.record.plots.shown_run import PlotMoment, ShownRun, interval_around, pulse_times
from steptwin.host.record.waveforms import Signal, Window, whole_record, wires
from steptwin.host.verify import Comparison, Phases
from steptwin.host.verify.counted import CountedSteps
from steptwin.protocol.timer import COUNTS_PER_SECOND

EDGE_INTERVALS: Final = 12
_HIGH: Final = 0.6
"""Height of a high level, in lanes."""

_ALWAYS: Final = ("step", "dir")
_MARKED_MAX: Final = 200
"""Largest number of steps in view that are marked; more marks would merge into a band."""


def draw_edges(sheet: Sheet, shown: ShownRun) -> None:
    """Draw a lane for STEP and DIR of each axis and for every other pin that changes; mark the counted steps."""
    comparison, moment = shown.comparison, shown.moment(EDGE_INTERVALS)
    window = _window(comparison, moment)
    lanes = _lanes(comparison, window)
    names = [f"{signal.axis} {signal.quantity.upper()}" for signal in lanes]
    ((axes,),) = sheet.panels(
        1,
        what=f"{sheet.picture.title} around t = {moment.at_s:.6f} s",
        band_lines=1,
        heights_inches=[sheet.picture.row_inches * len(lanes)],
        left_inches=room_for(names),
        right_inches=1.2,
    )
    for lane, signal in enumerate(lanes):
        times_s, levels = _course(signal, window)
        axes.plot(moment.shown_ms(times_s), levels * _HIGH - lane, color=COUNTED, drawstyle="steps-post")
    firsts = [next(lane for lane, s in enumerate(lanes) if s.axis == name) for name in comparison.axis_names]
    counted = [_clocked(comparison, axis) for axis in range(len(firsts))]
    steps = [_mark_steps(axes, *each, moment) for each in zip(counted, firsts, strict=True)]
    _say_intervals(axes, comparison, firsts, moment)
    _finish_lanes(axes, lanes, moment)
    axes.set_yticks([_HIGH / 2 - lane for lane in range(len(lanes))], names)
    axes.set_xlabel(moment.label)
    sheet.write(_about_marks(steps))


def _window(comparison: Comparison, moment: PlotMoment) -> Window:
    """Return the part of the record to draw, rounded outwards to whole counts."""
    whole = whole_record(comparison.evidence)
    first, last = whole.counts(moment.from_s) - 1, whole.counts(moment.to_s) + 1
    return Window(max(first, whole.from_counts), last, comparison.evidence.start_counts)


def _lanes(comparison: Comparison, window: Window) -> list[Signal]:
    return [
        signal
        for signal in wires(comparison.evidence)
        if signal.quantity in _ALWAYS or signal.changes.between(window.from_counts, window.to_counts)[0].size
    ]


def _course(signal: Signal, window: Window) -> tuple[FloatArray, FloatArray]:
    """Return motion times and the level from each time on, over the whole window."""
    counts, levels = signal.changes.between(window.from_counts, window.to_counts)
    first = signal.changes.at(window.from_counts)
    counts = np.concatenate([[window.from_counts], counts, [window.to_counts]])
    levels = np.concatenate([[first], levels, levels[-1:] if levels.size else [first]])
    return (counts - window.start_counts) / COUNTS_PER_SECOND, levels.astype(np.float64)


def _clocked(comparison: Comparison, axis: int) -> CountedSteps:
    """Return an axis' counted steps at their clock time, like edges, whatever the motion's speed."""
    evidence, counted = comparison.evidence, comparison.counted[axis]
    steps = evidence.axes[axis].step_counts
    counts = steps[steps.size - counted.signs.size :]
    return replace(counted, time_s=(counts - evidence.start_counts) / COUNTS_PER_SECOND)


def _mark_steps(axes: Axes, counted: CountedSteps, lane: int, moment: PlotMoment) -> int:
    """Mark each counted step by a triangle up or down, unless there are too many; return the number of steps."""
    first, last = np.searchsorted(counted.time_s, (moment.from_s, moment.to_s)).tolist()
    times_ms = moment.shown_ms(counted.time_s[first:last])
    if last - first <= _MARKED_MAX:
        for sign, marker in ((1, "^"), (-1, "v")):
            chosen = times_ms[counted.signs[first:last] == sign]
            axes.plot(chosen, np.full(chosen.size, _HIGH + 0.15 - lane), marker, color=LIMIT, markersize=3.5)
    return int(last - first)


def _about_marks(steps: list[int]) -> str:
    """Return a text that explains the triangles, or why steps have none."""
    if not any(steps):
        return "no driver counted a step here"
    if all(count == 0 or count > _MARKED_MAX for count in steps):
        return f"steps are too many to be marked, above {_MARKED_MAX} an axis"
    beyond = f", where at most {_MARKED_MAX}" if max(steps) > _MARKED_MAX else ""
    return f"triangles: steps that the driver counted, up or down{beyond}"


def _say_intervals(axes: Axes, comparison: Comparison, lanes: list[int], moment: PlotMoment) -> None:
    """Write at the right of each axis the interval between the two STEP pulses around the middle."""
    intervals_s = [interval_around(pulse_times(comparison, i), moment.at_s) for i in range(len(lanes))]
    said = [(lane, interval_s) for lane, interval_s in zip(lanes, intervals_s, strict=True) if interval_s is not None]
    for lane, interval_s in said:
        text = f"{1e6 * interval_s:.2f} us"
        axes.text(1.01, _HIGH / 2 - lane, text, transform=axes.get_yaxis_transform(), va="center")
    if said:
        axes.text(1.01, 1.0, "STEP interval at 0", transform=axes.transAxes, va="center", size=9)


def _finish_lanes(axes: Axes, lanes: list[Signal], moment: PlotMoment) -> None:
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(-len(lanes) + 0.8, 1.0)
    axes.grid(visible=False, axis="y")
    lane = 0
    for n, (_, group) in enumerate(groupby(lanes, key=lambda signal: signal.axis)):
        count = len(list(group))
        if n % 2:
            axes.axhspan(0.85 - lane, 0.85 - lane - count, color="0.95", zorder=0)
        lane += count
    axes.axvline(0.0, color="0.4", linestyle=":", linewidth=0.8)
    axes.set_xlim(*moment.shown_ms(np.array([moment.from_s, moment.to_s])))


INTERVALS: Final = 160
"""Two and a half turns of the field at 1/16 step."""
_ROOM: Final = 1.15
_LEAST_A: Final = 0.1
"""Half the height of the picture if no current flows."""


def draw_phases(sheet: Sheet, shown: ShownRun) -> None:
    """Draw a row for each moving axis: B over A for the whole run at the left, A and B over time at the right."""
    comparison, moving, moment = shown.comparison, shown.moving, shown.moment(INTERVALS)
    what = f"{sheet.picture.title} around t = {moment.at_s:.6f} s"
    rows = sheet.panels(len(moving), what=what, note=shown.still, band_lines=1, share="column")
    peak_a = _ROOM * max([_LEAST_A, *(_peak_a(comparison.evidence.axes[i].phases) for i in moving)])
    for (left, right), i in zip(rows, moving, strict=False):
        phases = comparison.evidence.axes[i].phases
        _draw_field(left, phases)
        _draw_currents(right, phases, moment, comparison.evidence.start_counts)
        left.set_ylabel(f"{comparison.axis_names[i]} [A]")
        for axes in (left, right):
            axes.set_ylim(-peak_a, peak_a)
    rows[0][0].set_xlim(-peak_a, peak_a)
    rows[-1][1].set_xlabel(moment.label)
    power_up_s = -comparison.evidence.start_counts / COUNTS_PER_SECOND  # the record begins at power-up
    rows[-1][1].set_xlim(*moment.shown_ms(np.array([max(moment.from_s, power_up_s), moment.to_s])))
    if moving:
        sheet.legend(rows[0][1], 2)


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
