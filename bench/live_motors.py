"""Measure what motors that turn with a live board cost: lateness and processor time with and without them, in turns.

`python -m steptwin.bench live-motors [PAIRS]` prints it. Server and client are two processes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

from steptwin.bench.live import move_all
from steptwin.bench.live_server import SERVE, serving
from steptwin.bench.live_stream import cpu_s

PAIRS = 10
MOTION_S = 1.5
"""Time for which six axes move at 1000 steps/s: 6000 servo ticks."""


@dataclass(frozen=True)
class Served:
    """One motion of a served board: lateness in us of the wall clock, and the server's processor seconds per second."""

    ticks_us_p50: float
    ticks_us_p99: float
    frames_us_p99: float
    cores: float


@dataclass(frozen=True)
class Comparison:
    """All motions, in the order in which they were made."""

    without: Sequence[Served]
    with_motors: Sequence[Served]

    def medians(self, figure: str) -> tuple[float, float]:
        """Return the medians of a figure of `Served` without and with motors."""
        without, turning = ([getattr(each, figure) for each in side] for side in (self.without, self.with_motors))
        return median(without), median(turning)

    def range_without(self, figure: str) -> tuple[float, float]:
        """Return the least and the greatest value without motors: what the computer itself makes differ."""
        values = [getattr(each, figure) for each in self.without]
        return min(values), max(values)


def measure(pairs: int = PAIRS) -> Comparison:
    """Serve a board without and one with motors, in turns."""
    served = [(_served(), _served("--motors")) for _ in range(pairs)]
    return Comparison([each for each, _ in served], [each for _, each in served])


def _served(*options: str) -> Served:
    with serving(*SERVE, *options) as server:
        with server.client() as bus:
            used_s = cpu_s(server.process.pid)
            move_all(bus, MOTION_S)
            used_s = cpu_s(server.process.pid) - used_s
        late: dict[str, Any] = server.end()["real_time"]
    ticks = late["ticks"]
    return Served(ticks["late_us_p50"], ticks["late_us_p99"], late["frames"]["late_us_p99"], used_s / MOTION_S)
