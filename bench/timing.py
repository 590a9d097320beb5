"""Measure how far edges are from the ideal motion: of PVT points at the kernel, of set-points at the firmware.

All are sines, and the pulse timing is the TB6560's.
"""

import struct
from dataclasses import replace

import numpy as np
from rich.table import Table

from steptwin.bench import bench_table
from steptwin.bench.live_server import sdo_write
from steptwin.controller.motion.axis_motion import PinEdges
from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.controller.node.firmware import Firmware
from steptwin.host.common.arrays import Int64Array
from steptwin.host.robots import load_robot
from steptwin.host.studies.step_methods.evaluation import ideal_of, step_errors
from steptwin.host.studies.step_methods.kernel import board_motion_of, place_on, pulses_of
from steptwin.host.studies.step_methods.motions import MICROSTEPS, POINT_MS, PlannedMotion, Sines, sines
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, SHUTDOWN, Mode
from steptwin.protocol.frame import COB_NMT, COB_RPDO, COB_SYNC, FIRST_NODE_ID, Frame
from steptwin.protocol.nmt import NmtCommand
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

PEAKS_HZ = (300.0, 2_000.0, 14_000.0)
SINE_HZ = 0.5
PERIODS_MS = (1, 2, 5, 10)
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
