"""Print the tables of all benchmarks: `python -m steptwin.bench`, or `make bench`."""

import os
import platform
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.util import find_spec
from typing import TypeVar

from rich.console import Console
from rich.table import Table

from steptwin.bench import cyclic, drawer_pull, driver, kernel, kinematics, live_tables, timing, waveforms
from steptwin.bench.loads import AXES
from steptwin.bench.pulses import scaling
from steptwin.bench.pulses.motions import all_motions
from steptwin.bench.pulses.table import COLUMNS, measured, table_rows
from steptwin.controller.backend import KERNELS, Kernel
from steptwin.host.cli.output import print_table

Row = TypeVar("Row")


def main() -> None:
    """Measure with every kernel that is installed; print each table as soon as it is measured."""
    console = Console(highlight=False, width=110)
    kernels = [KERNELS["python"]()] + ([KERNELS["numba"]()] if find_spec("numba") else [])
    fastest = kernels[-1]
    processor = platform.processor() or platform.machine()
    console.print(f"{processor}, {os.cpu_count()} cores, Python {platform.python_version()}")
    console.print(_kernel_table(kernels))
    console.print(_drawer_pull_table(kernels))
    console.print("Pulse timing: the kernel beside other methods, against the exact crossings of the planned motion")
    print_table(list(COLUMNS), table_rows(measured(all_motions(), fastest)), text_columns=2)
    for table in _scaling_tables(fastest):
        console.print(table)
    console.print(_timing_table(fastest))
    console.print(_cyclic_table(fastest))
    console.print(_driver_table())
    console.print(_waveform_table())
    console.print(_kinematics_table())
    live_tables.print_live(console, stream_s=10.0, flood_frames=100_000)


def _table(title: str, rows: Iterable[Row], columns: Mapping[str, Callable[[Row], str]]) -> Table:
    """Make a table of `rows`; each column has its heading and the text that it shows of a row."""
    table = Table(*columns, title=title or None)
    for row in rows:
        table.add_row(*(text(row) for text in columns.values()))
    return table


def _kernel_table(kernels: list[Kernel]) -> Table:
    return _table(
        f"Kernel: {AXES} axes, one core, driver limits lifted; beside numpy copies of the bytes that it writes",
        (figure for chosen in kernels for figure in kernel.figures(chosen)),
        {
            "kernel": lambda row: row.kernel,
            "load": lambda row: row.load,
            "steps": lambda row: f"{row.steps}",
            "M steps/s": lambda row: f"{row.steps_per_s / 1e6:.2f}",
            "x copy, memory": lambda row: f"{row.memory_copy_ratio:.1f}",
            "x copy, cache": lambda row: f"{row.cached_copy_ratio:.1f}",
            "simulated s / s": lambda row: f"{row.simulated_per_wall:.0f}",
        },
    )


def _drawer_pull_table(kernels: list[Kernel]) -> Table:
    return _table(
        "Drawer pull: six axes over CAN at 100 points/s, 10 s of motion",
        map(drawer_pull.measure, kernels),
        {
            "kernel": lambda row: row.kernel,
            "frames": lambda row: f"{row.frames}",
            "emulation s": lambda row: f"{row.emulation_s:.3f}",
            "verification s": lambda row: f"{row.verification_s:.3f}",
            "x real time": lambda row: f"{row.simulated_per_wall:.0f}",
            "position error, steps": lambda row: f"{row.error_steps_max:.4f}",
            "timing p50, us": lambda row: f"{row.timing_us_p50:.2f}",
        },
    )


def _scaling_tables(chosen: Kernel) -> Iterator[Table]:
    for quantity, costs in (
        ("axes, at 14 kHz", scaling.by_axes(chosen)),
        ("steps/s, seven axes", scaling.by_rate(chosen)),
        ("points/s and axis, seven axes, sine of 14 kHz peak", scaling.by_points(chosen)),
    ):
        columns: dict[str, Callable[[scaling.Cost], str]] = {
            quantity: lambda row: f"{row.x:g}",
            "ns per axis and tick": lambda row: f"{row.ns_per_axis_tick:.1f}",
            "M steps/s": lambda row: f"{row.steps_per_s / 1e6:.1f}",
            "M steps/s, with feeding and draining": lambda row: f"{row.fed_steps_per_s / 1e6:.1f}",
        }
        yield _table("", costs, columns)
    yield _table(
        "Length: a process each, all included",
        scaling.by_length(),
        {
            "steps": lambda row: f"{row.steps}",
            "simulated s": lambda row: f"{row.simulated_s:g}",
            "s": lambda row: f"{row.wall_s:.2f}",
            "peak memory, MB": lambda row: f"{row.peak_mb:.0f}",
        },
    )


def _timing_table(chosen: Kernel) -> Table:
    return _table(
        f"Timing error: sines of {timing.SINE_HZ:g} Hz, points every 10 ms, TB6560 pulse timing",
        timing.figures(chosen),
        {
            "load": lambda row: row.load,
            "steps": lambda row: f"{row.steps}",
            "delayed": lambda row: f"{row.delayed}",
            "max error, steps": lambda row: f"{row.error_steps_max:.5f}",
            "rms, us": lambda row: f"{row.error_us_rms:.3f}",
            "p99, us": lambda row: f"{row.error_us_p99:.3f}",
        },
    )


def _cyclic_table(chosen: Kernel) -> Table:
    return _table(
        f"Cyclic synchronous position: sines of {timing.SINE_HZ:g} Hz, set-points to the unit",
        cyclic.figures(chosen),
        {
            "peak steps/s": lambda row: f"{row.peak_hz:g}",
            "period, ms": lambda row: f"{row.period_ms}",
            "max error, steps": lambda row: f"{row.error_steps_max:.5f}",
            "rms": lambda row: f"{row.error_steps_rms:.5f}",
            "max at the start": lambda row: (
                "-" if row.start_error_steps_max is None else f"{row.start_error_steps_max:.5f}"
            ),
        },
    )


def _driver_table() -> Table:
    return _table(
        f"Drivers: CLK edges processed, {driver.PULSES} pulses at a time; ratio to copying them",
        driver.figures(),
        {
            "driver": lambda row: row.profile,
            "M edges/s": lambda row: f"{row.edges_per_s / 1e6:.0f}",
            "x numpy copy": lambda row: f"{row.copy_ratio:.1f}",
        },
    )


def _waveform_table() -> Table:
    return _table(
        f"Waveforms: {AXES} axes for {waveforms.DURATION_S} s at 14 kHz; ratio to copying the text once",
        waveforms.figures(),
        {
            "file": lambda row: row.form,
            "edges": lambda row: f"{row.edges}",
            "M edges/s": lambda row: f"{row.edges_per_s / 1e6:.1f}",
            "x numpy copy": lambda row: f"{row.copy_ratio:.0f}",
            "MB beside the edges": lambda row: f"{row.peak_mb:.0f}",
            "a tenth": lambda row: f"{row.peak_mb_tenth:.0f}",
        },
    )


def _kinematics_table() -> Table:
    return _table(
        f"Kinematics: batches of {kinematics.BATCH}, one core; ratio to the sines of all joint values",
        kinematics.figures(),
        {
            "robot": lambda row: row.robot,
            "way": lambda row: row.way,
            "branches": lambda row: f"{row.branches}",
            "M poses/s": lambda row: f"{row.poses_per_s / 1e6:.2f}",
            "ns a pose": lambda row: f"{1e9 / row.poses_per_s:.0f}",
            "x numpy sin": lambda row: f"{row.sin_ratio:.1f}",
        },
    )


if __name__ == "__main__":
    main()
