"""Start a live board in a process of its own, so that a benchmark measures it as its clients see it; move its axes.

No robot of the collection has seven axes for `steptwin serve`: `python -m steptwin.bench.live_server` serves them. As
with that command, stderr names the port and stdout gets the report.
"""

import gc
import json
import logging
import os
import re
import signal
import struct
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, Literal, Self

import can

from steptwin.bench.step_methods.motions import AXES, MICROSTEPS, UNITS_PER_STEP
from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.switches import JointSwitches
from steptwin.host.twin.live.served_board import ServedBoard
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, SHUTDOWN, SWITCH_ON, Mode
from steptwin.protocol.frame import COB_NMT, COB_SDO_REQUEST, COB_SDO_RESPONSE, FIRST_NODE_ID, Frame
from steptwin.protocol.nmt import NmtCommand

ROBOT: Final = "warehouse-scara"
SERVE: Final = ("steptwin", "serve", ROBOT, "--port", "0", "--json")
_WRITE: Final = 0x22
"""Expedited download without a size: the node takes as many bytes as the entry has."""
_TIMEOUT_S: Final = 10.0


class Server:
    """A process that serves a board at `port` until `end`, or until its block is left."""

    def __init__(self, module: str, *arguments: str) -> None:
        """Start `python -m MODULE ARGUMENTS`, which names its port on stderr and prints its report on stdout."""
        command = [sys.executable, "-m", module, *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stderr
        banner = ""
        while not (found := re.search(r"port=(\d+)", banner)):
            line = self.process.stderr.readline()
            assert line, f"the server ended: {banner}"
            banner += line
        self.port = int(found[1])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()

    def client(self) -> can.BusABC:
        """Open a new connection with python-can."""
        return can.Bus("vcan0", interface="socketcand", host="127.0.0.1", port=self.port, tcp_tune=True)

    def end(self) -> dict[str, Any]:
        """Stop the server and return its report."""
        self.process.send_signal(signal.SIGTERM)
        report: dict[str, Any] = json.loads(self.process.communicate()[0])
        return report


def silence_python_can() -> None:
    """Keep python-can from warning of each frame that TCP delivers in two pieces."""
    logging.getLogger("can").addHandler(logging.NullHandler())


def of_process(pid: int | Literal["self"], name: str) -> str:
    """Return what proc(5) tells of a process, which only Linux does."""
    if not Path("/proc/self").exists():
        raise SystemExit("this benchmark reads /proc, which only Linux has")
    return Path(f"/proc/{pid}/{name}").read_text(encoding="ascii")


def cpu_s(pid: int) -> float:
    """Return the processor time that a process has used (Linux: utime and stime of proc(5))."""
    fields = of_process(pid, "stat").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def memory_mb(pid: int) -> float:
    """Return the resident set of a process (Linux: VmRSS of proc(5), in KiB)."""
    status = of_process(pid, "status")
    return int(status.partition("VmRSS:")[2].split()[0]) * 1024 / 1e6


def sdo_write(axis: int, address: int, value: int) -> Frame:
    """Return the SDO request that writes `value` to an entry of an axis."""
    data = struct.pack("<BHBi", _WRITE, *od.index_and_subindex(address), value)
    return Frame(COB_SDO_REQUEST + FIRST_NODE_ID + axis, data)


def send(bus: can.BusABC, frame: Frame) -> None:
    bus.send(can.Message(arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False))


def await_answer(bus: can.BusABC, cob_id: int) -> None:
    while (message := bus.recv(_TIMEOUT_S)) is not None:
        if message.arbitration_id == cob_id:
            return
    raise AssertionError(f"no {cob_id:03X}")


def _write(bus: can.BusABC, axis: int, address: int, value: int) -> None:
    send(bus, sdo_write(axis, address, value))
    await_answer(bus, COB_SDO_RESPONSE + FIRST_NODE_ID + axis)


def move_all(bus: can.BusABC, motion_s: float = 4.0) -> None:
    """Move all axes at 1000 steps/s for some time in profile velocity; their TPDOs report ten times a second."""
    axes = range(len(load_robot(ROBOT).joints))
    for axis in axes:
        _write(bus, axis, od.MODE_OF_OPERATION, Mode.PROFILE_VELOCITY)
        for word in (SHUTDOWN, SWITCH_ON, ENABLE_OPERATION):
            _write(bus, axis, od.CONTROLWORD, word)
        _write(bus, axis, od.TARGET_VELOCITY, 1000 * UNITS_PER_STEP)
    send(bus, Frame(COB_NMT, bytes((NmtCommand.START, 0))))  # node 0: all nodes
    time.sleep(motion_s)
    for axis in axes:
        _write(bus, axis, od.TARGET_VELOCITY, 0)


def seven_axes() -> Robot:
    """Return the warehouse robot without switches and shelf, its last joint repeated until there are seven.

    All drivers make the microsteps of the loads.
    """
    robot = load_robot("warehouse-scara")
    joints = [
        replace(
            joint,
            switches=JointSwitches(),
            homing=None,
            transmission=replace(joint.transmission, microsteps=MICROSTEPS),
        )
        for joint in robot.joints
    ]
    more = [replace(joints[-1], name=f"more{i}") for i in range(AXES - len(joints))]
    return replace(robot, joints=(*joints, *more), home=(*robot.home, *[0.0] * len(more)), sections={})


def main() -> None:
    """Serve on a free port; print the report when the signal has come."""
    served = ServedBoard(seven_axes(), port=0)
    signal.signal(signal.SIGTERM, lambda _number, _frame: served.stop())
    print(f"port={served.port}", file=sys.stderr, flush=True)
    gc.freeze()
    served.serve_forever()
    print(json.dumps(served.report()))


if __name__ == "__main__":
    main()
