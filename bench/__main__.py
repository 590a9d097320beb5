"""Print the tables of all benchmarks: `python -m steptwin.bench`, or `make bench`.

`python -m steptwin.bench panel` prints only those of the operator's panel, `python -m steptwin.bench motors` those of
motors after a run, `python -m steptwin.bench live-motors [PAIRS]` those of motors that turn with a live board, and
`python -m steptwin.bench workers` that of a campaign's workers.
"""

import os
import platform
import sys
from collections.abc import Iterable, Iterator
from importlib.util import find_spec

from rich.console import Console
from rich.table import Table

from steptwin.bench import (
    compiled,
    cyclic,
    drawer_pull,
    driver_speed,
    kernel_speed,
    kinematics,
    rotors,
    scaling,
    timing,
    waveforms,
    workers,
)
from steptwin.bench.live import live_tables, turning_motors
from steptwin.bench.panel import panel_tables
from steptwin.controller.motion.backend import KERNELS, Kernel
from steptwin.host.cli.output import print_table
from steptwin.host.studies.step_methods.cortex_m3 import COLUMNS as CORE_COLUMNS
from steptwin.host.studies.step_methods.cortex_m3 import core_rows
from steptwin.host.studies.step_methods.loads import AXES
from steptwin.host.studies.step_methods.motions import all_motions
from steptwin.host.studies.step_methods.table import COLUMNS, measured, table_rows


def main() -> None:
    """Measure with every kernel that is installed; print each table as soon as it is measured."""
    console = Console(highlight=False, width=110)
    if sys.argv[1:] == ["panel"]:
        panel_tables.print_panel(console)
        return
    if sys.argv[1:] == ["motors"]:
        console.print(_rotor_table())
        return
    if sys.argv[1:2] == ["live-motors"]:
        console.print(_live_motors_table(*map(int, sys.argv[2:3])))
        return
    if sys.argv[1:] == ["workers"]:
        console.print(_workers_table())
        return
    kernels = [KERNELS["python"]()] + ([KERNELS["numba"]()] if find_spec("numba") else [])
    fastest = kernels[-1]
    processor = platform.processor() or platform.machine()
    console.print(f"{processor}, {os.cpu_count()} cores, Python {platform.python_version()}")
    console.print(_kernel_table(kernels))
    console.print(_drawer_pull_table(kernels))
    console.print(_compiled_text())
    console.print("Pulse timing: the kernel beside other methods, against the exact crossings of the planned motion")
    figures, on_core = measured(all_motions(), fastest)
    print_table(list(COLUMNS), table_rows(figures), text_columns=2)
    if on_core:
        console.print(f"The kernel on an emulated Cortex-M3, {on_core[0].text_bytes} bytes of flash; busiest 100 ms")
        print_table(list(CORE_COLUMNS), core_rows(on_core), text_columns=1)
    for table in _scaling_tables(fastest):
        console.print(table)
    console.print(_timing_table(fastest))
    console.print(_cyclic_table(fastest))
    console.print(_driver_table())
    console.print(_waveform_table())
    console.print(_kinematics_table())
    console.print(_rotor_table())
    if find_spec("distributed"):
        console.print(_workers_table())
    panel_tables.print_panel(console)
    live_tables.print_live(console, stream_s=10.0, flood_frames=100_000)


def _table(title: str, headings: str, rows: Iterable[str]) -> Table:
    """Make a table of headings and rows whose cells are separated by `|`, as in Markdown."""
    table = Table(*headings.split("|"), title=title or None)
    for row in rows:
        table.add_row(*row.split("|"))
    return table


def _kernel_table(kernels: list[Kernel]) -> Table:
    return _table(
        f"Kernel: {AXES} axes, one core, driver limits lifted; beside numpy copies of the bytes that it writes",
        "kernel|load|steps|M steps/s|x copy, memory|x copy, cache|simulated s / s",
        (
            f"{row.kernel}|{row.load}|{row.steps}|{row.steps_per_s / 1e6:.2f}|{row.memory_copy_ratio:.1f}|"
            f"{row.cached_copy_ratio:.1f}|{row.simulated_per_wall:.0f}"
            for chosen in kernels
            for row in kernel_speed.figures(chosen)
        ),
    )


def _drawer_pull_table(kernels: list[Kernel]) -> Table:
    return _table(
        "Drawer pull: six axes over CAN at 100 points/s, 10 s of motion",
        "kernel|frames|emulation s|verification s|x real time|x bare bus|position error, steps|timing p50, us",
        (
            f"{row.kernel}|{row.frames}|{row.emulation_s:.3f}|{row.verification_s:.3f}|{row.simulated_per_wall:.0f}|"
            f"{row.bare_bus_ratio:.0f}|{row.error_steps_max:.4f}|{row.timing_us_p50:.2f}"
            for row in map(drawer_pull.measure, kernels)
        ),
    )


def _compiled_text() -> str:
    figure = compiled.measure()
    if figure is None:
        return "No modules are compiled here: docs/benchmarks.md says how to install a wheel with compiled ones"
    return (
        f"Drawer pull with compiled modules {figure.compiled_s:.3f} s, with their sources {figure.sources_s:.3f} s:"
        f" {figure.sources_s / figure.compiled_s:.2f} times as long;"
        f" {figure.compiled_ratio:.0f} and {figure.sources_ratio:.0f} times as long as a bare bus with the same frames"
    )


def _rotor_table() -> Table:
    return _table(
        "Motors after a run: rotors of all axes, one core",
        "run|axes|simulated s|s|x real time",
        (
            f"{row.robot} {row.job}|{row.axes}|{row.simulated_s:.1f}|{row.wall_s:.2f}|{row.simulated_per_wall:.1f}"
            for row in rotors.figures()
        ),
    )


def _workers_table() -> Table:
    figure = workers.measure()
    return _table(
        "Campaigns: drawer pulls a second, verified, without recovery",
        "made by|one|two|two against one",
        (
            f"{words}|{one:.2f}|{two:.2f}|{two / one:.2f}"
            for words, (one, two) in (("plain processes", figure.processes), ("workers", figure.workers))
        ),
    )


def _live_motors_table(pairs: int = turning_motors.PAIRS) -> Table:
    found = turning_motors.measure(pairs)
    quantities = {
        "ticks_us_p50": "lateness of ticks, p50, us",
        "ticks_us_p99": "lateness of ticks, p99, us",
        "cores": "cores that the server uses",
    }
    return _table(
        f"A live board without and with motors, in turns, six axes at 1000 steps/s: medians of {pairs}",
        "quantity|without|with|without, from to",
        (
            f"{words}|{without:.4g}|{turning:.4g}|{least:.4g} to {most:.4g}"
            for figure, words in quantities.items()
            for without, turning in (found.medians(figure),)
            for least, most in (found.range_without(figure),)
        ),
    )


def _scaling_tables(chosen: Kernel) -> Iterator[Table]:
    for quantity, costs in (
        ("axes, at 14 kHz", scaling.by_axes(chosen)),
        ("steps/s, seven axes", scaling.by_rate(chosen)),
        ("points/s and axis, seven axes, sine of 14 kHz peak", scaling.by_points(chosen)),
    ):
        yield _table(
            "",
            f"{quantity}|ns per axis and tick|M steps/s|M steps/s, with feeding and draining",
            (
                f"{row.x:g}|{row.ns_per_axis_tick:.1f}|{row.steps_per_s / 1e6:.1f}|{row.fed_steps_per_s / 1e6:.1f}"
                for row in costs
            ),
        )
    yield _table(
        "Length: a process each, all included",
        "steps|simulated s|s|peak memory, MB",
        (f"{row.steps}|{row.simulated_s:g}|{row.wall_s:.2f}|{row.peak_mb:.0f}" for row in scaling.by_length()),
    )


def _timing_table(chosen: Kernel) -> Table:
    return _table(
        f"Timing error: sines of {timing.SINE_HZ:g} Hz, points every 10 ms, TB6560 pulse timing",
        "load|steps|delayed|max error, steps|rms, us|p99, us",
        (
            f"{row.load}|{row.steps}|{row.delayed}|{row.error_steps_max:.5f}|{row.error_us_rms:.3f}|{row.error_us_p99:.3f}"
            for row in timing.figures(chosen)
        ),
    )


def _cyclic_table(chosen: Kernel) -> Table:
    def at_start(error_steps_max: float | None) -> str:
        return "-" if error_steps_max is None else f"{error_steps_max:.5f}"

    return _table(
        f"Cyclic synchronous position: sines of {timing.SINE_HZ:g} Hz, set-points to the unit",
        "peak steps/s|period, ms|max error, steps|rms|max at the start",
        (
            f"{row.peak_hz:g}|{row.period_ms}|{row.error_steps_max:.5f}|{row.error_steps_rms:.5f}|"
            f"{at_start(row.start_error_steps_max)}"
            for row in cyclic.figures(chosen)
        ),
    )


def _driver_table() -> Table:
    return _table(
        f"Drivers: CLK edges processed, {driver_speed.PULSES} pulses at a time; ratio to copying them",
        "driver|M edges/s|x numpy copy",
        (f"{row.profile}|{row.edges_per_s / 1e6:.0f}|{row.copy_ratio:.1f}" for row in driver_speed.figures()),
    )


def _waveform_table() -> Table:
    return _table(
        f"Waveforms: {AXES} axes for {waveforms.DURATION_S} s at 14 kHz; ratio to copying the text once",
        "file|edges|M edges/s|x numpy copy|MB beside the edges|a tenth",
        (
            f"{row.form}|{row.edges}|{row.edges_per_s / 1e6:.1f}|{row.copy_ratio:.0f}|{row.peak_mb:.0f}|"
            f"{row.peak_mb_tenth:.0f}"
            for row in waveforms.figures()
        ),
    )


def _kinematics_table() -> Table:
    return _table(
        f"Kinematics: batches of {kinematics.BATCH}, one core; ratio to the sines of all joint values",
        "robot|way|branches|M poses/s|ns a pose|x numpy sin",
        (
            f"{row.robot}|{row.way}|{row.branches}|{row.poses_per_s / 1e6:.2f}|{1e9 / row.poses_per_s:.0f}|"
            f"{row.sin_ratio:.1f}"
            for row in kinematics.figures()
        ),
    )


if __name__ == "__main__":
    main()
