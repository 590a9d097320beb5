"""Measure one axis from its pins and its driver's steps alone, without any plan."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from steptwin.host.common.arrays import Int64Array
from steptwin.host.verify.evidence import AxisEvidence
from steptwin.protocol.drivers import ActiveEdge
from steptwin.protocol.timer import COUNTS_PER_US


class ClkDurations(NamedTuple):
    """Durations of the chip's CLK high, low, and from one rise to the next, in counts and in order of time.

    They compare with the drivers' limits: if the falling edge is active, CLK is high while the board's STEP is low.
    """

    high_counts: Int64Array
    low_counts: Int64Array
    period_counts: Int64Array


@dataclass(frozen=True, slots=True)
class PulseFacts:
    """Figures of one axis' whole evidence.

    Attributes:
        pulses: number of pulses on STEP, accepted or not.
        reversals: number of accepted steps whose direction differs from the step before.
        peak_rate_hz: inverse of the smallest interval between two successive accepted steps of the same direction;
            0.0 without such a pair. A step count per sample would overstate it by up to one over the sample time.
        mean_step_interval_us: mean interval from the first accepted step to the last; None with fewer than two steps.
        clk_high_us_min: shortest time that the chip's CLK is high; None if the record has no complete high time.
        clk_low_us_min: shortest time that the chip's CLK is low; None if the record has no complete low time.
    """

    pulses: int
    reversals: int
    peak_rate_hz: float
    mean_step_interval_us: float | None
    clk_high_us_min: float | None
    clk_low_us_min: float | None


def pulse_facts(axis: AxisEvidence) -> PulseFacts:
    """Measure one axis' whole evidence."""
    same_way = axis.step_signs[1:] == axis.step_signs[:-1]
    intervals_counts = np.diff(axis.step_counts)
    clk = clk_durations(axis)
    steady_us = _smallest_us(intervals_counts[same_way])
    return PulseFacts(
        pulses=len(axis.clk_rise_counts),
        reversals=int(np.count_nonzero(~same_way)),
        peak_rate_hz=1e6 / steady_us if steady_us else 0.0,
        mean_step_interval_us=float(intervals_counts.mean()) / COUNTS_PER_US if intervals_counts.size else None,
        clk_high_us_min=_smallest_us(clk.high_counts),
        clk_low_us_min=_smallest_us(clk.low_counts),
    )


def clk_durations(axis: AxisEvidence) -> ClkDurations:
    """Return all durations whose two ends are on record."""
    rises, falls = axis.clk_rise_counts, axis.clk_fall_counts
    pulses_counts, pauses_counts = falls - rises, rises[1:] - falls[:-1]
    if axis.active_edge is ActiveEdge.FALLING:
        return ClkDurations(pauses_counts, pulses_counts, np.diff(falls))
    return ClkDurations(pulses_counts, pauses_counts, np.diff(rises))


def _smallest_us(durations_counts: Int64Array) -> float | None:
    return float(durations_counts.min()) / COUNTS_PER_US if durations_counts.size else None
