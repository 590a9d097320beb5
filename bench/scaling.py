"""Measure how the kernel's cost grows with axes, step rate, density of points and length of the motion.

A motion of any length needs the same memory, since edges are handed out and dropped and records are made on demand.
Memory is measured in a process of its own: `python -m steptwin.bench.scaling STEPS` runs one length.
"""

import json
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.controller.motion.kernel import TICKS_PER_MS
from steptwin.host.studies.step_methods.loads import AXES, UNLIMITED, Advance, Load, constant, ready, run, sine

REPEATS = 7
RATE_HZ = 14_000
AXIS_COUNTS = tuple(range(1, 9))
RATES_HZ = (10, 30, 100, 300, 1_000, 3_000, 10_000, 14_000, 30_000, 60_000, 100_000)
POINT_INTERVALS_MS = (1, 2, 5, 10, 20, 50, 100)
MEMORY_MAX_MB = 500
"""Largest memory that a motion of any length may need."""
LENGTHS_STEPS = (10**5, 10**6, 10**7, 10**8)


@dataclass(frozen=True, slots=True)
class Cost:
    """One measurement: the best of REPEATS runs."""

    x: float
    """The varied quantity: axes, step rate in Hz, or points per second and axis."""
    ns_per_axis_tick: float
    """Time of `Motion.advance` alone."""
    steps_per_s: float
    """Steps per second of `Motion.advance` alone."""
    fed_steps_per_s: float
    """Steps per second with queueing the points in Python and handing out the edges."""


@dataclass(frozen=True, slots=True)
class Length:
    """Figures of one motion in a process of its own."""

    steps: int
    simulated_s: float
    wall_s: float
    """Time of the whole motion, without compiling."""
    peak_mb: float
    """Largest resident memory of the process, with interpreter, numpy and numba."""


def by_axes(kernel: Kernel) -> list[Cost]:
    """Measure 1 to 8 axes at 14 kHz."""
    return [_cost(kernel, axes, constant(RATE_HZ, 4.0), axes) for axes in AXIS_COUNTS]


def by_rate(kernel: Kernel) -> list[Cost]:
    """Measure seven axes from 10 Hz to 100 kHz."""
    return [_cost(kernel, rate_hz, constant(rate_hz, 4.0)) for rate_hz in RATES_HZ]


def by_points(kernel: Kernel) -> list[Cost]:
    """Measure seven axes on a sine of 14 kHz peak with 1000 to 10 points a second."""
    return [_cost(kernel, 1000 / ms, sine(RATE_HZ, 0.5, 2, ms)) for ms in POINT_INTERVALS_MS]


def _cost(kernel: Kernel, x: float, load: Load, axes: int = AXES) -> Cost:
    fed_s = advance_s = float("inf")
    steps = 0
    for _ in range(REPEATS + 1):
        started = time.perf_counter()
        steps, once_s = _advance(run(ready(kernel, UNLIMITED, axes), load))
        fed_s, advance_s = min(fed_s, time.perf_counter() - started), min(advance_s, once_s)
    axis_ticks = axes * load.duration_s * 1000 * TICKS_PER_MS
    return Cost(x, advance_s / axis_ticks * 1e9, steps / advance_s, steps / fed_s)


def _advance(advances: Iterable[Advance]) -> tuple[int, float]:
    """Run a whole motion; return its number of steps and the time spent in `Motion.advance`."""
    steps, advance_s = 0, 0.0
    for dt_s, drained in advances:
        advance_s += dt_s
        steps += sum(len(edges.clk_counts) for edges in drained) // 2
    return steps, advance_s


def by_length() -> list[Length]:
    """Measure motions of 10^5 to 10^8 steps: seven axes to and fro at up to 14 kHz."""
    return [_in_own_process(steps) for steps in LENGTHS_STEPS]


def _in_own_process(steps: int) -> Length:
    command = [sys.executable, "-m", "steptwin.bench.scaling", str(steps)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return Length(**json.loads(done.stdout))


def run_length(kernel: Kernel, steps: int) -> Length:
    """Repeat a sine period with seven axes until they have made at least `steps` steps, in this process."""
    period = sine(RATE_HZ, 0.5, 1)
    repeats = -(-steps // (AXES * 2 * round(period.positions_steps.max())))
    _advance(run(ready(kernel, UNLIMITED), period))  # compiles the kernel
    started = time.perf_counter()
    made, _ = _advance(run(ready(kernel, UNLIMITED), period, repeats))
    return Length(made, repeats * period.duration_s, time.perf_counter() - started, _peak_mb())


def _peak_mb() -> float:
    """Return this process' peak resident memory (Linux: VmHWM; getrusage would inherit the parent's)."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    (kib,) = (int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))
    return kib * 1024 / 1e6


if __name__ == "__main__":
    print(json.dumps(asdict(run_length(fastest_kernel(), int(sys.argv[1])))))
