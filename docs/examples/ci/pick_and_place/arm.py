"""Drive the arm: enable the drives, send points as PVT records and start all axes with one SYNC."""

import time
from collections.abc import Callable
from itertools import pairwise

import canopen

from pick_and_place.planner import Point

FIRST_NODE = 0x10
UNITS = (200 * 16384 * 4 / 360, 200 * 16384 * 4 / 360, 200 * 16384 / 5, 200 * 16384 * 2 / 360)
"""Units of 1/16384 full step per degree or mm of th1, th2, d3 and th4."""
MICROSTEPS = (16, 16, 8, 16)
QUEUE_RECORDS = 64
ALL_NODES = 0
SYNC = 0x080
OUT1 = 1 << 16


class ArmError(Exception):
    """A drive has stopped in fault; `code` is the error code of CiA 402."""

    def __init__(self, node_id: int, code: int) -> None:
        super().__init__(f"node 0x{node_id:02X} is in fault: 0x{code:04X}")
        self.code = code


class Arm:
    """The arm's four axes on a network; `sleep` lets a number of seconds pass."""

    def __init__(self, network: canopen.Network, sleep: Callable[[float], None] = time.sleep) -> None:
        self._network = network
        self._sleep = sleep
        ids = range(FIRST_NODE, FIRST_NODE + len(UNITS))
        self._nodes = [network.add_node(canopen.RemoteNode(i, canopen.ObjectDictionary())) for i in ids]

    def enable(self) -> None:
        """Configure the drivers and lead all drives to OPERATION ENABLED in interpolated position mode."""
        self._network.send_message(0, bytes((1, ALL_NODES)))  # NMT start
        for node, microsteps in zip(self._nodes, MICROSTEPS, strict=True):
            self._write(node, 0x2000, 1, microsteps, 1)
            self._write(node, 0x6060, 0, 7, 1)
            self._write(node, 0x60C0, 0, -1, 2)  # PVT
            for controlword in (0x06, 0x07, 0x0F):
                self._write(node, 0x6040, 0, controlword, 2)

    def move(self, points: list[Point]) -> None:
        """Make a motion whose points fit into the board's queue, and wait for its end.

        Raises:
            ArmError: a drive has stopped in fault.
            ValueError: the queue does not hold that many points.
        """
        if len(points) - 1 > QUEUE_RECORDS:
            raise ValueError(f"{len(points) - 1} records are more than the queue's {QUEUE_RECORDS}")
        for axis, node in enumerate(self._nodes):
            self._write(node, 0x60C4, 6, 0, 1)  # an empty queue, next number 0
            self._fill(node, _records(axis, points))
        for node in self._nodes:
            self._network.send_message(0x300 + node.id, b"\x1f\x00")
        self._network.send_message(SYNC, b"")
        while any(self._running(node) for node in self._nodes):
            self._sleep(0.01)

    def grip(self, *, closed: bool) -> None:
        """Close or open the gripper, which is wired to the last axis."""
        self._write(self._nodes[-1], 0x60FE, 1, OUT1 if closed else 0, 4)

    def _fill(self, node: canopen.RemoteNode, records: list[bytes]) -> None:
        """Send records until the node has accepted all of them: a frame may be lost."""
        while (accepted := self._read(node, 0x2012, 1)) < len(records):
            for record in records[accepted:]:
                self._network.send_message(0x500 + node.id, record)

    def _running(self, node: canopen.RemoteNode) -> bool:
        if self._read(node, 0x6041, 0) & 0x4F in (0x08, 0x0F):  # FAULT, FAULT REACTION ACTIVE
            raise ArmError(node.id, self._read(node, 0x603F, 0))
        return bool(self._read(node, 0x2012, 3) & 16)

    @staticmethod
    def _read(node: canopen.RemoteNode, index: int, subindex: int) -> int:
        return int.from_bytes(node.sdo.upload(index, subindex), "little")

    @staticmethod
    def _write(node: canopen.RemoteNode, index: int, subindex: int, value: int, size: int) -> None:
        node.sdo.download(index, subindex, value.to_bytes(size, "little", signed=value < 0))


def _records(axis: int, points: list[Point]) -> list[bytes]:
    """Return an axis' PVT records: displacement, end velocity in 1/64 unit per ms, duration in ms, sequence number."""
    units = [round(point.positions[axis] * UNITS[axis]) for point in points]
    records = []
    for number, (i, j) in enumerate(pairwise(range(len(points)))):
        velocity = round(points[j].velocities[axis] * UNITS[axis] * 64 / 1000)
        displacement = (units[j] - units[i]).to_bytes(3, "little", signed=True)
        ends = bytes((points[j].t_ms - points[i].t_ms, number))
        records.append(displacement + velocity.to_bytes(3, "little", signed=True) + ends)
    return records
