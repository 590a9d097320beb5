"""Measure cyclic synchronous position: how far the edges are from the host's curve, for each set-point period."""

import struct
from dataclasses import dataclass

import numpy as np

from steptwin.bench.live.streamed_points import sdo_write
from steptwin.bench.timing import PEAKS_HZ, SINE_HZ, errors_steps, steps_of
from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.board_motion import PinEdges
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.controller.node.firmware import Firmware
from steptwin.host.common.arrays import FloatArray
from steptwin.host.studies.step_methods.loads import MICROSTEPS, UNITS_PER_STEP
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, SHUTDOWN, Mode
from steptwin.protocol.frame import COB_NMT, COB_RPDO, COB_SYNC, FIRST_NODE_ID, Frame
from steptwin.protocol.nmt import NmtCommand
from steptwin.protocol.timer import COUNTS_PER_SECOND

PERIODS_MS = (1, 2, 5, 10)
_MS_COUNTS = COUNTS_PER_SECOND // 1000
_SETTINGS = (
    (od.MICROSTEPS, MICROSTEPS),
    (od.CONTROLWORD, SHUTDOWN),
    (od.CONTROLWORD, ENABLE_OPERATION),
    (od.MODE_OF_OPERATION, Mode.CYCLIC_SYNCHRONOUS_POSITION),
)


@dataclass(frozen=True)
class CyclicFigure:
    """One row of the table; the start is the first two periods."""

    peak_hz: float
    period_ms: int
    error_steps_max: float
    error_steps_rms: float
    start_error_steps_max: float | None
    """None if no step falls in the first two periods."""


def figures(kernel: Kernel) -> list[CyclicFigure]:
    """Measure one sine period for each peak rate and set-point period."""
    return [measure(kernel, peak_hz, period_ms) for peak_hz in PEAKS_HZ for period_ms in PERIODS_MS]


def measure(kernel: Kernel, peak_hz: float, period_ms: int) -> CyclicFigure:
    """Compare every edge with A (1 - cos wt), which the axis follows 1.5 periods and a tick late."""
    host = _Host(kernel, period_ms)
    late_counts = 3 * period_ms * _MS_COUNTS // 2 + TICK_COUNTS
    begin_counts = host.now_counts + late_counts
    rises, signs = steps_of(host.stream(_sine_units(peak_hz, period_ms)))
    t_s = (rises - begin_counts) / COUNTS_PER_SECOND
    error_steps = np.abs(errors_steps(t_s, signs, peak_hz))
    at_start = t_s < 2 * period_ms / 1000
    within = ~at_start & (t_s < 1 / SINE_HZ - 2 * period_ms / 1000)
    return CyclicFigure(
        peak_hz,
        period_ms,
        float(error_steps[within].max()),
        float(np.sqrt(np.mean(error_steps[within] ** 2))),
        float(error_steps[at_start].max()) if at_start.any() else None,
    )


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
