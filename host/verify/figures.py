"""Declare the figures of an axis, each once: its meaning, computation, printing, repeated check and limit.

report.json, the printed verdict, the comparison of a stored report with its files, the margins of campaigns and the
table in docs/run-folder.md are made from `AxisReport`. Features declare their own figures in the same form.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final, Generic, NamedTuple, TypeVar, get_type_hints

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.features import features, giving, judge_of
from steptwin.host.robots.robot import Robot
from steptwin.host.verify.counted import CountedSteps, clk_durations
from steptwin.host.verify.evidence import AxisEvidence
from steptwin.host.verify.gates import threshold_tolerance_steps
from steptwin.protocol.timer import COUNTS_PER_US

Source = TypeVar("Source")


@dataclass(frozen=True, slots=True)
class FigureLimit:
    """Limit of a figure; campaigns record the margin to it.

    Attributes:
        name: name of the margin, for reports.
        says: figure and limit as text.
        of: returns the limit for an axis of a robot, by the axis' number.
    """

    name: str
    says: str
    of: Callable[[Robot, int], float]


@dataclass(frozen=True)  # no slots: until Python 3.12 `ReportFigure[...](...)` fails on a frozen class with slots
class ReportFigure(Generic[Source]):
    """A figure of an axis; the name of its declaration is its key in report.json.

    Attributes:
        says: its meaning.
        of: computes it.
        unit: its unit; empty for a text, or if `says` contains it.
        heading: heading of its column in the printed verdict, without the unit; empty if it has none.
        form: format of its cells.
        moving: True if its column has a dash for an axis with fewer than two steps.
        exact: True if it depends on the edges alone; verifying a stored run gives it to the last digit.
        limit: its limit; None if it has none, or if campaigns do not record the margin.
    """

    says: str
    of: Callable[[Source], Any]
    unit: str = ""
    heading: str = ""
    form: str = "{}"
    moving: bool = False
    exact: bool = False
    limit: FigureLimit | None = None

    @property
    def column(self) -> str:
        """Heading of its column, with the unit."""
        return f"{self.heading} {self.unit}".strip()


@dataclass(frozen=True, slots=True)
class AxisRun:
    """One axis of a run with its plan; the source of its figures.

    Attributes:
        evidence: record of its driver.
        counted: its accepted steps from t = 0 on.
        position_error_steps: largest |count - planned position| at any instant from the start of the motion.
        threshold_error_steps: largest distance of the planned position from a step's threshold when it was made.
        unmatched_steps: number of ideal crossings without a step, plus number of steps without a crossing.
        grazing_steps: number of those that do not count, since the step is optional there.
        late_us: lateness of each step; steps at slow crossings are left out.
    """

    evidence: AxisEvidence
    counted: CountedSteps
    position_error_steps: float
    threshold_error_steps: float
    unmatched_steps: int
    grazing_steps: int
    late_us: FloatArray


AxisFigure = ReportFigure[AxisRun]


class SeenAxis(NamedTuple):
    """An axis, by name, with a feature's evidence of the run; the source of the feature's figures."""

    name: str
    seen: Any


def reversals(axis: AxisEvidence) -> int:
    """Return the number of accepted steps whose direction differs from the step before."""
    return int(np.count_nonzero(axis.step_signs[1:] != axis.step_signs[:-1]))


def peak_rate_hz(axis: AxisEvidence) -> float:
    """Return the inverse of the smallest interval between two successive accepted steps of the same direction.

    It is 0.0 without such a pair. A step count per sample would overstate it by up to one over the sample time.
    """
    steady_us = _smallest_us(np.diff(axis.step_counts)[axis.step_signs[1:] == axis.step_signs[:-1]])
    return 1e6 / steady_us if steady_us else 0.0


def mean_step_interval_us(axis: AxisEvidence) -> float | None:
    """Return the mean interval from the first accepted step to the last; None with fewer than two steps."""
    intervals_counts = np.diff(axis.step_counts)
    return float(intervals_counts.mean()) / COUNTS_PER_US if intervals_counts.size else None


def clk_high_us_min(axis: AxisEvidence) -> float | None:
    """Return the shortest time that the chip's CLK is high; None if the record has no complete high time."""
    return _smallest_us(clk_durations(axis).high_counts)


def clk_low_us_min(axis: AxisEvidence) -> float | None:
    """Return the shortest time that the chip's CLK is low; None if the record has no complete low time."""
    return _smallest_us(clk_durations(axis).low_counts)


def _smallest_us(durations_counts: Int64Array) -> float | None:
    return float(durations_counts.min()) / COUNTS_PER_US if durations_counts.size else None


def _late_us(percent: float) -> Callable[[AxisRun], float]:
    """Return a function that computes a percentile of the timing errors; 0.0 without steps."""
    return lambda axis: float(np.percentile(np.abs(axis.late_us), percent)) if axis.late_us.size else 0.0


@dataclass(frozen=True, slots=True)
class AxisReport:
    """The figures of one axis."""

    name: Annotated[
        str,
        AxisFigure("name of the axis", lambda axis: axis.evidence.name, heading="axis", exact=True),
    ]
    steps_start: Annotated[
        int,
        AxisFigure(
            "the driver's count at t = 0, in steps from the joint's zero",
            lambda axis: axis.counted.start_steps,
            heading="start",
            exact=True,
        ),
    ]
    steps_end: Annotated[
        int,
        AxisFigure(
            "the driver's count after its last step",
            lambda axis: axis.counted.end_steps,
            heading="end",
            exact=True,
        ),
    ]
    pulses: Annotated[
        int,
        AxisFigure(
            "number of pulses on STEP, accepted or not",
            lambda axis: axis.evidence.clk_rise_counts.size,
            heading="pulses",
            exact=True,
        ),
    ]
    reversals: Annotated[
        int,
        AxisFigure(
            "number of accepted steps whose direction differs from the step before",
            lambda axis: reversals(axis.evidence),
            exact=True,
        ),
    ]
    peak_rate_hz: Annotated[
        float,
        AxisFigure(
            "inverse of the smallest interval between two successive accepted steps of the same direction; 0 without",
            lambda axis: peak_rate_hz(axis.evidence),
            unit="Hz",
            heading="peak",
            form="{:.1f}",
            moving=True,
            exact=True,
            limit=FigureLimit(
                "step rate",
                "highest step rate, of the board's highest",
                lambda robot, _: robot.board.driver_rate_max_hz,
            ),
        ),
    ]
    position_error_steps_max: Annotated[
        float,
        AxisFigure(
            "largest difference of count and planned position at any instant from the start of the motion",
            lambda axis: axis.position_error_steps,
            unit="steps",
            heading="err",
            form="{:.4f}",
            moving=True,
        ),
    ]
    timing_error_us_p50: Annotated[
        float,
        AxisFigure(
            "median time between an accepted step and its ideal instant, without crossings below 1 % of the peak rate;"
            " 0 without steps",
            _late_us(50),
            unit="us",
            heading="p50",
            form="{:.2f}",
            moving=True,
        ),
    ]
    timing_error_us_p99: Annotated[
        float,
        AxisFigure(
            "99th percentile of the same times",
            _late_us(99),
            unit="us",
            heading="p99",
            form="{:.2f}",
            moving=True,
        ),
    ]
    timing_error_us_max: Annotated[float, AxisFigure("the longest of the same times", _late_us(100), unit="us")]
    clk_high_us_min: Annotated[
        float | None,
        AxisFigure(
            "shortest time that the driver chip's CLK is high: a pulse on STEP, or a pause between two pulses if"
            " `active_edge` is falling; null without",
            lambda axis: clk_high_us_min(axis.evidence),
            unit="us",
            exact=True,
        ),
    ]
    clk_low_us_min: Annotated[
        float | None,
        AxisFigure(
            "shortest time that CLK is low: a pause between two pulses on STEP, or a pulse if `active_edge` is"
            " falling; null without",
            lambda axis: clk_low_us_min(axis.evidence),
            unit="us",
            exact=True,
        ),
    ]
    violations: Annotated[
        int,
        AxisFigure(
            "number of violations of the driver's limits",
            lambda axis: axis.evidence.violations.counts.size,
            heading="broken",
            exact=True,
        ),
    ]
    unmatched_steps: Annotated[
        int,
        AxisFigure(
            "number of ideal crossings without a step and of steps without a crossing, added",
            lambda axis: axis.unmatched_steps,
        ),
    ]
    grazing_steps: Annotated[
        int,
        AxisFigure(
            "unmatched steps where the motion turns around within the tolerance of a threshold, so that stepping and"
            " not stepping are both right; they do not count as unmatched",
            lambda axis: axis.grazing_steps,
        ),
    ]
    threshold_error_steps_max: Annotated[
        float,
        AxisFigure(
            "largest distance of the planned position from the threshold of a step when the step was made",
            lambda axis: axis.threshold_error_steps,
            unit="steps",
            limit=FigureLimit(
                "threshold",
                "largest error of a step's threshold, of 0.0075 steps",
                lambda robot, axis: threshold_tolerance_steps(robot.axes[axis].transmission.microsteps),
            ),
        ),
    ]
    mean_step_interval_us: Annotated[
        float | None,
        AxisFigure(
            "mean interval from the first accepted step to the last; null with fewer than two steps",
            lambda axis: mean_step_interval_us(axis.evidence),
            unit="us",
            exact=True,
        ),
    ]
    active_edge: Annotated[
        str,
        AxisFigure(
            '"rising" or "falling", the edge of the board\'s STEP with which the chip\'s CLK rises',
            lambda axis: axis.evidence.active_edge.value,
            exact=True,
        ),
    ]


def axis_figures() -> Mapping[str, ReportFigure[AxisRun]]:
    """Return the figures of an axis, by key and in the order of reports."""
    hints = get_type_hints(AxisReport, include_extras=True)
    return {key: hint.__metadata__[0] for key, hint in hints.items()}


def axis_report(axis: AxisRun) -> AxisReport:
    """Compute the figures of an axis."""
    return AxisReport(**{key: figure.of(axis) for key, figure in axis_figures().items()})


AXES: Final = "axes"
"""Key of a feature's figures in its part of a report: by axis, then by key."""


def judged_document(feature: str, seen: Any, start_counts: int, axes: Sequence[str]) -> dict[str, Any]:
    """Return a feature's part of report.json: its judge's document, and its figures of each axis."""
    document = judge_of(feature).document(seen, start_counts)
    if figures := features()[feature].figures:
        of_axis = {key: figure.of for key, figure in figures().items()}
        document[AXES] = {axis: {key: of(SeenAxis(axis, seen)) for key, of in of_axis.items()} for axis in axes}
    return document


def figure_values(
    axes: Sequence[Mapping[str, Any]], documents: Mapping[str, Any]
) -> list[tuple[ReportFigure[Any], dict[str, Any]]]:
    """Return each figure that a report has for all axes, with its values by axis; those of features come last.

    Args:
        axes: the figures of each axis, by key.
        documents: parts of features, by name; other entries are ignored.
    """
    tables: list[tuple[Mapping[str, ReportFigure[Any]], Mapping[str, Any]]] = [
        (axis_figures(), {axis["name"]: axis for axis in axes})
    ]
    tables += [(figures(), documents[own.name][AXES]) for own, figures in giving("figures") if own.name in documents]
    return [
        (figure, {name: own[key] for name, own in values.items()})
        for figures, values in tables
        for key, figure in figures.items()
        if all(key in own for own in values.values())
    ]


def declared_figures() -> list[ReportFigure[Any]]:
    """Return all figures, those of features last."""
    of_features = (figure for _, figures in giving("figures") for figure in figures().values())
    return [*axis_figures().values(), *of_features]
