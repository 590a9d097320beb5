"""Measure the live board as other programs see it: round trips and lateness, without and with motors that turn.

Server and client are two processes.
"""

import time
from collections.abc import Iterator
from statistics import median
from typing import Final

import can
import numpy as np
from rich.table import Table

from steptwin.bench.bench_table import bench_table
from steptwin.bench.live_server import (
    ROBOT,
    SERVE,
    Server,
    await_answer,
    cpu_s,
    move_all,
    send,
    silence_python_can,
)
from steptwin.emulator.bus.can_timing import frame_bits
from steptwin.host.robots import load_robot
from steptwin.protocol.frame import COB_SDO_REQUEST, COB_SDO_RESPONSE, FIRST_NODE_ID, Frame

ROUND_TRIPS = 2000
PAIRS = 10
MOTION_S = 1.5
"""Time for which six axes move at 1000 steps/s, 6000 servo ticks; none comes near its switches."""
_READ_TYPE = Frame(COB_SDO_REQUEST + FIRST_NODE_ID, bytes.fromhex("4000100000000000"))
_TYPE = Frame(COB_SDO_RESPONSE + FIRST_NODE_ID, bytes.fromhex("4300100092010400"))
"""The device type's request and answer, from which their time on the bus is computed."""


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
    sides = zip(*((_served(), _served("--motors")) for _ in range(pairs)), strict=True)
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
