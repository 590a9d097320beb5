"""Measure how far the kernel's edges are from the ideal motion, with the TB6560's pulse timing."""

from dataclasses import dataclass

import numpy as np

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.board_motion import PinEdges
from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.studies.step_methods.loads import TB6560_TIMING, ready, run, sine
from steptwin.protocol.timer import COUNTS_PER_SECOND

PEAKS_HZ = (300.0, 2_000.0, 14_000.0)
SINE_HZ = 0.5
THRESHOLD_STEPS = 9 / 16


@dataclass(frozen=True)
class TimingFigure:
    """One row of the timing table."""

    load: str
    steps: int
    delayed: int
    error_steps_max: float
    error_us_rms: float
    error_us_p99: float


def figures(kernel: Kernel) -> list[TimingFigure]:
    """Measure one sine period for each peak rate: points every 10 ms, the TB6560's pulse timing."""
    return [measure(kernel, peak_hz) for peak_hz in PEAKS_HZ]


def measure(kernel: Kernel, peak_hz: float) -> TimingFigure:
    """Compare every edge with A (1 - cos wt): in steps at the edge's time, and in time by the speed there."""
    load = sine(peak_hz, SINE_HZ, 1)
    motion = ready(kernel, TB6560_TIMING, axes=1)
    rises, signs = steps_of([edges for advance in run(motion, load) for edges in advance.edges])
    t_s = rises / COUNTS_PER_SECOND
    error_steps = errors_steps(t_s, signs, peak_hz)
    speed_hz = peak_hz * np.abs(np.sin(2 * np.pi * SINE_HZ * t_s))
    fast = speed_hz > 0.01 * peak_hz  # at lower speeds the time of a crossing is ill-defined
    error_us = np.abs(error_steps[fast]) / speed_hz[fast] * 1e6
    return TimingFigure(
        load.name,
        len(rises),
        motion.delayed_steps(0),
        float(np.abs(error_steps).max()),
        float(np.sqrt(np.mean(error_us**2))),
        float(np.percentile(error_us, 99)),
    )


def errors_steps(t_s: FloatArray, signs: Int64Array, peak_hz: float) -> FloatArray:
    """Return the ideal position at the time of each step minus the threshold that the step stands for, in steps."""
    omega = 2 * np.pi * SINE_HZ
    thresholds = np.cumsum(signs) - signs + signs * THRESHOLD_STEPS
    return np.asarray(peak_hz / omega * (1 - np.cos(omega * t_s)) - thresholds, dtype=np.float64)


def steps_of(drained: list[PinEdges]) -> tuple[Int64Array, Int64Array]:
    """Return the CLK rises of one axis in timer counts and the sign of each step; DIR is low at first."""
    rises = np.concatenate([np.asarray(edges.clk_counts, dtype=np.int64)[0::2] for edges in drained])
    words = np.concatenate([np.asarray(edges.direction, dtype=np.int64) for edges in drained])
    levels = np.concatenate(([0], words & 1))[np.searchsorted(words >> 1, rises, side="right")]
    return rises, 2 * levels - 1
