"""Measure the live board as other programs see it: round trips and lateness, server and client as two processes."""

import logging
import time
from dataclasses import dataclass

import can
import numpy as np

from steptwin.bench.live.server import ROBOT, SERVE, serving
from steptwin.bench.live.streamed_points import sdo_write
from steptwin.emulator.bus.can_timing import frame_bits
from steptwin.host.robots import load_robot
from steptwin.host.studies.step_methods.loads import UNITS_PER_STEP
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, SHUTDOWN, SWITCH_ON, Mode
from steptwin.protocol.frame import COB_NMT, COB_SDO_REQUEST, COB_SDO_RESPONSE, FIRST_NODE_ID, Frame
from steptwin.protocol.nmt import NmtCommand

ROUND_TRIPS = 2000
MOTION_S = 4.0
_READ_TYPE = Frame(COB_SDO_REQUEST + FIRST_NODE_ID, bytes.fromhex("4000100000000000"))
_TYPE = Frame(COB_SDO_RESPONSE + FIRST_NODE_ID, bytes.fromhex("4300100092010400"))
"""The device type's request and answer, from which their time on the bus is computed."""
_TIMEOUT_S = 10.0


@dataclass(frozen=True)
class LiveFigures:
    """All figures of the table; times are in microseconds."""

    bus_us: float
    """Time that request and answer take on the bus itself."""
    round_trip_us_p50: float
    round_trip_us_p99: float
    round_trip_us_max: float
    ticks: dict[str, float]
    """Lateness of the ticks while six axes move, with the keys of report.json."""
    frames: dict[str, float]


def _send(bus: can.BusABC, frame: Frame) -> None:
    bus.send(can.Message(arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False))


def _await(bus: can.BusABC, cob_id: int) -> None:
    while (message := bus.recv(_TIMEOUT_S)) is not None:
        if message.arbitration_id == cob_id:
            return
    raise AssertionError(f"no {cob_id:03X}")


def _round_trips_us(bus: can.BusABC) -> list[float]:
    times = []
    for _ in range(ROUND_TRIPS):
        started = time.perf_counter()
        _send(bus, _READ_TYPE)
        _await(bus, _TYPE.cob_id)
        times.append(1e6 * (time.perf_counter() - started))
    return times[ROUND_TRIPS // 10 :]


def _write(bus: can.BusABC, axis: int, address: int, value: int) -> None:
    _send(bus, sdo_write(axis, address, value))
    _await(bus, COB_SDO_RESPONSE + FIRST_NODE_ID + axis)


def move_all(bus: can.BusABC, motion_s: float = MOTION_S) -> None:
    """Move all axes at 1000 steps/s for some time in profile velocity; their TPDOs report ten times a second."""
    axes = range(len(load_robot(ROBOT).joints))
    for axis in axes:
        _write(bus, axis, od.MODE_OF_OPERATION, Mode.PROFILE_VELOCITY)
        for word in (SHUTDOWN, SWITCH_ON, ENABLE_OPERATION):
            _write(bus, axis, od.CONTROLWORD, word)
        _write(bus, axis, od.TARGET_VELOCITY, 1000 * UNITS_PER_STEP)
    _send(bus, Frame(COB_NMT, bytes((NmtCommand.START, 0))))  # node 0: all nodes
    time.sleep(motion_s)
    for axis in axes:
        _write(bus, axis, od.TARGET_VELOCITY, 0)


def measure() -> LiveFigures:
    """Measure round trips at rest, then lateness during a motion."""
    # python-can warns of each frame that TCP delivers in two pieces: silence it.
    logging.getLogger("can").addHandler(logging.NullHandler())
    with serving(*SERVE) as server:
        with server.client() as bus:
            times_us = _round_trips_us(bus)
            move_all(bus)
        late = server.end()["real_time"]
    bits = frame_bits(_READ_TYPE) + frame_bits(_TYPE)
    p50, p99, longest = np.percentile(times_us, [50, 99, 100]).tolist()
    bitrate = load_robot(ROBOT).board.bitrate
    return LiveFigures(1e6 * bits / bitrate, p50, p99, longest, late["ticks"], late["frames"])
