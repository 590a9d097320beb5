"""Print all tables: `python -m steptwin.bench`, or `make bench`."""

import os
import platform
from importlib.util import find_spec

from rich.console import Console
from rich.table import Table

from steptwin.bench import cyclic, drawer_pull, driver, kernel, kinematics, live_tables, timing, waveforms
from steptwin.bench.loads import AXES
from steptwin.bench.pulses import scaling
from steptwin.bench.pulses.motions import all_motions
from steptwin.bench.pulses.table import COLUMNS, measured, table_rows
from steptwin.controller.backend import KERNELS, Kernel
from steptwin.host.cli.output import print_table


def main() -> None:
    """Measure with every kernel that is installed."""
    console = Console(highlight=False, width=110)
    kernels = [KERNELS["python"]()] + ([KERNELS["numba"]()] if find_spec("numba") else [])
    console.print(
        f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"
    )

    table = Table(
        "kernel", "load", "steps", "M steps/s", "x copy, memory", "x copy, cache", "simulated s / s",
        title=_KERNEL_TITLE,
    )  # fmt: skip
    for chosen in kernels:
        for k in kernel.figures(chosen):
            table.add_row(
                k.kernel,
                k.load,
                f"{k.steps}",
                f"{k.steps_per_s / 1e6:.2f}",
                f"{k.memory_copy_ratio:.1f}",
                f"{k.cached_copy_ratio:.1f}",
                f"{k.simulated_per_wall:.0f}",
            )
    console.print(table)

    table = Table(
        "kernel", "frames", "emulation s", "verification s", "x real time", "position error, steps", "timing p50, us",
        title="Drawer pull: six axes over CAN at 100 points/s, 10 s of motion",
    )  # fmt: skip
    for chosen in kernels:
        d = drawer_pull.measure(chosen)
        table.add_row(
            d.kernel,
            f"{d.frames}",
            f"{d.emulation_s:.3f}",
            f"{d.verification_s:.3f}",
            f"{d.simulated_per_wall:.0f}",
            f"{d.error_steps_max:.4f}",
            f"{d.timing_us_p50:.2f}",
        )
    console.print(table)

    console.print(_PULSES_TITLE)
    print_table(list(COLUMNS), table_rows(measured(all_motions(), kernels[-1])), text_columns=2)
    _print_scaling(console, kernels[-1])

    table = Table("load", "steps", "delayed", "max error, steps", "rms, us", "p99, us", title=_TIMING_TITLE)
    for t in timing.figures(kernels[-1]):
        table.add_row(
            t.load,
            f"{t.steps}",
            f"{t.delayed}",
            f"{t.error_steps_max:.5f}",
            f"{t.error_us_rms:.3f}",
            f"{t.error_us_p99:.3f}",
        )
    console.print(table)

    table = Table("peak steps/s", "period, ms", "max error, steps", "rms", "max at the start", title=_CYCLIC_TITLE)
    for y in cyclic.figures(kernels[-1]):
        table.add_row(
            f"{y.peak_hz:g}",
            f"{y.period_ms}",
            f"{y.error_steps_max:.5f}",
            f"{y.error_steps_rms:.5f}",
            "-" if y.start_error_steps_max is None else f"{y.start_error_steps_max:.5f}",
        )
    console.print(table)

    table = Table("driver", "M edges/s", "x numpy copy", title=_DRIVER_TITLE)
    for chip in driver.figures():
        table.add_row(chip.profile, f"{chip.edges_per_s / 1e6:.0f}", f"{chip.copy_ratio:.1f}")
    console.print(table)

    table = Table("file", "edges", "M edges/s", "x numpy copy", "MB beside the edges", "a tenth", title=_WAVEFORM_TITLE)
    for w in waveforms.figures():
        table.add_row(
            w.form,
            f"{w.edges}",
            f"{w.edges_per_s / 1e6:.1f}",
            f"{w.copy_ratio:.0f}",
            f"{w.peak_mb:.0f}",
            f"{w.peak_mb_tenth:.0f}",
        )
    console.print(table)

    table = Table("robot", "way", "branches", "M poses/s", "ns a pose", "x numpy sin", title=_KINEMATICS_TITLE)
    for f in kinematics.figures():
        table.add_row(
            f.robot,
            f.way,
            f"{f.branches}",
            f"{f.poses_per_s / 1e6:.2f}",
            f"{1e9 / f.poses_per_s:.0f}",
            f"{f.sin_ratio:.1f}",
        )
    console.print(table)

    live_tables.print_live(console, stream_s=10.0, flood_frames=100_000)


def _print_scaling(console: Console, kernel: Kernel) -> None:
    for what, costs in (
        ("axes, at 14 kHz", scaling.by_axes(kernel)),
        ("steps/s, seven axes", scaling.by_rate(kernel)),
        ("points/s and axis, seven axes, sine of 14 kHz peak", scaling.by_points(kernel)),
    ):
        table = Table(what, "ns per axis and tick", "M steps/s", "M steps/s, with feeding and draining")
        for cost in costs:
            figures = cost.ns_per_axis_tick, cost.steps_per_s / 1e6, cost.fed_steps_per_s / 1e6
            table.add_row(f"{cost.x:g}", *(f"{figure:.1f}" for figure in figures))
        console.print(table)
    table = Table("steps", "simulated s", "s", "peak memory, MB", title="Length: a process each, all included")
    for length in scaling.by_length():
        table.add_row(f"{length.steps}", f"{length.simulated_s:g}", f"{length.wall_s:.2f}", f"{length.peak_mb:.0f}")
    console.print(table)


_KERNEL_TITLE = f"Kernel: {AXES} axes, one core, driver limits lifted; beside numpy copies of the bytes that it writes"
_TIMING_TITLE = f"Timing error: sines of {timing.SINE_HZ:g} Hz, points every 10 ms, TB6560 pulse timing"
_PULSES_TITLE = "Pulse timing: the kernel beside other methods, against the exact crossings of the planned motion"
_CYCLIC_TITLE = f"Cyclic synchronous position: sines of {timing.SINE_HZ:g} Hz, set-points to the unit"
_DRIVER_TITLE = f"Drivers: CLK edges looked at, {driver.PULSES} pulses a look; ratio to copying them"
_WAVEFORM_TITLE = f"Waveforms: {AXES} axes for {waveforms.DURATION_S} s at 14 kHz; ratio to copying the text once"
_KINEMATICS_TITLE = f"Kinematics: batches of {kinematics.BATCH}, one core; ratio to the sines of all joint values"

if __name__ == "__main__":
    main()
