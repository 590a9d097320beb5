"""What the pins and the driver alone say about one axis, without any plan."""

from dataclasses import dataclass

import numpy as np

from host.verify.evidence import COUNTS_PER_SECOND, AxisEvidence, Int64Array

COUNTS_PER_US = COUNTS_PER_SECOND / 1_000_000


@dataclass(frozen=True, slots=True)
class PulseFacts:
    """Figures of one axis' whole evidence.

    Attributes:
        pulses: CLK rises, accepted or not.
        reversals: how often an accepted step goes against the one before it.
        peak_rate_hz: the inverse of the smallest interval between two accepted steps that follow each other the same
            way; 0.0 without such a pair. A step count per sample would overstate it by up to one over the sample time.
        mean_step_interval_us: from the first accepted step to the last, per step; None with fewer than two.
        clk_high_us_min: the shortest pulse; None without one.
        clk_low_us_min: the shortest pause between two pulses; None without one.
    """

    pulses: int
    reversals: int
    peak_rate_hz: float
    mean_step_interval_us: float | None
    clk_high_us_min: float | None
    clk_low_us_min: float | None


def pulse_facts(axis: AxisEvidence) -> PulseFacts:
    """Measure one axis."""
    same_way = axis.step_signs[1:] == axis.step_signs[:-1]
    intervals_counts = np.diff(axis.step_counts)
    steady_us = _smallest_us(intervals_counts[same_way])
    return PulseFacts(
        pulses=len(axis.clk_rise_counts),
        reversals=int(np.count_nonzero(~same_way)),
        peak_rate_hz=1e6 / steady_us if steady_us else 0.0,
        mean_step_interval_us=float(intervals_counts.mean()) / COUNTS_PER_US if intervals_counts.size else None,
        clk_high_us_min=_smallest_us(axis.clk_fall_counts - axis.clk_rise_counts),
        clk_low_us_min=_smallest_us(axis.clk_rise_counts[1:] - axis.clk_fall_counts[:-1]),
    )


def _smallest_us(durations_counts: Int64Array) -> float | None:
    return float(durations_counts.min()) / COUNTS_PER_US if durations_counts.size else None
