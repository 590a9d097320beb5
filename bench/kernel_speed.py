"""Measure the kernel: how many steps a second it places by axes, rate, points and length, and how exact its edges are.

Beside the kernel stand plain numpy copies of as many bytes as it writes. The first copy takes all edges of the motion
at once, from memory to memory, as keeping a trace does. The second takes one drained buffer at a time, within the
processor's caches, where the kernel's buffers are.

A motion of any length needs the same memory, since edges are handed out and dropped and records are made on demand.
Memory is measured in a process of its own: `python -m steptwin.bench.kernel_speed STEPS` runs one length.

Edges are held against the ideal motion: those of PVT points at the kernel, of set-points at the firmware. All motions
are sines then, and the pulse timing is the TB6560's.
"""

import json
import struct
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from typing import NamedTuple

import numpy as np
from rich.table import Table

from steptwin.bench import bench_table
from steptwin.bench.live_server import of_process, sdo_write
from steptwin.bench.step_methods.evaluation import ideal_of, step_errors
from steptwin.bench.step_methods.kernel import (
    UNLIMITED,
    Advance,
    Load,
    board_motion_of,
    constant,
    place_on,
    pulses_of,
    ready,
    run,
    sine,
)
from steptwin.bench.step_methods.motions import AXES, MICROSTEPS, POINT_MS, PlannedMotion, Sines, sines
from steptwin.controller.motion.axis_motion import PinEdges
from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.controller.motion.kernel import TICK_COUNTS, TICKS_PER_MS
from steptwin.controller.node.firmware import Firmware
from steptwin.host.common.arrays import Int64Array
from steptwin.host.robots import load_robot
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, SHUTDOWN, Mode
from steptwin.protocol.frame import COB_NMT, COB_RPDO, COB_SYNC, FIRST_NODE_ID, Frame
from steptwin.protocol.nmt import NmtCommand
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

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
PEAKS_HZ = (300.0, 2_000.0, 14_000.0)
SINE_HZ = 0.5
PERIODS_MS = (1, 2, 5, 10)
_SETTINGS = (
    (od.MICROSTEPS, MICROSTEPS),
    (od.CONTROLWORD, SHUTDOWN),
    (od.CONTROLWORD, ENABLE_OPERATION),
    (od.MODE_OF_OPERATION, Mode.CYCLIC_SYNCHRONOUS_POSITION),
)


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


def timing_table(kernel: Kernel) -> Table:
    """Measure one sine period for each peak rate, with points every 10 ms."""
    return bench_table(
        f"Timing error: sines of {SINE_HZ:g} Hz, points every 10 ms, TB6560 pulse timing",
        "load|steps|delayed|max error, steps|rms, us|p99, us",
        (_timing_row(kernel, peak_hz) for peak_hz in PEAKS_HZ),
    )


def _timing_row(kernel: Kernel, peak_hz: float) -> str:
    planned = _sine(peak_hz, POINT_MS)
    motion = board_motion_of(kernel, planned)
    errors = step_errors(planned, 0, ideal_of(planned)[0], place_on(motion, planned).axes[0])
    return (
        f"{planned.name}|{len(errors.steps)}|{motion.axes[0].delayed_steps}|{np.abs(errors.steps).max():.5f}|"
        f"{np.sqrt(np.mean(errors.timing_us**2)):.3f}|{np.percentile(np.abs(errors.timing_us), 99):.3f}"
    )


def _sine(peak_hz: float, point_ms: int) -> PlannedMotion:
    """Plan one period of a sine of one axis."""
    name = f"sine, {peak_hz / 1000:g} kHz peak"
    return sines(name, Sines((1,), peak_hz, 1 / SINE_HZ), load_robot("warehouse-scara").board, point_ms)


def cyclic_table(kernel: Kernel) -> Table:
    """Measure one sine period in cyclic synchronous position for each peak rate and set-point period."""
    return bench_table(
        f"Cyclic synchronous position: sines of {SINE_HZ:g} Hz, set-points to the unit",
        "peak steps/s|period, ms|max error, steps|rms|max at the start",
        (_cyclic_row(kernel, peak_hz, period_ms) for peak_hz in PEAKS_HZ for period_ms in PERIODS_MS),
    )


def _cyclic_row(kernel: Kernel, peak_hz: float, period_ms: int) -> str:
    """Compare every edge with the sine, which the axis follows 1.5 periods and a tick late.

    The start is the first two periods; a slow axis makes no step in them.
    """
    host, planned = _Host(kernel, period_ms), _sine(peak_hz, period_ms)
    begin_counts = host.now_counts + 3 * period_ms * COUNTS_PER_MS // 2 + TICK_COUNTS
    made = pulses_of(host.stream(planned.points_units[0]))
    rises, turns = made.rise_counts - begin_counts, made.dir_counts - begin_counts
    on_time = replace(made, rise_counts=rises, dir_counts=turns)
    error_steps = np.abs(step_errors(planned, 0, ideal_of(planned)[0], on_time).steps)
    t_s = rises / COUNTS_PER_SECOND
    at_start = t_s < 2 * period_ms / 1000
    within = error_steps[~at_start & (t_s < 1 / SINE_HZ - 2 * period_ms / 1000)]
    start = f"{error_steps[at_start].max():.5f}" if at_start.any() else "-"
    return f"{peak_hz:g}|{period_ms}|{within.max():.5f}|{np.sqrt(np.mean(within**2)):.5f}|{start}"


class _Host:
    """A firmware without bus or driver; its single axis is enabled in cyclic synchronous position."""

    def __init__(self, kernel: Kernel, period_ms: int) -> None:
        self.now_counts = 0
        self._period_counts = period_ms * COUNTS_PER_MS
        self._firmware = Firmware(kernel, axis_count=1)
        self._firmware.boot(0)
        self._send(Frame(COB_NMT, bytes((NmtCommand.START, FIRST_NODE_ID))))
        for address, value in (*_SETTINGS, (od.INTERPOLATION_PERIOD, period_ms)):
            self._send(sdo_write(0, address, value))

    def _send(self, frame: Frame) -> None:
        self._firmware.receive(frame, self.now_counts)
        self._firmware.poll(self.now_counts)

    def stream(self, points_units: Int64Array) -> list[PinEdges]:
        """Send a set-point and a SYNC each period, the last point four more times; return all edges."""
        drained: list[PinEdges] = []
        for point_units in [*points_units, *points_units[-1:].repeat(4)]:
            self._send(Frame(COB_RPDO[2] + FIRST_NODE_ID, struct.pack("<i", int(point_units))))
            self._send(Frame(COB_SYNC, b""))
            self._wait(self._period_counts)
            drained += self._firmware.motion.take_edges()
        return drained

    def _wait(self, duration_counts: int) -> None:
        until_counts = self.now_counts + duration_counts
        while self.now_counts < until_counts:
            due_counts = self._firmware.next_due_counts
            goal_counts = until_counts if due_counts is None else max(self.now_counts, min(until_counts, due_counts))
            self.now_counts = self._firmware.advance(goal_counts)
            self._firmware.poll(self.now_counts)
            while self._firmware.transmit.take((), 0, self.now_counts):
                pass


if __name__ == "__main__":
    print(json.dumps(asdict(run_length(fastest_kernel(), int(sys.argv[1])))))
