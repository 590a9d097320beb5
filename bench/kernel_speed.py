"""Measure how many steps a second the kernel places, beside plain numpy copies of as many bytes as it writes.

The first copy takes all edges of the motion at once, from memory to memory, as keeping a trace does. The second takes
one drained buffer at a time, within the processor's caches, where the kernel's buffers are.
"""

import time
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from steptwin.controller.motion.backend import Kernel
from steptwin.host.common.arrays import Int64Array
from steptwin.host.studies.step_methods.loads import AXES, UNLIMITED, Load, constant, ready, run, sine

REPEATS = 5
STEPS = 5_000_000
"""Number of steps in a load for a compiled kernel: 80 MB of edges, more than caches hold."""


@dataclass(frozen=True)
class KernelFigure:
    """One row of the kernel's table."""

    load: str
    kernel: str
    steps: int
    steps_per_s: float
    memory_copy_ratio: float
    """Kernel's time divided by the time of copying all edges at once; from memory to memory if there are STEPS."""
    cached_copy_ratio: float
    """Kernel's time divided by the time of copying the edges one buffer at a time, from cache to cache."""
    simulated_per_wall: float


def loads_for(kernel: Kernel) -> list[Load]:
    """Return loads that take seconds with this kernel: plain Python is a hundred times slower than numba."""
    if kernel.name == "python":
        return [sine(14_000, 1.0, 1), constant(14_000, 1.0)]
    peak_hz, rates = 14_000, (10_000, 14_000, 30_000, 60_000, 100_000)
    periods = round(STEPS / AXES / (peak_hz * 2 / np.pi))
    return [sine(peak_hz, 1.0, periods), *(constant(rate, round(STEPS / AXES / rate, 2)) for rate in rates)]


def measure(kernel: Kernel, load: Load) -> KernelFigure:
    """Take the best of REPEATS runs of seven axes; pushing records and handing out edges are not timed."""
    runs = [_once(kernel, load) for _ in range(REPEATS)]
    kernel_s, cached_s = min(run.kernel_s for run in runs), min(run.cached_copy_s for run in runs)
    steps = runs[0].steps
    memory_s = _memory_copy_s(2 * steps)
    return KernelFigure(
        load.name,
        kernel.name,
        steps,
        steps / kernel_s,
        kernel_s / memory_s,
        kernel_s / cached_s,
        load.duration_s / kernel_s,
    )


def _memory_copy_s(edges: int) -> float:
    source = np.arange(edges)
    target = np.zeros_like(source)
    return min(_copy_s(source, target) for _ in range(REPEATS))


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


def figures(kernel: Kernel) -> list[KernelFigure]:
    """Measure all loads with one kernel, after an untimed run of the first load that compiles it."""
    loads = loads_for(kernel)
    _once(kernel, loads[0])
    return [measure(kernel, load) for load in loads]
