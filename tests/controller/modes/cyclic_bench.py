"""A host for cyclic synchronous position, which sends set-points and SYNCs to a bench board at chosen times."""

import struct
from collections.abc import Sequence
from itertools import accumulate

from steptwin.controller.motion.backend import Kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import Mode
from tests.controller.bench_board import BenchBoard
from tests.controller.units import MS

FIRST_SYNC_COUNTS = 5 * MS + 12_345
"""In the middle of a servo tick."""


def ramped(velocity_units: int, acceleration_units: int, cycles: int, start_units: int = 0) -> list[int]:
    """Return set-points that accelerate from rest, by units per period in each period, to a constant velocity."""
    sign = 1 if velocity_units > 0 else -1
    speeds = (min(i * acceleration_units, abs(velocity_units)) for i in range(1, cycles + 1))
    return list(accumulate((sign * speed for speed in speeds), initial=start_units))


class CyclicBench(BenchBoard):
    """A bench board whose axes are enabled in the mode. Cycle k is due at FIRST_SYNC_COUNTS + k periods."""

    def __init__(self, kernel: Kernel, period_ms: int, axes: int = 1, ppm: int = 0) -> None:
        super().__init__(kernel, axes)
        self.period_ms = period_ms
        self.ppm = ppm
        """Parts per million by which the host's clock is slow."""
        self.cycles = 0
        self.held: list[int | None] = [None] * axes
        """The last set-points sent."""
        for axis in range(axes):
            assert self.write(od.INTERPOLATION_PERIOD, period_ms, axis) == 0
        self.enable(Mode.CYCLIC_SYNCHRONOUS_POSITION)

    @property
    def due_counts(self) -> int:
        """When the next SYNC is due."""
        ideal = self.cycles * self.period_ms * MS
        return FIRST_SYNC_COUNTS + ideal + ideal * self.ppm // 1_000_000

    def until(self, counts: int) -> None:
        self.wait((counts - self.now) / MS)

    def cycle(self, *points: int | None, sync: bool = True, late_counts: int = 0) -> None:
        """Do one cycle of the host: send a set-point to each axis, except for None, and SYNC."""
        self.until(self.due_counts + late_counts)
        for axis, point in enumerate(points):
            if point is not None:
                self.held[axis] = point
                self.send(0x410 + axis, struct.pack("<i", point))
        if sync:
            self.send(0x080, b"")
        self.cycles += 1

    def follow(self, points: Sequence[int]) -> None:
        """Send the same set-points to all axes."""
        for point in points:
            self.cycle(*[point] * len(self.firmware.nodes))

    def settle(self, cycles: int = 5) -> None:
        """Hold the last set-points."""
        for _ in range(cycles):
            self.cycle(*self.held)

    def skip(self) -> None:
        """Leave out the cycles whose time has passed."""
        while self.due_counts < self.now:
            self.cycles += 1


def first_tick(period_ms: int) -> int:
    """Return the tick in which the cubic of cycle 0 begins: a tick after the slot of its SYNC closes."""
    half_us = FIRST_SYNC_COUNTS // 72 + 500 * period_ms
    return -(-half_us // 250) + 1
