"""How the kernel's cost grows: with axes, step rate, density of points and length of the motion.

A motion of any length needs the same memory: edges are handed out and forgotten, records made as they are asked for.
Memory is therefore measured in a process of its own: `python -m
steptwin.bench.pulses.scaling STEPS` runs one length there.
"""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from steptwin.bench.loads import AXES, POINT_MS, POINTS_AHEAD, UNLIMITED, Load, constant, run, sine
from steptwin.controller.backend import Kernel, fastest_kernel
from steptwin.controller.kernel import TICKS_PER_MS
from steptwin.controller.motion import Motion, Refusal

REPEATS = 7
RATE_HZ = 14_000
AXIS_COUNTS = tuple(range(1, 9))
RATES_HZ = (10, 30, 100, 300, 1_000, 3_000, 10_000, 14_000, 30_000, 60_000, 100_000)
POINT_INTERVALS_MS = (1, 2, 5, 10, 20, 50, 100)
MEMORY_MAX_MB = 500
"""What a motion of any length may need."""
LENGTHS_STEPS = (10**5, 10**6, 10**7, 10**8)


@dataclass(frozen=True, slots=True)
class Cost:
    """One measurement: the best of some runs."""

    x: float
    """Axes, step rate in Hz or points per second and axis."""
    ns_per_axis_tick: float
    """Of `Motion.advance` alone."""
    steps_per_s: float
    """Of `Motion.advance` alone."""
    fed_steps_per_s: float
    """Of everything: queueing the points in Python, advancing, handing out the edges."""


@dataclass(frozen=True, slots=True)
class Length:
    """A motion of some length in a process of its own."""

    steps: int
    simulated_s: float
    wall_s: float
    """All of it, without the compiling."""
    peak_mb: float
    """The process' largest resident memory, interpreter, numpy and numba included."""


def by_axes(kernel: Kernel) -> list[Cost]:
    """1 to 8 axes at 14 kHz."""
    return [_cost(kernel, axes, constant(RATE_HZ, 4.0), axes) for axes in AXIS_COUNTS]


def by_rate(kernel: Kernel) -> list[Cost]:
    """Seven axes from 10 Hz to 100 kHz."""
    return [_cost(kernel, rate_hz, constant(rate_hz, 4.0)) for rate_hz in RATES_HZ]


def by_points(kernel: Kernel) -> list[Cost]:
    """Seven axes on a sine of 14 kHz peak, 1000 to 10 points a second."""
    return [_cost(kernel, 1000 / ms, sine(RATE_HZ, 0.5, 2, ms)) for ms in POINT_INTERVALS_MS]


def _cost(kernel: Kernel, x: float, load: Load, axes: int = AXES) -> Cost:
    fed_s = advance_s = float("inf")
    steps = 0
    for _ in range(REPEATS + 1):
        started = time.perf_counter()
        steps, once_s = _advance(run(kernel, load, UNLIMITED, axes))
        fed_s, advance_s = min(fed_s, time.perf_counter() - started), min(advance_s, once_s)
    axis_ticks = axes * load.duration_s * 1000 * TICKS_PER_MS
    return Cost(x, advance_s / axis_ticks * 1e9, steps / advance_s, steps / fed_s)


def _advance(batches: Iterator[tuple[Motion, int]]) -> tuple[int, float]:
    """Run all of a motion; return its steps and how long `Motion.advance` took."""
    steps, advance_s = 0, 0.0
    for motion, until_tick in batches:
        while motion.tick < until_tick:
            started = time.perf_counter()
            motion.advance(until_tick)
            advance_s += time.perf_counter() - started
            steps += sum(len(edges.clk_counts) for edges in motion.take_edges()) // 2
        motion.take_events()
    return steps, advance_s


def by_length() -> list[Length]:
    """Up to 10^8 steps, seven axes to and fro with 14 kHz at most."""
    return [_in_own_process(steps) for steps in LENGTHS_STEPS]


def _in_own_process(steps: int) -> Length:
    command = [sys.executable, "-m", "steptwin.bench.pulses.scaling", str(steps)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return Length(**json.loads(done.stdout))


def run_length(kernel: Kernel, steps: int) -> Length:
    """At least so many steps of seven axes, in this process."""
    _advance(_endless(kernel, 1))  # compiles
    started = time.perf_counter()
    made = 0
    for motion, until_tick in _endless(kernel, steps):
        simulated_ticks = until_tick
        made += _advance(iter([(motion, until_tick)]))[0]
    wall_s = time.perf_counter() - started
    return Length(made, simulated_ticks / (1000 * TICKS_PER_MS), wall_s, _peak_mb())


def _endless(kernel: Kernel, steps: int) -> Iterator[tuple[Motion, int]]:
    """Periods of a sine, over and over, until seven axes have made at least so many steps."""
    period = sine(RATE_HZ, 0.5, 1)
    records = period.records()
    per_period = AXES * 2 * round(period.positions_steps.max())
    periods = -(-steps // per_period)
    motion = Motion(kernel, AXES)
    for axis in range(AXES):
        motion.configure(axis, UNLIMITED)
    total = periods * len(records)
    for first in range(0, total, POINTS_AHEAD):
        last = min(first + POINTS_AHEAD, total)
        batch = [records[i % len(records)] for i in range(first, last)]
        for axis in range(AXES):
            for record in batch:
                assert motion.push(axis, *record) is Refusal.ACCEPTED
            if first == 0:
                motion.start(axis)
        yield motion, TICKS_PER_MS * POINT_MS * last - (0 if last == total else 1)


def _peak_mb() -> float:
    """Linux's high-water mark of resident memory, of this process alone: getrusage inherits the parent's."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    (kib,) = (int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))
    return kib * 1024 / 1e6


if __name__ == "__main__":
    print(json.dumps(asdict(run_length(fastest_kernel(), int(sys.argv[1])))))
