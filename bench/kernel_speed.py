"""Measure how many steps a second the kernel places, and how that grows with axes, rate, points and length.

Beside the kernel stand plain numpy copies of as many bytes as it writes. The first copy takes all edges of the motion
at once, from memory to memory, as keeping a trace does. The second takes one drained buffer at a time, within the
processor's caches, where the kernel's buffers are.

A motion of any length needs the same memory, since edges are handed out and dropped and records are made on demand.
Memory is measured in a process of its own: `python -m steptwin.bench.kernel_speed STEPS` runs one length.
"""

import json
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np
from rich.table import Table

from steptwin.bench import bench_table
from steptwin.bench.live_server import of_process
from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.controller.motion.kernel import TICKS_PER_MS
from steptwin.host.common.arrays import Int64Array
from steptwin.host.studies.step_methods.kernel import UNLIMITED, Advance, Load, constant, ready, run, sine
from steptwin.host.studies.step_methods.motions import AXES

STEPS = 5_000_000
"""Number of steps in a load for a compiled kernel: 80 MB of edges, more than caches hold."""
_REPEATS = 5
_COST_REPEATS = 7
RATE_HZ = 14_000
AXIS_COUNTS = tuple(range(1, 9))
RATES_HZ = (10, 30, 100, 300, 1_000, 3_000, 10_000, 14_000, 30_000, 60_000, 100_000)
POINT_INTERVALS_MS = (1, 2, 5, 10, 20, 50, 100)
MEMORY_MAX_MB = 500
"""Largest memory that a motion of any length may need."""
LENGTHS_STEPS = (10**5, 10**6, 10**7, 10**8)


def kernel_table(kernels: list[Kernel]) -> Table:
    """Measure all loads with each kernel, after an untimed run of the first load that compiles it."""
    return bench_table(
        f"Kernel: {AXES} axes, one core, driver limits lifted; beside numpy copies of the bytes that it writes",
        "kernel|load|steps|M steps/s|x copy, memory|x copy, cache|simulated s / s",
        (row for kernel in kernels for row in _rows(kernel)),
    )


def _rows(kernel: Kernel) -> list[str]:
    loads = _loads_for(kernel)
    _once(kernel, loads[0])
    return [_row(kernel, load) for load in loads]


def _loads_for(kernel: Kernel) -> list[Load]:
    """Return loads that take seconds with this kernel: plain Python is a hundred times slower than numba."""
    if kernel.name == "python":
        return [sine(14_000, 1.0, 1), constant(14_000, 1.0)]
    peak_hz, rates = 14_000, (10_000, 14_000, 30_000, 60_000, 100_000)
    periods = round(STEPS / AXES / (peak_hz * 2 / np.pi))
    return [sine(peak_hz, 1.0, periods), *(constant(rate, round(STEPS / AXES / rate, 2)) for rate in rates)]


def _row(kernel: Kernel, load: Load) -> str:
    """Take the best of some runs of seven axes; pushing records and handing out edges are not timed."""
    runs = [_once(kernel, load) for _ in range(_REPEATS)]
    kernel_s, cached_s = min(run.kernel_s for run in runs), min(run.cached_copy_s for run in runs)
    steps = runs[0].steps
    memory_s = _memory_copy_s(2 * steps)
    return (
        f"{kernel.name}|{load.name}|{steps}|{steps / kernel_s / 1e6:.2f}|{kernel_s / memory_s:.1f}|"
        f"{kernel_s / cached_s:.1f}|{load.duration_s / kernel_s:.0f}"
    )


def _memory_copy_s(edges: int) -> float:
    source = np.arange(edges)
    target = np.zeros_like(source)
    return min(_copy_s(source, target) for _ in range(_REPEATS))


def _copy_s(source: Int64Array, target: Int64Array) -> float:
    started = time.perf_counter()
    np.copyto(target, source)
    return time.perf_counter() - started


class _Run(NamedTuple):
    steps: int
    kernel_s: float
    cached_copy_s: float


def _once(kernel: Kernel, load: Load) -> _Run:
    kernel_s = copy_s = 0.0
    steps = 0
    for advance in run(ready(kernel, UNLIMITED), load):
        kernel_s += advance.dt_s
        for edges in advance.edges:
            source = np.asarray(edges.clk_counts, dtype=np.int64)
            target = np.empty_like(source)
            _copy_s(source, target)  # not timed: it touches the pages, as the kernel has touched its buffers
            copy_s += _copy_s(source, target)
            steps += len(source) // 2
    return _Run(steps, kernel_s, copy_s)


@dataclass(frozen=True, slots=True)
class Cost:
    """One measurement: the best of _COST_REPEATS runs."""

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
    for _ in range(_COST_REPEATS + 1):
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
    command = [sys.executable, "-m", "steptwin.bench.kernel_speed", str(steps)]
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
    lines = of_process("self", "status").splitlines()
    (kib,) = (int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))
    return kib * 1024 / 1e6


def scaling_tables(kernel: Kernel) -> Iterator[Table]:
    """Measure how the cost grows; yield each table as soon as it is measured."""
    for quantity, costs in (
        ("axes, at 14 kHz", by_axes(kernel)),
        ("steps/s, seven axes", by_rate(kernel)),
        ("points/s and axis, seven axes, sine of 14 kHz peak", by_points(kernel)),
    ):
        yield bench_table(
            "",
            f"{quantity}|ns per axis and tick|M steps/s|M steps/s, with feeding and draining",
            (
                f"{row.x:g}|{row.ns_per_axis_tick:.1f}|{row.steps_per_s / 1e6:.1f}|{row.fed_steps_per_s / 1e6:.1f}"
                for row in costs
            ),
        )
    yield bench_table(
        "Length: a process each, all included",
        "steps|simulated s|s|peak memory, MB",
        (f"{row.steps}|{row.simulated_s:g}|{row.wall_s:.2f}|{row.peak_mb:.0f}" for row in by_length()),
    )


if __name__ == "__main__":
    print(json.dumps(asdict(run_length(fastest_kernel(), int(sys.argv[1])))))
