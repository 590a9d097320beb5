"""Measure every method in the same way: its steps against the exact crossings of the planned motion, step by step.

The position error of a step is the distance of the planned motion, at the time of the step's edge, from the threshold
that the step stands for. Its timing error is the time from the crossing of that threshold to the edge; crossings slower
than 1 % of the axis' fastest are left out, since near a reversal time is ill-defined. Jitter is the error of the
interval between two successive steps at constant speed (planned to change by less than 1 % between them).
"""

from dataclasses import dataclass

import numpy as np

from steptwin.bench.pulses.motions import PlannedMotion
from steptwin.bench.pulses.pairing import Pairing, pair
from steptwin.bench.pulses.pulses import AxisPulses, Method
from steptwin.bench.pulses.violations import violations
from steptwin.host.common.arrays import FloatArray
from steptwin.host.verify.matching import SLOW_CROSSING
from steptwin.host.verify.oracle import THRESHOLD_STEPS, IdealSteps, ideal_steps
from steptwin.protocol.timer import COUNTS_PER_SECOND

STEADY = 0.01
"""Largest relative change of speed from one step to the next that counts as constant speed."""


@dataclass(frozen=True, slots=True)
class Figures:
    """One row of the table: a method on a motion, all axes together; errors are magnitudes.

    A figure is None if no step of the motion qualifies for it.
    """

    motion: str
    method: str
    steps: int
    missing: int
    extra: int
    error_steps_max: float
    error_steps_rms: float
    timing_us_p50: float | None
    timing_us_p99: float | None
    timing_us_max: float | None
    jitter_us_rms: float | None
    violations: int
    steps_per_s: float
    cortex_m3_percent: float | None
    """Load of the board's processor in the busiest 10 ms, metered; None if it was not."""


@dataclass(frozen=True, slots=True, eq=False)
class StepErrors:
    """Errors of one axis.

    Attributes:
        steps: position error of each step made, signed, shape (steps,).
        timing_us: timing error of each pair but the slow ones, positive if late, shape (fast pairs,).
        jitter_us: interval error of successive pairs at constant speed, shape (intervals,).
    """

    steps: FloatArray
    timing_us: FloatArray
    jitter_us: FloatArray
    pairing: Pairing


def ideal_of(motion: PlannedMotion) -> tuple[IdealSteps, ...]:
    """Return the exact crossings of a motion for each axis."""
    return ideal_steps(motion.trajectory, motion.steps_per_unit, motion.start_steps)


def figures_of(
    motion: PlannedMotion, ideal: tuple[IdealSteps, ...], method: Method, cortex_m3_percent: float | None = None
) -> Figures:
    """Let a method place a motion and measure the result; its load of the board's processor is metered elsewhere."""
    placed = method.place(motion)
    errors = [step_errors(motion, axis, ideal[axis], pulses) for axis, pulses in enumerate(placed.axes)]
    steps = np.concatenate([axis.steps for axis in errors])
    timing_us = np.abs(np.concatenate([axis.timing_us for axis in errors]))
    p50, p99, worst = np.percentile(timing_us, [50, 99, 100]).tolist() if timing_us.size else [None] * 3
    return Figures(
        motion.name,
        method.key,
        len(steps),
        sum(axis.pairing.missing for axis in errors),
        sum(axis.pairing.extra for axis in errors),
        float(np.abs(steps).max(initial=0.0)),
        _rms(steps) or 0.0,
        p50,
        p99,
        worst,
        _rms(np.concatenate([axis.jitter_us for axis in errors])),
        sum(violations(*axis, motion.board) for axis in zip(placed.axes, motion.microsteps.tolist(), strict=True)),
        len(steps) / placed.wall_s,
        cortex_m3_percent,
    )


def step_errors(motion: PlannedMotion, axis: int, ideal: IdealSteps, pulses: AxisPulses) -> StepErrors:
    """Measure the pulses of one axis."""
    made_s, signs = pulses.rise_counts / COUNTS_PER_SECOND, pulses.signs
    pairing = pair(ideal.start_steps, ideal.time_s, ideal.signs, made_s, signs)
    late_us = (made_s[pairing.made] - ideal.time_s[pairing.ideal]) * 1e6
    speeds_hz = ideal.speeds_hz[pairing.ideal]
    fast = speeds_hz >= SLOW_CROSSING * ideal.speeds_hz.max(initial=0.0)
    neighbours = (np.diff(pairing.ideal) == 1) & (np.diff(pairing.made) == 1)
    same_way = np.diff(ideal.signs[pairing.ideal]) == 0
    steady = np.abs(np.diff(speeds_hz)) < STEADY * speeds_hz[1:]
    thresholds = ideal.start_steps + np.cumsum(signs, dtype=np.int64) - signs + signs * THRESHOLD_STEPS
    planned = _positions(motion, axis, made_s)
    return StepErrors(
        planned - thresholds, late_us[fast], np.diff(late_us)[neighbours & same_way & steady & fast[1:]], pairing
    )


def _positions(motion: PlannedMotion, axis: int, t_s: FloatArray) -> FloatArray:
    """Return the planned position of an axis in steps; after its end the motion stands at its last position."""
    chunk = 16_384
    parts = [np.empty(0)]
    for first in range(0, len(t_s), chunk):
        within = np.minimum(t_s[first : first + chunk], motion.trajectory.duration_s)
        parts.append(motion.trajectory.positions(within)[:, axis] * motion.steps_per_unit[axis])
    return np.concatenate(parts)


def _rms(values: FloatArray) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if values.size else None
