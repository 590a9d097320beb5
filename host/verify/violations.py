"""Group violations of the drivers' limits: one report for each axis and limit."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from steptwin.host.verify.evidence import AxisEvidence, Evidence
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True)
class ViolationReport:
    """A limit of one axis' driver that was broken at least once.

    Attributes:
        axis: name of the joint.
        rule: short name of the limit, for programs.
        broken: the fault and its consequence, for people.
        count: number of violations.
        worst: the value furthest from the limit.
        limit: the limiting value.
        unit: unit of `worst` and `limit`.
        first_s: time of the first violation in the trajectory's time; negative before the motion's start.
        source: document and place that state the limit.
    """

    axis: str
    rule: str
    broken: str
    count: int
    worst: float
    limit: float
    unit: str
    first_s: float
    source: str


def violation_reports(evidence: Evidence) -> tuple[ViolationReport, ...]:
    """Return the violations of every axis in order, and of each axis in the order of its limits."""
    return tuple(report for axis in evidence.axes for report in _of_axis(axis, evidence.start_counts))


def _of_axis(axis: AxisEvidence, start_counts: int) -> Iterator[ViolationReport]:
    violations = axis.violations
    for index, limit in enumerate(violations.limits):
        chosen = violations.which == index
        if not chosen.any():
            continue
        values = violations.values[chosen]
        yield ViolationReport(
            axis=axis.name,
            rule=limit.rule,
            broken=limit.broken,
            count=values.size,
            worst=float(values[np.argmax(np.abs(values - limit.limit))]),
            limit=limit.limit,
            unit=limit.unit,
            first_s=float(violations.counts[chosen].min() - start_counts) / COUNTS_PER_SECOND,
            source=limit.source,
        )
