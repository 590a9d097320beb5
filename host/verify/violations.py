"""Broken limits of the drivers, grouped: one report for each axis and limit."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from steptwin.host.verify.evidence import AxisEvidence, Evidence
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True)
class ViolationReport:
    """One limit of one axis' driver, broken at least once.

    Attributes:
        axis: the joint.
        rule: a short name, for machines.
        broken: what was wrong and what came of that, for people.
        count: how often.
        worst: the value that is furthest from the limit.
        limit: the limit.
        unit: of both.
        first_s: when it was broken for the first time, in the trajectory's time; negative is before its start.
        source: who says so.
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
    """In the order of axes, and for each in the order of its limits."""
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
