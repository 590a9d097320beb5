"""Share the warehouse robot on an embedded board, a machine that is ready to run, records, and a second program."""

from collections.abc import Callable
from dataclasses import replace

import canopen
import pytest
from canopen.network import PeriodicMessageTask

from steptwin.host.client import AxisSettings, Machine, MachineWiring
from steptwin.host.common.arrays import AxisRecords
from steptwin.host.robots import load_robot
from steptwin.host.robots.switches import JointSwitches
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.embedded.embedded_network import EmbeddedNetwork, RepeatedFrames
from steptwin.protocol.cia402 import DigitalInput, DigitalOutput
from steptwin.protocol.frame import Frame

WAREHOUSE = load_robot("warehouse-scara")
ROBOT = replace(
    WAREHOUSE, joints=tuple(replace(joint, switches=JointSwitches(), homing=None) for joint in WAREHOUSE.joints)
)
"""The robot without switches, because the tests' records leave the joints' limits."""
SX, SZ, L1, TH1, TH2, TH3 = range(6)
START = [0.0, 0.0, 100.0, 0.0, 60.0, 30.0]
SETTINGS = AxisSettings(16, 33_000, 33_666, 15_000, 15_000, 15_360_000, 10_000_000)
AXES = len(START)
STEP = 1024
"""Units of a step at 16 microsteps."""
WIRING = MachineWiring(
    {"part": (TH1, DigitalInput.IN1)}, {"magnet": (TH3, DigitalOutput.OUT1), "lock": (TH3, DigitalOutput.OUT2)}
)
HEARTBEAT = 0x77F
"""The COB-ID of the host's heartbeat."""


def connected(board: EmbeddedBoard) -> Machine:
    """Return a machine whose nodes are PRE-OPERATIONAL and whose drives are off."""
    machine = Machine(board, ROBOT.joint_names)
    machine.connect()
    return machine


def ready(board: EmbeddedBoard) -> Machine:
    """Return a machine that is enabled and stands at 0 units on every axis."""
    machine = connected(board)
    machine.configure([replace(SETTINGS, microsteps=joint.transmission.microsteps) for joint in ROBOT.joints])
    machine.enable()
    machine.preset([0] * AXES)
    return machine


def still(count: int, duration_ms: int) -> tuple[AxisRecords, ...]:
    """Return the records of a trajectory in which no axis moves."""
    return (AxisRecords([0] * count, [0] * count, [duration_ms] * count),) * AXES


def travelling(count: int, duration_ms: int = 20) -> tuple[AxisRecords, ...]:
    """Return records that move th1 at 4 steps/ms, with a ramp in the first and in the last record.

    The other axes stand.
    """
    velocity = 4 * STEP * 64
    displacements = [2 * STEP * duration_ms, *[4 * STEP * duration_ms] * (count - 2), 2 * STEP * duration_ms]
    records = list(still(count, duration_ms))
    records[TH1] = AxisRecords(displacements, [velocity] * (count - 1) + [0], [duration_ms] * count)
    return tuple(records)


def silence_heartbeat(patch: pytest.MonkeyPatch) -> None:
    """Keep the host's heartbeat off the bus from now on."""
    send, take_due = EmbeddedNetwork.send_message, RepeatedFrames.take_due

    def without_heartbeat(network: EmbeddedNetwork, can_id: int, data: bytes, remote: bool = False) -> None:
        if can_id != HEARTBEAT:
            send(network, can_id, data, remote)

    def others(repeated: RepeatedFrames) -> list[Frame]:
        return [frame for frame in take_due(repeated) if frame.cob_id != HEARTBEAT]

    patch.setattr(EmbeddedNetwork, "send_message", without_heartbeat)
    patch.setattr(RepeatedFrames, "take_due", others)


def frames_to(board: EmbeddedBoard, cob_id: int, head: bytes = b"") -> list[Frame]:
    """Return the frames sent under a COB-ID whose data begin with `head`."""
    return [frame for _, frame in board.bus_log if frame.cob_id == cob_id and frame.data.startswith(head)]


def sdo_requests(board: EmbeddedBoard, begin: int) -> list[Frame]:
    """Return the SDO requests in the bus log from its entry `begin` on."""
    return [frame for _, frame in board.bus_log[begin:] if 0x600 < frame.cob_id < 0x680]


class Neighbour(canopen.Network):
    """The link of another program on the same bus.

    While it waits, time passes for both programs: by `wait`, if given, so that the first program can do its work.
    """

    def __init__(
        self, board: EmbeddedBoard, patch: pytest.MonkeyPatch, wait: Callable[[float], None] | None = None
    ) -> None:
        super().__init__()
        self._board = board
        self.wait = wait or board.wait
        self._hear_first = board.network.notify
        patch.setattr(board.network, "notify", self._hear)

    def _hear(self, can_id: int, data: bytearray, timestamp: float) -> None:
        self._hear_first(can_id, data, timestamp)
        self.notify(can_id, data, timestamp)

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        self._board.network.send_message(can_id, data, remote)

    def send_periodic(self, can_id: int, data: bytes, period: float, remote: bool = False) -> PeriodicMessageTask:
        return self._board.network.send_periodic(can_id, data, period, remote)

    @property
    def held_up_s(self) -> float:
        return self._board.held_up_s

    @property
    def network(self) -> canopen.Network:
        return self

    def now_s(self) -> float:
        return self._board.now_s()
