"""Where the compiled methods write, and how they are timed."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from bench.loads import TB6560_TIMING, Int64Array
from bench.pulses.motions import PlannedMotion
from bench.pulses.pulses import AxisPulses, Placed
from controller.motion import counts_of_ns

STEPLEN_COUNTS = counts_of_ns(TB6560_TIMING.steplen_ns)
PULSE_COUNTS = STEPLEN_COUNTS + counts_of_ns(TB6560_TIMING.stepspace_ns)
DIRSETUP_COUNTS = counts_of_ns(TB6560_TIMING.dirsetup_ns)
DIRHOLD_COUNTS = counts_of_ns(TB6560_TIMING.dirhold_ns)

REPEATS = 3
"""The best counts; the first one compiles and touches the pages."""


@dataclass(slots=True, eq=False)
class Buffers:
    """One row an axis: CLK rises, DIR edges as 2 * counts + level, and how many of both there are."""

    rises: Int64Array
    direction: Int64Array
    counts: Int64Array = field(init=False)
    """Shape (axes, 2)."""

    def __post_init__(self) -> None:
        self.counts = np.zeros((len(self.rises), 2), np.int64)


def place_with(place: Callable[[Buffers], None], motion: PlannedMotion) -> Placed:
    """Let a method fill buffers a few times; the fastest counts."""
    shape = (motion.axes, motion.steps_max)
    buffers = Buffers(np.zeros(shape, np.int64), np.zeros(shape, np.int64))
    wall_s = float("inf")
    for _ in range(REPEATS + 1):
        started = time.perf_counter()
        place(buffers)
        wall_s = min(wall_s, time.perf_counter() - started)
    rows = zip(buffers.rises, buffers.direction, buffers.counts.tolist(), strict=True)
    axes = [AxisPulses.of(rises[:steps], edges[:turns], STEPLEN_COUNTS) for rises, edges, (steps, turns) in rows]
    return Placed(axes, wall_s)
