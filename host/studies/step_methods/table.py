"""List all methods, measure them on all motions; format the figures as a table or as a JSON document."""

import os
import platform
from collections.abc import Iterable
from dataclasses import asdict
from functools import partial
from typing import Any

from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.host.studies.step_methods import Method
from steptwin.host.studies.step_methods.cortex_m3 import CoreFigures, core_figures
from steptwin.host.studies.step_methods.evaluation import MethodErrors, figures_of, ideal_of
from steptwin.host.studies.step_methods.kernel import kernel_method
from steptwin.host.studies.step_methods.motions import PlannedMotion
from steptwin.host.studies.step_methods.usual_methods import austin, bresenham, dda

COLUMNS = (
    "motion", "method", "steps", "-", "+", "err max", "err rms", "p50 us", "p99 us", "max us", "jitter us", "broken",
    "M steps/s", "M3 %",
)  # fmt: skip
"""Steps made, missing and extra; position error in steps; timing error; rms jitter of intervals at constant speed;
driver limits broken; steps placed per second on this machine; load of the board's processor in the busiest 10 ms,
metered on an emulated core."""


def measured(motions: Iterable[PlannedMotion], kernel: Kernel) -> tuple[list[MethodErrors], list[CoreFigures]]:
    """Measure every method on every motion, and the kernel on an emulated Cortex-M3 where that can be done."""
    found: list[MethodErrors] = []
    on_core: list[CoreFigures] = []
    for motion in motions:
        ideal = ideal_of(motion)
        metered = core_figures(motion, kernel)
        loads = {"kernel": metered[0].busiest_percent} if metered else {}
        found += [figures_of(motion, ideal, method, loads.get(method.key)) for method in methods(kernel)]
        on_core += metered
    return found, on_core


def document(figures: list[MethodErrors], on_core: list[CoreFigures], kernel: Kernel) -> dict[str, Any]:
    """Return the document of `steptwin bench --json`: `MethodErrors` of each method and motion, and `CoreFigures`."""
    machine = {
        "processor": platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "kernel": kernel.name,
    }
    return {"machine": machine, "rows": [asdict(row) for row in figures], "cortex_m3": [asdict(row) for row in on_core]}


def table_rows(figures: list[MethodErrors]) -> list[list[str]]:
    """Return the figures as texts, one row each, in the order of COLUMNS."""
    return [
        [
            row.motion,
            row.method,
            *(str(count) for count in (row.steps, row.missing, row.extra)),
            f"{row.error_steps_max:.4f}",
            f"{row.error_steps_rms:.4f}",
            *(_us(value) for value in (row.timing_us_p50, row.timing_us_p99, row.timing_us_max, row.jitter_us_rms)),
            str(row.violations),
            f"{row.steps_per_s / 1e6:.1f}",
            "-" if row.cortex_m3_percent is None else f"{row.cortex_m3_percent:.1f}",
        ]
        for row in figures
    ]


def _us(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}" if value < 10 else f"{value:.1f}"


DDA_HZ = (20_000, 40_000, 100_000)


def methods(kernel: Kernel | None = None) -> list[Method]:
    """Return the firmware's kernel (by default the fastest one installed) and the methods in common use."""
    return [
        Method("kernel", "the kernel", partial(kernel_method, kernel or fastest_kernel())),
        *(Method(f"dda-{hz // 1000}k", f"DDA at {hz // 1000} kHz", partial(dda, hz)) for hz in DDA_HZ),
        Method("bresenham", "Bresenham, 10 ms", bresenham),
        Method("austin", "Austin's ramp", austin),
    ]
