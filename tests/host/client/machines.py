"""The warehouse robot on an embedded board, ready to run, and records for it."""

from dataclasses import replace

import pytest

from steptwin.host.client import AxisSettings, Machine
from steptwin.host.common.axis_records import AxisRecords
from steptwin.host.robots import load_robot
from steptwin.host.robots.switches import JointSwitches
from steptwin.host.twin.embedded_board import EmbeddedBoard
from steptwin.host.twin.embedded_network import EmbeddedNetwork
from steptwin.protocol.frame import Frame

_WHOLE = load_robot("warehouse-scara")
_JOINTS = tuple(replace(joint, switches=JointSwitches(), homing=None) for joint in _WHOLE.joints)
ROBOT = replace(_WHOLE, joints=_JOINTS)
"""Without switches: its records know no limits."""
START = [0.0, 0.0, 100.0, 0.0, 60.0, 30.0]
SETTINGS = AxisSettings(16, 33_000, 33_666, 15_000, 15_000, 15_360_000, 10_000_000)
AXES = len(START)
HEARTBEAT = 0x77F
"""The COB-ID of the host's."""


def ready(board: EmbeddedBoard) -> Machine:
    """A machine that is enabled and stands at 0 units everywhere."""
    machine = Machine(board, ROBOT.joint_names)
    machine.connect()
    machine.configure(tuple(replace(SETTINGS, microsteps=joint.transmission.microsteps) for joint in ROBOT.joints))
    machine.enable()
    machine.preset([0] * AXES)
    return machine


def still(count: int, duration_ms: int) -> tuple[AxisRecords, ...]:
    """Records of a trajectory that goes nowhere."""
    return (AxisRecords([0] * count, [0] * count, [duration_ms] * count),) * AXES


def silence_heartbeat(patch: pytest.MonkeyPatch) -> None:
    """From now on no heartbeat of the host gets on the bus."""
    send = EmbeddedNetwork.send_message

    def without_heartbeat(network: EmbeddedNetwork, can_id: int, data: bytes, remote: bool = False) -> None:
        if can_id != HEARTBEAT:
            send(network, can_id, data, remote)

    patch.setattr(EmbeddedNetwork, "send_message", without_heartbeat)


def frames_to(board: EmbeddedBoard, cob_id: int, head: bytes = b"") -> list[Frame]:
    """What has been sent under a COB-ID, with data that begin so."""
    return [frame for _, frame in board.bus_log if frame.cob_id == cob_id and frame.data.startswith(head)]


def travelling(count: int, duration_ms: int = 20) -> tuple[AxisRecords, ...]:
    """th1 from rest to rest at 4 kHz of steps, the first and the last record being its ramps; the others stand."""
    velocity = 4 * 1024 * 64
    displacements = [2 * 1024 * duration_ms, *[4 * 1024 * duration_ms] * (count - 2), 2 * 1024 * duration_ms]
    th1 = AxisRecords(displacements, [velocity] * (count - 1) + [0], [duration_ms] * count)
    standing = still(count, duration_ms)
    return (*standing[:3], th1, *standing[4:])
