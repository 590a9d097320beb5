"""Give the compiled methods buffers to write into, and time them."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from steptwin.bench.pulses.motions import PlannedMotion
from steptwin.bench.pulses.pulses import AxisPulses, Placed
from steptwin.host.common.arrays import Int64Array
from steptwin.host.robots.board_settings import BoardSettings
from steptwin.protocol.timer import counts_of_ns

REPEATS = 3
"""Number of timed runs; the fastest counts. One run before them compiles and touches the pages."""


class PinTimes(NamedTuple):
    """Pulse timing in timer counts: CLK high, CLK high and low together, DIR stable before and after a rise."""

    steplen: int
    pulse: int
    dirsetup: int
    dirhold: int

    @classmethod
    def of(cls, board: BoardSettings) -> "PinTimes":
        """Convert a board's settings; DIR is held for at least one count, since the driver reads it at the rise."""
        steplen, stepspace = counts_of_ns(board.steplen_ns), counts_of_ns(board.stepspace_ns)
        return cls(
            steplen, steplen + stepspace, counts_of_ns(board.dirsetup_ns), max(counts_of_ns(board.dirhold_ns), 1)
        )


@dataclass(slots=True, eq=False)
class Buffers:
    """One row for each axis: CLK rises, DIR edges as 2 * counts + level, and the number of both."""

    rises: Int64Array
    direction: Int64Array
    counts: Int64Array = field(init=False)
    """Shape (axes, 2)."""

    def __post_init__(self) -> None:
        self.counts = np.zeros((len(self.rises), 2), np.int64)


def place_with(place: Callable[[Buffers], None], motion: PlannedMotion) -> Placed:
    """Let a method fill the buffers REPEATS + 1 times; return its pulses and the shortest time."""
    shape = (motion.axes, motion.steps_max)
    buffers = Buffers(np.zeros(shape, np.int64), np.zeros(shape, np.int64))
    wall_s = float("inf")
    for _ in range(REPEATS + 1):
        started = time.perf_counter()
        place(buffers)
        wall_s = min(wall_s, time.perf_counter() - started)
    rows = zip(buffers.rises, buffers.direction, buffers.counts.tolist(), strict=True)
    steplen = PinTimes.of(motion.board).steplen
    axes = [AxisPulses.of(rises[:steps], edges[:turns], steplen) for rises, edges, (steps, turns) in rows]
    return Placed(axes, wall_s)
