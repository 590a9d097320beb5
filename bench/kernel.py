"""How many steps a second the kernel places, beside a plain numpy copy of the bytes that it writes."""

import time
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bench.loads import UNLIMITED, Load, constant, run, sine
from controller.backend import Kernel

REPEATS = 7


@dataclass(frozen=True)
class KernelFigure:
    """One line of the kernel's table."""

    load: str
    kernel: str
    steps: int
    steps_per_s: float
    copy_ratio: float
    """Time of the kernel over the time of copying its output."""
    simulated_per_wall: float


def loads_for(kernel: Kernel) -> list[Load]:
    """Enough to measure, little enough to wait for: plain Python is a hundred times slower."""
    if kernel.name == "python":
        return [sine(14_000, 1.0, 1), constant(14_000, 1.0)]
    rates = (10_000, 14_000, 30_000, 60_000, 100_000)
    return [sine(14_000, 1.0, 20), *(constant(rate, 15.0) for rate in rates)]


def measure(kernel: Kernel, load: Load) -> KernelFigure:
    """The best of some runs over seven axes; pushing records and handing out edges are not counted."""
    runs = [_once(kernel, load) for _ in range(REPEATS)]
    kernel_s, copy_s = min(run.kernel_s for run in runs), min(run.copy_s for run in runs)
    steps = runs[0].steps
    return KernelFigure(load.name, kernel.name, steps, steps / kernel_s, kernel_s / copy_s, load.duration_s / kernel_s)


class _Run(NamedTuple):
    steps: int
    kernel_s: float
    copy_s: float


def _once(kernel: Kernel, load: Load) -> _Run:
    kernel_s = copy_s = 0.0
    steps = 0
    for motion, until_tick in run(kernel, load, UNLIMITED):
        while motion.tick < until_tick:
            started = time.perf_counter()
            motion.advance(until_tick)
            kernel_s += time.perf_counter() - started
            for edges in motion.take_edges():
                source = np.asarray(edges.clk_counts, dtype=np.int64)
                target = np.empty_like(source)
                np.copyto(target, source)  # once to touch the pages, as the kernel's buffers are
                started = time.perf_counter()
                np.copyto(target, source)
                copy_s += time.perf_counter() - started
                steps += len(source) // 2
        motion.take_events()
    return _Run(steps, kernel_s, copy_s)


def figures(kernel: Kernel) -> list[KernelFigure]:
    """The whole table for one kernel; the first load warms it up and is measured again."""
    loads = loads_for(kernel)
    _once(kernel, loads[0])
    return [measure(kernel, load) for load in loads]
