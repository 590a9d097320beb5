"""Measure how far edges are from the ideal motion: of PVT points at the kernel, of set-points at the firmware.

All are sines, and the pulse timing is the TB6560's.
"""

import struct

import numpy as np
from rich.table import Table

from steptwin.bench.bench_table import bench_table
from steptwin.bench.live_server import sdo_write
from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.board_motion import PinEdges
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.controller.node.firmware import Firmware
from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.studies.step_methods.loads import MICROSTEPS, TB6560_TIMING, UNITS_PER_STEP, ready, run, sine
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, SHUTDOWN, Mode
from steptwin.protocol.frame import COB_NMT, COB_RPDO, COB_SYNC, FIRST_NODE_ID, Frame
from steptwin.protocol.nmt import NmtCommand
from steptwin.protocol.timer import COUNTS_PER_SECOND

PEAKS_HZ = (300.0, 2_000.0, 14_000.0)
SINE_HZ = 0.5
THRESHOLD_STEPS = 9 / 16
PERIODS_MS = (1, 2, 5, 10)
_MS_COUNTS = COUNTS_PER_SECOND // 1000
_SETTINGS = (
    (od.MICROSTEPS, MICROSTEPS),
    (od.CONTROLWORD, SHUTDOWN),
    (od.CONTROLWORD, ENABLE_OPERATION),
    (od.MODE_OF_OPERATION, Mode.CYCLIC_SYNCHRONOUS_POSITION),
)


def timing_table(kernel: Kernel) -> Table:
    """Measure one sine period for each peak rate, with points every 10 ms."""
    return bench_table(
        f"Timing error: sines of {SINE_HZ:g} Hz, points every 10 ms, TB6560 pulse timing",
        "load|steps|delayed|max error, steps|rms, us|p99, us",
        (_timing_row(kernel, peak_hz) for peak_hz in PEAKS_HZ),
    )


def _timing_row(kernel: Kernel, peak_hz: float) -> str:
    """Compare every edge with A (1 - cos wt): in steps at the edge's time, and in time by the speed there."""
    load = sine(peak_hz, SINE_HZ, 1)
    motion = ready(kernel, TB6560_TIMING, axes=1)
    rises, signs = _steps_of([edges for advance in run(motion, load) for edges in advance.edges])
    t_s = rises / COUNTS_PER_SECOND
    error_steps = _errors_steps(t_s, signs, peak_hz)
    speed_hz = peak_hz * np.abs(np.sin(2 * np.pi * SINE_HZ * t_s))
    fast = speed_hz > 0.01 * peak_hz  # at lower speeds the time of a crossing is ill-defined
    error_us = np.abs(error_steps[fast]) / speed_hz[fast] * 1e6
    return (
        f"{load.name}|{len(rises)}|{motion.delayed_steps(0)}|{np.abs(error_steps).max():.5f}|"
        f"{np.sqrt(np.mean(error_us**2)):.3f}|{np.percentile(error_us, 99):.3f}"
    )


def cyclic_table(kernel: Kernel) -> Table:
    """Measure one sine period in cyclic synchronous position for each peak rate and set-point period."""
    return bench_table(
        f"Cyclic synchronous position: sines of {SINE_HZ:g} Hz, set-points to the unit",
        "peak steps/s|period, ms|max error, steps|rms|max at the start",
        (_cyclic_row(kernel, peak_hz, period_ms) for peak_hz in PEAKS_HZ for period_ms in PERIODS_MS),
    )


def _cyclic_row(kernel: Kernel, peak_hz: float, period_ms: int) -> str:
    """Compare every edge with A (1 - cos wt), which the axis follows 1.5 periods and a tick late.

    The start is the first two periods; a slow axis makes no step in them.
    """
    host = _Host(kernel, period_ms)
    late_counts = 3 * period_ms * _MS_COUNTS // 2 + TICK_COUNTS
    begin_counts = host.now_counts + late_counts
    rises, signs = _steps_of(host.stream(_sine_units(peak_hz, period_ms)))
    t_s = (rises - begin_counts) / COUNTS_PER_SECOND
    error_steps = np.abs(_errors_steps(t_s, signs, peak_hz))
    at_start = t_s < 2 * period_ms / 1000
    within = error_steps[~at_start & (t_s < 1 / SINE_HZ - 2 * period_ms / 1000)]
    start = f"{error_steps[at_start].max():.5f}" if at_start.any() else "-"
    return f"{peak_hz:g}|{period_ms}|{within.max():.5f}|{np.sqrt(np.mean(within**2)):.5f}|{start}"


def _errors_steps(t_s: FloatArray, signs: Int64Array, peak_hz: float) -> FloatArray:
    """Return the ideal position at the time of each step minus the threshold that the step stands for, in steps."""
    omega = 2 * np.pi * SINE_HZ
    thresholds = np.cumsum(signs) - signs + signs * THRESHOLD_STEPS
    return np.asarray(peak_hz / omega * (1 - np.cos(omega * t_s)) - thresholds, dtype=np.float64)


def _steps_of(drained: list[PinEdges]) -> tuple[Int64Array, Int64Array]:
    """Return the CLK rises of one axis in timer counts and the sign of each step; DIR is low at first."""
    rises = np.concatenate([np.asarray(edges.clk_counts, dtype=np.int64)[0::2] for edges in drained])
    words = np.concatenate([np.asarray(edges.direction, dtype=np.int64) for edges in drained])
    levels = np.concatenate(([0], words & 1))[np.searchsorted(words >> 1, rises, side="right")]
    return rises, 2 * levels - 1


def _sine_units(peak_hz: float, period_ms: int) -> FloatArray:
    """Return one period of the curve at the set-points, rounded to whole units."""
    omega = 2 * np.pi * SINE_HZ
    t_s = np.arange(round(1000 / SINE_HZ) // period_ms + 1) * period_ms / 1000
    return np.round(peak_hz / omega * (1 - np.cos(omega * t_s)) * UNITS_PER_STEP)


class _Host:
    """A firmware without bus or driver; its single axis is enabled in cyclic synchronous position."""

    def __init__(self, kernel: Kernel, period_ms: int) -> None:
        self.now_counts = 0
        self._period_counts = period_ms * _MS_COUNTS
        self._firmware = Firmware(kernel, axis_count=1)
        self._firmware.boot(0)
        self._send(Frame(COB_NMT, bytes((NmtCommand.START, FIRST_NODE_ID))))
        for address, value in (*_SETTINGS, (od.INTERPOLATION_PERIOD, period_ms)):
            self._send(sdo_write(0, address, value))

    def _send(self, frame: Frame) -> None:
        self._firmware.receive(frame, self.now_counts)
        self._firmware.poll(self.now_counts)

    def stream(self, points_units: FloatArray) -> list[PinEdges]:
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
