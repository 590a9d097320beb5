"""A run prepared for pictures: moving axes, errors over time, and the part for close-ups."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.record.plots.picture import PlotView
from steptwin.host.verify import Comparison
from steptwin.host.verify.deviation import ToolDeviation, critical_instants, deviations
from steptwin.protocol.timer import COUNTS_PER_SECOND

SAMPLES: Final = 2001
"""Number of instants when planned curves are drawn."""

_ANGLES: Final = {"scara": "attitude", "direction": "direction", "position": ""}
"""Angle of the tool's error, by its task; a tool without an orientation has none."""


@dataclass(frozen=True, slots=True)
class PlotMoment:
    """An instant in motion time and the span shown around it, half of the span on each side."""

    at_s: float
    span_s: float

    @property
    def from_s(self) -> float:
        """Start of the span."""
        return self.at_s - self.span_s / 2.0

    @property
    def to_s(self) -> float:
        """End of the span."""
        return self.at_s + self.span_s / 2.0

    @property
    def label(self) -> str:
        """Label of the axis of `shown_ms`."""
        return around(self.at_s, decimals=6)

    def shown_ms(self, times_s: FloatArray) -> FloatArray:
        """Return motion times in milliseconds relative to the instant."""
        shown: FloatArray = 1e3 * (times_s - self.at_s)
        return shown


def around(at_s: float, decimals: int = 4) -> str:
    """Return the label of a time axis in milliseconds around an instant."""
    return f"around t = {at_s:.{decimals}f} s, in ms"


@dataclass(frozen=True, slots=True)
class ErrorSeries:
    """An error with name and unit: t_s of shape (n,), values just before and after t_s of shape (2, n)."""

    name: str
    unit: str
    t_s: FloatArray
    values: FloatArray

    @property
    def edges(self) -> Int64Array:
        """Indexes of the instants with a jump of the error at a counted step."""
        return np.flatnonzero(self.values[0] != self.values[1])


@dataclass(frozen=True)
class ShownRun:
    """A run and the part to draw.

    Attributes:
        comparison: plan and evidence.
        document: the run's report.json.
        view: the part that close-ups show.
    """

    comparison: Comparison
    document: Mapping[str, Any]
    view: PlotView

    @cached_property
    def moving(self) -> list[int]:
        """Axes with planned or made pulses."""
        return [
            i
            for i, evidence in enumerate(self.comparison.evidence.axes)
            if len(self.comparison.ideal[i].signs) or len(evidence.clk_rise_counts)
        ]

    @cached_property
    def still(self) -> str:
        """A note with the axes without motion and their positions; empty if all move."""
        expected = self.comparison.expected
        positions = expected.motion.positions(np.zeros(1))[0]
        joint_of, units = expected.coupling.joint_of, expected.joint_units
        still = [
            f"{name} at {positions[joint_of(i)]:g} {units[joint_of(i)]}"
            for i, name in enumerate(self.comparison.axis_names)
            if i not in self.moving
        ]
        return f"Not shown, because without motion: {', '.join(still)}" if still else ""

    @cached_property
    def end_s(self) -> float:
        """End of the planned motion."""
        return self.comparison.expected.motion.duration_s

    @cached_property
    def planned_s(self) -> FloatArray:
        """Evenly spaced instants over the whole motion."""
        return np.linspace(0.0, self.end_s, SAMPLES)

    @cached_property
    def drawn_s(self) -> FloatArray:
        """All instants with a possible maximum of an error, and enough others for the curve between."""
        return np.union1d(critical_instants(self.comparison), self.planned_s)

    @cached_property
    def axis_errors(self) -> list[ErrorSeries]:
        """The error of each moving axis."""
        return self._errors[0]

    @cached_property
    def other_errors(self) -> list[ErrorSeries]:
        """The errors of second motors against the first ones, then those of the tool and of the actual tool."""
        return self._errors[1]

    @cached_property
    def _errors(self) -> tuple[list[ErrorSeries], list[ErrorSeries]]:
        comparison, t_s = self.comparison, self.drawn_s
        parts = list(deviations(comparison, t_s))
        steps = np.concatenate([part.steps for part in parts], axis=1)
        axes = [ErrorSeries(comparison.axis_names[i], "steps", t_s, steps[..., i]) for i in self.moving]
        skews = np.concatenate([part.skews for part in parts], axis=1)
        seconds = comparison.axis_names[len(comparison.joint_names) :]
        units = (comparison.expected.joint_units[joint] for joint in comparison.expected.coupling.seconds)
        apart = [
            ErrorSeries(f"{name} ahead", unit, t_s, skews[..., i])
            for i, (name, unit) in enumerate(zip(seconds, units, strict=True))
        ]
        angle = _ANGLES.get(comparison.expected.task.name, "orientation")
        tools = _tool_series("", angle, t_s, [part.tool for part in parts])
        return axes, [*apart, *tools, *_tool_series("actual ", angle, t_s, [part.actual_tool for part in parts])]

    def moment(self, intervals: int) -> PlotMoment:
        """Return the part to draw: by default `intervals` pulse intervals around the fastest pulses.

        Pulses count whether the driver accepts them or not. At a user's instant, the fastest axis determines the span,
        which is never longer than the whole motion.
        """
        at_s, span_s = self.view.at_s, self.view.span_s
        times = [pulse_times(self.comparison, i) for i in range(len(self.comparison.axis_names))]
        if at_s is None:
            found = [_shortest(self.comparison, i, times_s) for i, times_s in enumerate(times)]
            interval_s, at_s = min((each for each in found if each), default=(self.end_s, self.end_s / 2.0))
        else:
            firsts = [(times_s, _before(times_s, at_s)) for times_s in times if times_s.size > 1]
            interval_s = min((float(times_s[i + 1] - times_s[i]) for times_s, i in firsts), default=self.end_s)
        return PlotMoment(at_s, min(intervals * interval_s, self.end_s) if span_s is None else span_s)


def _tool_series(which: str, angle: str, t_s: FloatArray, chunks: list[ToolDeviation | None]) -> list[ErrorSeries]:
    """Return the errors of a tool, without an angle if `angle` is empty; none without a tool."""
    parts = [part for part in chunks if part is not None]
    if not parts:
        return []
    distance_mm = np.concatenate([part.distance_mm for part in parts], axis=1)
    place = ErrorSeries(f"{which}tool", "mm", t_s, distance_mm)
    if not angle:
        return [place]
    turned_deg = np.concatenate([part.attitude_deg for part in parts], axis=1)
    return [place, ErrorSeries(f"{which}{angle}", "deg", t_s, turned_deg)]


def pulse_times(comparison: Comparison, axis: int) -> FloatArray:
    """Return the times of STEP's rises from the motion's start on, whether the driver counted them or not."""
    rises = comparison.evidence.axes[axis].clk_rise_counts - comparison.evidence.start_counts
    times_s: FloatArray = rises[rises >= 0] / COUNTS_PER_SECOND
    return times_s


def interval_around(times_s: FloatArray, at_s: float) -> float | None:
    """Return the length of the interval around an instant; None before the first time and after the last."""
    after = int(np.searchsorted(times_s, at_s))
    return float(times_s[after] - times_s[after - 1]) if 0 < after < times_s.size else None


def _before(times_s: FloatArray, at_s: float) -> int:
    """Return the index of the last pulse before an instant that has a next one, or of the nearest such pulse."""
    return int(np.clip(np.searchsorted(times_s, at_s) - 1, 0, times_s.size - 2))


def _shortest(comparison: Comparison, axis: int, times_s: FloatArray) -> tuple[float, float] | None:
    """Return one axis' shortest interval between pulses without a change of DIR, and its middle."""
    turns_s = (comparison.evidence.axes[axis].dir_edge_counts - comparison.evidence.start_counts) / COUNTS_PER_SECOND
    same_way = np.flatnonzero(np.diff(np.searchsorted(turns_s, times_s)) == 0)
    if same_way.size == 0:
        return None
    intervals_s = np.diff(times_s)
    first = int(same_way[np.argmin(intervals_s[same_way])])
    return float(intervals_s[first]), float(times_s[first : first + 2].mean())


def accepted_rates(comparison: Comparison, axis: int) -> tuple[FloatArray, FloatArray]:
    """Return middle and inverse of each interval between two successive steps of one direction, in s and 1/s."""
    counted = comparison.counted[axis]
    same_way = counted.signs[1:] == counted.signs[:-1]
    t_s = (counted.time_s[1:] + counted.time_s[:-1])[same_way] / 2.0
    return t_s, 1.0 / np.diff(counted.time_s)[same_way]


def planned_rates(comparison: Comparison, t_s: FloatArray) -> FloatArray:
    """Return each axis' planned rate in steps/s at n instants, of shape (n, axes)."""
    return np.abs(comparison.expected.axis_steps(comparison.expected.motion.velocities(t_s)))
