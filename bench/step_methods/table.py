"""List all methods, measure them on all motions, and print the figures as tables."""

from collections.abc import Iterable
from functools import partial

from steptwin.bench.step_methods import Method
from steptwin.bench.step_methods.cortex_m3 import COLUMNS as CORE_COLUMNS
from steptwin.bench.step_methods.cortex_m3 import CoreFigures, core_figures, core_rows
from steptwin.bench.step_methods.evaluation import MethodErrors, figures_of, ideal_of
from steptwin.bench.step_methods.kernel import kernel_method
from steptwin.bench.step_methods.motions import PlannedMotion
from steptwin.bench.step_methods.usual_methods import austin, bresenham, dda
from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.host.cli.output import print_table, say
from steptwin.host.common.extras import installing

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


def print_figures(figures: list[MethodErrors], on_core: list[CoreFigures]) -> None:
    """Print the table of the methods, and that of the kernel on an emulated core where that was metered."""
    print_table(list(COLUMNS), table_rows(figures), text_columns=2)
    if on_core:
        flash = f"{on_core[0].text_bytes} bytes of flash"
        say(f"The kernel on an emulated Cortex-M3, in each motion's busiest 100 ms; {flash}:")
        print_table(list(CORE_COLUMNS), core_rows(on_core), text_columns=1)
    else:
        say(f"no Cortex-M3: it needs numba, unicorn ({installing('fast', 'm3')}) and arm-none-eabi-gcc", err=True)


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
