"""Measure a served board as other programs see it: round trips, lateness, streamed points, frames passed on.

The server is one process, the client another. An underrun of a stream would be a fault and end the run. Frames are
passed as fast as the server can: the simulated bus is too fast to limit the rate. Both clients are plain sockets, so
that the server is measured, not python-can.
"""

import socket
import time
from collections.abc import Iterator
from selectors import EVENT_READ, EVENT_WRITE, DefaultSelector
from statistics import median
from typing import Any, Final

import can
import numpy as np
from rich.table import Table

from steptwin.bench import bench_table
from steptwin.bench.live_server import (
    ROBOT,
    SERVE,
    Server,
    await_answer,
    cpu_s,
    memory_mb,
    move_all,
    send,
    silence_python_can,
)
from steptwin.bench.step_methods.kernel import Load
from steptwin.bench.step_methods.motions import AXES, MICROSTEPS, UNITS_PER_STEP
from steptwin.emulator.bus.can_timing import frame_bits
from steptwin.host.client import AxisSettings, Machine, StreamedMotion
from steptwin.host.client.links.bus_link import BusLink, Connection, open_bus
from steptwin.host.client.stream import Stream
from steptwin.host.client.waiting import POLL_S
from steptwin.host.common.arrays import AxisRecords
from steptwin.host.robots import load_robot
from steptwin.protocol.frame import COB_SDO_REQUEST, COB_SDO_RESPONSE, FIRST_NODE_ID, Frame
from steptwin.protocol.pvt import QUEUE_DEPTH

ROUND_TRIPS: Final = 2000
PAIRS: Final = 10
MOTION_S: Final = 1.5
"""Time for which six axes move at 1000 steps/s, 6000 servo ticks; none comes near its switches."""
_READ_TYPE = Frame(COB_SDO_REQUEST + FIRST_NODE_ID, bytes.fromhex("4000100000000000"))
_TYPE = Frame(COB_SDO_RESPONSE + FIRST_NODE_ID, bytes.fromhex("4300100092010400"))
"""The device type's request and answer, from which their time on the bus is computed."""
POINT_MS: Final = 4
PEAK_HZ: Final = 2000.0
SINE_HZ: Final = 0.5
_SETTINGS: Final = AxisSettings(MICROSTEPS, 33_000, 33_666, 15_000, 15_000, 15_360_000, 10_000_000)
_HYSTERESIS_STEPS: Final = 0.5 + 1 / 16
_SPEED: Final = 100.0
"""Simulated seconds per second: at 100 a bus of 1 Mbit/s takes 800 000 frames/s."""
_COMMAND: Final = b"< send 123 8 1 2 3 4 5 6 7 8 >"
_CHUNK: Final = 1000
_READ_BYTES: Final = 1 << 18


def round_trip_rows() -> Iterator[str]:
    """Measure round trips at rest, then lateness during a motion; yield rows of p50, p99 and the largest."""
    silence_python_can()
    with Server(*SERVE) as server:
        with server.client() as bus:
            times_us = _round_trips_us(bus)
            move_all(bus)
        late = server.end()["real_time"]
    bus_us = 1e6 * (frame_bits(_READ_TYPE) + frame_bits(_TYPE)) / load_robot(ROBOT).board.bitrate
    trips_us = np.percentile(times_us, [50, 99, 100]).tolist()
    yield "|".join(["SDO round trip, us", *(f"{trip_us:.0f}" for trip_us in trips_us)])
    yield "|".join(["  x its time on the bus", *(f"{trip_us / bus_us:.1f}" for trip_us in trips_us)])
    yield lateness_row("ticks, six axes in profile velocity", late["ticks"])
    yield lateness_row("frames meanwhile", late["frames"])


def lateness_row(label: str, late: dict[str, float]) -> str:
    """Return the row of a lateness with the keys of report.json."""
    cells = (f"{late[f'late_us_{key}']:.0f}" for key in ("p50", "p99", "max"))
    return "|".join([f"lateness of {label}, us (of {late['count']})", *cells])


def _round_trips_us(bus: can.BusABC) -> list[float]:
    times = []
    for _ in range(ROUND_TRIPS):
        started = time.perf_counter()
        send(bus, _READ_TYPE)
        await_answer(bus, _TYPE.cob_id)
        times.append(1e6 * (time.perf_counter() - started))
    return times[ROUND_TRIPS // 10 :]


def live_motors_table(pairs: int = PAIRS) -> Table:
    """Serve a board without and one with motors, in turns.

    The range without motors is what the computer itself makes differ. Lateness of frames is left out: so few come in
    this time that those of power-up decide the 99th percentile.
    """
    silence_python_can()
    sides = zip(*((_served(), _served("--machine=motors")) for _ in range(pairs)), strict=True)
    without, turning = (zip(*side, strict=True) for side in sides)
    return bench_table(
        f"A live board without and with motors, in turns, six axes at 1000 steps/s: medians of {pairs}",
        "quantity|without|with|without, from to",
        (
            f"{words}|{median(without):.4g}|{median(turning):.4g}|{min(without):.4g} to {max(without):.4g}"
            for words, without, turning in zip(_QUANTITIES, without, turning, strict=True)
        ),
    )


_QUANTITIES: Final = ("lateness of ticks, p50, us", "lateness of ticks, p99, us", "cores that the server uses")


def _served(*options: str) -> tuple[float, float, float]:
    """Return each of _QUANTITIES for one motion of a served board, by the wall clock."""
    with Server(*SERVE, *options) as server:
        with server.client() as bus:
            began_s, used_s = time.perf_counter(), cpu_s(server.process.pid)
            move_all(bus, MOTION_S)
            moved_s, used_s = time.perf_counter() - began_s, cpu_s(server.process.pid) - used_s
        ticks: dict[str, float] = server.end()["real_time"]["ticks"]
    return ticks["late_us_p50"], ticks["late_us_p99"], used_s / moved_s


def live_tables(stream_s: float, flood_frames: int) -> Iterator[Table | str]:
    """Measure round trips, lateness, a stream to seven axes and a flood of frames."""
    trips = list(round_trip_rows())
    stream_rows, stream_text = _streamed(stream_s)
    yield bench_table(
        "Real time at 1 Mbit/s: other processes as clients", "live board|p50|p99|max", (*trips, *stream_rows)
    )
    yield stream_text
    yield _flooded(flood_frames)


def _sine_records(axis: int, seconds: float) -> AxisRecords:
    """Make A (1 - cos wt) from rest to rest at the far end; each axis has its own peak rate."""
    t_s = np.arange(round(seconds * 1000 / POINT_MS) + 1) * POINT_MS / 1000
    half_periods = 2 * round(seconds * SINE_HZ) + 1
    omega, peak_hz = np.pi * half_periods / t_s[-1], PEAK_HZ * (axis + 1) / AXES
    load = Load("sine", peak_hz / omega * (1 - np.cos(omega * t_s)), peak_hz * np.sin(omega * t_s), POINT_MS)
    return AxisRecords(*(list(column) for column in zip(*load.records(), strict=True)))


def _streamed(seconds: float) -> tuple[list[str], str]:
    """Stream for some time; return rows of lateness and the other figures.

    Raises:
        DeviceFaultError: a queue ran dry.
        AssertionError: a driver counted other steps than were sent, or a limit was broken.
    """
    records = tuple(_sine_records(axis, seconds) for axis in range(AXES))
    with Server("steptwin.bench.live_server") as server:
        connection = Connection("socketcand", host="127.0.0.1", port=server.port)
        with BusLink(open_bus(connection), connection.title) as link:
            machine = Machine(link, tuple(f"axis {axis}" for axis in range(AXES)))
            machine.connect()
            machine.configure((_SETTINGS,) * AXES)
            machine.enable()
            machine.preset([0] * AXES)
            stream = machine.start(StreamedMotion(records, [0] * AXES))
            began_s, server_s, client_s = time.perf_counter(), cpu_s(server.process.pid), time.process_time()
            queue_least = _feed(machine, stream)
            wall_s = time.perf_counter() - began_s
            server_s, client_s = cpu_s(server.process.pid) - server_s, time.process_time() - client_s
            machine.disable()
            machine.disconnect()
        report = server.end()
    _check(report, records)
    late, points = report["real_time"], len(records[0].durations_ms) * AXES
    rows = [
        lateness_row(f"ticks, {AXES} axes streaming", late["ticks"]),
        lateness_row("frames meanwhile", late["frames"]),
    ]
    return rows, (
        f"{AXES} axes, {points} points at {1000 // POINT_MS}/s each in {seconds:g} s: "
        f"no underrun, {queue_least} records in the emptiest queue; server {server_s / wall_s:.0%} and "
        f"client {client_s / wall_s:.0%} of a core; {report['bus']['load_percent']:.0f} % bus load"
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


def _flooded(frames: int) -> str:
    """Send and count frames; raise AssertionError if some are lost.

    Memory is the server's resident set after a tenth of the frames and after all.
    """
    early, memory_mb_early = frames // 10, 0.0
    with Server(*SERVE, "--speed", str(_SPEED)) as server, _raw(server.port) as sender, _raw(server.port) as receiver:
        with DefaultSelector() as selector:
            selector.register(sender, EVENT_WRITE)
            selector.register(receiver, EVENT_READ)
            left, arrived = frames * len(_COMMAND), 0
            started_s = time.perf_counter()
            while arrived < frames:
                for key, _ in selector.select():
                    if key.fileobj is receiver:
                        data = receiver.recv(_READ_BYTES)
                        assert data, f"disconnected after {arrived} frames"
                        arrived += data.count(b">")
                    else:
                        left -= sender.send(_rest(left))
                        if not left:
                            selector.unregister(sender)
                if not memory_mb_early and arrived >= early:
                    memory_mb_early = memory_mb(server.process.pid)
            frames_per_s = frames / (time.perf_counter() - started_s)
        memory_mb_late = memory_mb(server.process.pid)
        assert server.end()["bus"]["frames"] >= frames
    return (
        f"{frames_per_s:.0f} frames/s from client to client, with a bus too fast to limit them; the server's memory: "
        f"{memory_mb_early:.1f} MB after {early} frames, {memory_mb_late:.1f} MB after {frames}"
    )


def _rest(left_bytes: int) -> bytes:
    """Return the next bytes to send when `left_bytes` of all commands are left; they may begin within a command."""
    whole = min(_CHUNK, -(-left_bytes // len(_COMMAND)))
    return (_COMMAND * whole)[-left_bytes % len(_COMMAND) :]


def _raw(port: int) -> socket.socket:
    """Connect a client in raw mode; it returns when the server has begun to show it frames."""
    sock = socket.create_connection(("127.0.0.1", port))
    text = b""
    for command, answer in ((b"", b"< hi >"), (b"< open vcan0 >", b"< ok >"), (b"< rawmode >", b"< ok >")):
        sock.sendall(command)
        while not text.endswith(answer):
            text += sock.recv(_READ_BYTES)
    time.sleep(0.2)  # longer than the silence after `rawmode`
    sock.setblocking(False)
    return sock
