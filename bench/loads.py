"""Motions to measure with: sines and constant speeds as PVT records for all axes of a board."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from steptwin.controller.backend import Kernel
from steptwin.controller.motion import Motion, Refusal, StepConfig

POINT_MS = 10
POINTS_AHEAD = 60
MICROSTEPS = 16
UNITS_PER_STEP = 1024
AXES = 7

Int64Array = NDArray[np.int64]


@dataclass(frozen=True)
class Load:
    """Rest-to-rest motion of one axis: where it is and how fast, in steps, at evenly spaced points."""

    name: str
    positions_steps: NDArray[np.float64]
    velocities_hz: NDArray[np.float64]
    point_ms: int = POINT_MS

    @property
    def duration_s(self) -> float:
        """How long it lasts."""
        return (len(self.positions_steps) - 1) * self.point_ms / 1000

    def records(self) -> list[tuple[int, int, int]]:
        """As PVT fields: displacement and end velocity in wire units, duration in ms."""
        units = np.floor(self.positions_steps * UNITS_PER_STEP + 0.5).astype(np.int64)
        velocities = np.round(self.velocities_hz * UNITS_PER_STEP * 64 / 1000).astype(np.int64)
        return [(int(d), int(v), self.point_ms) for d, v in zip(np.diff(units), velocities[1:], strict=True)]


def sine(peak_hz: float, sine_hz: float, periods: int, point_ms: int = POINT_MS) -> Load:
    """A (1 - cos wt): step rates up to `peak_hz`."""
    t_s = np.arange(round(periods * 1000 / point_ms / sine_hz) + 1) * point_ms / 1000
    omega = 2 * np.pi * sine_hz
    amplitude = peak_hz / omega
    return Load(
        f"sine, {peak_hz / 1000:g} kHz peak",
        amplitude * (1 - np.cos(omega * t_s)),
        peak_hz * np.sin(omega * t_s),
        point_ms,
    )


def constant(rate_hz: float, duration_s: float, point_ms: int = POINT_MS) -> Load:
    """Constant speed between ramps of 100 ms."""
    t_s = np.arange(round(duration_s * 1000 / point_ms) + 1) * point_ms / 1000
    ramp_s = 0.1
    velocities = rate_hz * np.clip(np.minimum(t_s, t_s[-1] - t_s) / ramp_s, 0, 1)
    positions = np.concatenate(([0.0], np.cumsum((velocities[1:] + velocities[:-1]) / 2 * point_ms / 1000)))
    return Load(f"constant {rate_hz / 1000:g} kHz", positions, velocities, point_ms)


def run(kernel: Kernel, load: Load, timing: StepConfig, axes: int = AXES) -> Iterator[tuple[Motion, int]]:
    """Feed a load to all axes; yield the motion and the tick to advance it to, again and again until it is done."""
    motion = Motion(kernel, axes)
    for axis in range(axes):
        motion.configure(axis, timing)
    records = load.records()
    ticks_per_point = 4 * load.point_ms
    for first in range(0, len(records), POINTS_AHEAD):
        batch = records[first : first + POINTS_AHEAD]
        for axis in range(axes):
            for record in batch:
                assert motion.push(axis, *record) is Refusal.ACCEPTED
            if first == 0:
                motion.start(axis)
        done = first + len(batch)
        # One tick short of running dry: a queue that empties while moving is an underrun.
        yield motion, ticks_per_point * done - (0 if done == len(records) else 1)


UNLIMITED = StepConfig(MICROSTEPS, 3_000, 1_000, 0, 0, velocity_max_units_per_s=250_000 * UNITS_PER_STEP)
"""Pulse timing that lets 250 kHz pass, to measure the kernel and not the driver."""

TB6560_TIMING = StepConfig(MICROSTEPS, 33_000, 33_666, 15_000, 15_000, velocity_max_units_per_s=15_000 * UNITS_PER_STEP)
