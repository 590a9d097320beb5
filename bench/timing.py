"""How far the kernel's edges are from the ideal motion, and what the TB6560's pulse timing adds to that."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench.loads import TB6560_TIMING, run, sine
from controller.backend import Kernel
from controller.motion import COUNTS_PER_SECOND

PEAKS_HZ = (300.0, 2_000.0, 14_000.0)
SINE_HZ = 0.5
THRESHOLD_STEPS = 9 / 16


@dataclass(frozen=True)
class TimingFigure:
    """One line of the timing table."""

    load: str
    steps: int
    delayed: int
    error_steps_max: float
    error_us_rms: float
    error_us_p99: float


def figures(kernel: Kernel) -> list[TimingFigure]:
    """One period of sines of some peak rates, points every 10 ms, with the TB6560's pulse timing."""
    return [measure(kernel, peak_hz) for peak_hz in PEAKS_HZ]


def measure(kernel: Kernel, peak_hz: float) -> TimingFigure:
    """Compare every edge with A (1 - cos wt): in steps at the edge's time, in time by the speed there."""
    load = sine(peak_hz, SINE_HZ, 1)
    rises, signs, delayed = _edges(kernel, peak_hz)
    omega = 2 * np.pi * SINE_HZ
    t_s = rises / COUNTS_PER_SECOND
    thresholds = np.cumsum(signs) - signs + signs * THRESHOLD_STEPS
    error_steps = peak_hz / omega * (1 - np.cos(omega * t_s)) - thresholds
    speed_hz = peak_hz * np.abs(np.sin(omega * t_s))
    fast = speed_hz > 0.01 * peak_hz  # slower than that, time is ill-defined
    error_us = np.abs(error_steps[fast]) / speed_hz[fast] * 1e6
    return TimingFigure(
        load.name,
        len(rises),
        delayed,
        float(np.abs(error_steps).max()),
        float(np.sqrt(np.mean(error_us**2))),
        float(np.percentile(error_us, 99)),
    )


def _edges(kernel: Kernel, peak_hz: float) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """CLK rises of one axis, which way each steps, and how many had to wait."""
    rises, directions, delayed = [], [], 0
    for motion, until_tick in run(kernel, sine(peak_hz, SINE_HZ, 1), TB6560_TIMING, axes=1):
        while motion.tick < until_tick:
            motion.advance(until_tick)
            (edges,) = motion.take_edges()
            rises.append(np.asarray(edges.clk_counts, dtype=np.int64)[0::2])
            directions.append(np.asarray(edges.direction, dtype=np.int64))
        motion.take_events()
        delayed = motion.delayed_steps(0)
    all_rises, words = np.concatenate(rises), np.concatenate(directions)
    levels = np.concatenate(([0], words & 1))[np.searchsorted(words >> 1, all_rises, side="right")]
    return all_rises, 2 * levels - 1, delayed
