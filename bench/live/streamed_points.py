"""Stream 250 points a second to each of seven axes of a live board; an underrun would be a fault and end the run.

The server is one process, the client another.
"""

import os
import struct
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from steptwin.bench.live.server import serving
from steptwin.host.client import AxisSettings, Machine
from steptwin.host.client.links.bus_link import BusLink, Connection, open_bus
from steptwin.host.client.stream import Stream
from steptwin.host.client.waiting import POLL_S
from steptwin.host.common.arrays import AxisRecords
from steptwin.host.studies.step_methods.loads import AXES, MICROSTEPS, UNITS_PER_STEP, Load
from steptwin.protocol import od
from steptwin.protocol.frame import COB_SDO_REQUEST, FIRST_NODE_ID, Frame
from steptwin.protocol.pvt import QUEUE_DEPTH

_WRITE = 0x22
"""Expedited download without a size: the node takes as many bytes as the entry has."""


def sdo_write(axis: int, address: int, value: int) -> Frame:
    """Return the SDO request that writes `value` to an entry of an axis."""
    data = struct.pack("<BHBi", _WRITE, *od.index_and_subindex(address), value)
    return Frame(COB_SDO_REQUEST + FIRST_NODE_ID + axis, data)


POINT_MS: Final = 4
PEAK_HZ: Final = 2000.0
SINE_HZ: Final = 0.5
_SETTINGS: Final = AxisSettings(MICROSTEPS, 33_000, 33_666, 15_000, 15_000, 15_360_000, 10_000_000)
_HYSTERESIS_STEPS: Final = 0.5 + 1 / 16
_CPU_TICKS_PER_S: Final = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True)
class StreamFigures:
    """Figures of one stream."""

    seconds: float
    points: int
    """Number of points sent to all axes together."""
    server_cores: float
    """Processor seconds that the server used per second."""
    client_cores: float
    queue_least: int
    """Fewest records that any axis reported in its queue before the end of its stream was sent."""
    load_percent: float
    ticks: dict[str, float]
    """Lateness of the ticks, with the keys of report.json."""
    frames_late: dict[str, float]


def sine_records(axis: int, seconds: float) -> AxisRecords:
    """Make A (1 - cos wt) from rest to rest at the far end; each axis has its own peak rate."""
    t_s = np.arange(round(seconds * 1000 / POINT_MS) + 1) * POINT_MS / 1000
    half_periods = 2 * round(seconds * SINE_HZ) + 1
    omega, peak_hz = np.pi * half_periods / t_s[-1], PEAK_HZ * (axis + 1) / AXES
    load = Load("sine", peak_hz / omega * (1 - np.cos(omega * t_s)), peak_hz * np.sin(omega * t_s), POINT_MS)
    return AxisRecords(*(list(column) for column in zip(*load.records(), strict=True)))


def measure(seconds: float) -> StreamFigures:
    """Stream for `seconds`.

    Raises:
        DeviceFaultError: a queue ran dry.
        AssertionError: a driver counted other steps than were sent, or a limit was broken.
    """
    records = tuple(sine_records(axis, seconds) for axis in range(AXES))
    with serving("steptwin.bench.live.server") as server:
        connection = Connection("socketcand", host="127.0.0.1", port=server.port)
        with BusLink(open_bus(connection), connection.title) as link:
            machine = Machine(link, tuple(f"axis {axis}" for axis in range(AXES)))
            machine.connect()
            machine.configure((_SETTINGS,) * AXES)
            machine.enable()
            machine.preset([0] * AXES)
            stream = machine.start(records, [0] * AXES)
            began_s, server_s, client_s = time.perf_counter(), cpu_s(server.process.pid), time.process_time()
            queue_least = _feed(machine, stream)
            wall_s = time.perf_counter() - began_s
            server_s, client_s = cpu_s(server.process.pid) - server_s, time.process_time() - client_s
            machine.disable()
            machine.disconnect()
        report = server.end()
    _check(report, records)
    return StreamFigures(
        seconds,
        len(records[0].durations_ms) * AXES,
        server_s / wall_s,
        client_s / wall_s,
        queue_least,
        report["bus"]["load_percent"],
        report["real_time"]["ticks"],
        report["real_time"]["frames"],
    )


def _feed(machine: Machine, stream: Stream) -> int:
    """Feed the stream until it has ended; return the fewest records that any queue was reported to hold."""
    queue_least = QUEUE_DEPTH
    while not stream.ended:
        machine.wait(POLL_S)
        if stream.fraction < 1:
            free = [axis.pvt_status.free for axis in machine.axes if axis.pvt_status]
            queue_least = min(queue_least, QUEUE_DEPTH - max(free))
    return queue_least


def _check(report: dict[str, Any], records: tuple[AxisRecords, ...]) -> None:
    """Compare the drivers' counts with the records: they differ by the step rule's hysteresis at most."""
    for axis, record in zip(report["axes"], records, strict=True):
        off_steps = axis["steps_end"] - axis["steps_start"] - sum(record.displacements_units) / UNITS_PER_STEP
        assert abs(off_steps) <= _HYSTERESIS_STEPS, f"{axis['name']} ends {off_steps} steps off"
        assert not axis["violations"]


def cpu_s(pid: int) -> float:
    """Return the processor time that a process has used (Linux: utime and stime of proc(5))."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _CPU_TICKS_PER_S
