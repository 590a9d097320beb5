"""Measure what motors that turn with a live board cost: lateness and processor time with and without them, in turns.

`python -m steptwin.bench live-motors [PAIRS]` prints it. Server and client are two processes.
"""

import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from steptwin.bench.live.round_trips import move_all
from steptwin.bench.live.server import SERVE, serving
from steptwin.bench.live.streamed_points import cpu_s

PAIRS = 10
MOTION_S = 1.5
"""Time for which six axes move at 1000 steps/s, 6000 servo ticks, in which none comes near its switches."""


@dataclass(frozen=True)
class Served:
    """One motion of a served board: lateness in us of the wall clock, and the server's processor seconds per second.

    Lateness of frames is left out: so few come in this time that those of power-up decide the 99th percentile.
    """

    ticks_us_p50: float
    ticks_us_p99: float
    cores: float


@dataclass(frozen=True)
class MotorCost:
    """All motions, in the order that they were made."""

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


def measure(pairs: int = PAIRS) -> MotorCost:
    """Serve a board without and one with motors, in turns."""
    # python-can warns of each frame that TCP delivers in two pieces: silence it.
    logging.getLogger("can").addHandler(logging.NullHandler())
    served = [(_served(), _served("--motors")) for _ in range(pairs)]
    return MotorCost([each for each, _ in served], [each for _, each in served])


def _served(*options: str) -> Served:
    with serving(*SERVE, *options) as server:
        with server.client() as bus:
            began_s, used_s = time.perf_counter(), cpu_s(server.process.pid)
            move_all(bus, MOTION_S)
            moved_s, used_s = time.perf_counter() - began_s, cpu_s(server.process.pid) - used_s
        ticks: dict[str, float] = server.end()["real_time"]["ticks"]
    return Served(ticks["late_us_p50"], ticks["late_us_p99"], used_s / moved_s)
