"""Read a machine's status from its nodes' reports and, while no trajectory is streamed, by SDO.

A node serves one SDO transfer at a time, so SDO requests could disturb a program that streams. During a stream only the
trajectory's speed is read by SDO, in one frame; the other values that need SDO are None.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.drive_status import DriveStatus, at_rest
from steptwin.host.client.pausing import present_speed_percent
from steptwin.host.client.reports import await_reports
from steptwin.host.client.words import error_text, mode_text, state_text, words
from steptwin.host.common.errors import BusError
from steptwin.host.operate.inputs_outputs import read_inputs
from steptwin.host.operate.joint_positions import JointReading, axis_readings
from steptwin.host.operate.session import Session
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.poses import PoseDocument
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, State, Status
from steptwin.protocol.od import HISTORY_DEPTH
from steptwin.protocol.pvt import PvtFlag


@dataclass(frozen=True, slots=True)
class QueueHealth:
    """The PVT queue of an axis; the counters are None while a trajectory is streamed."""

    free: int
    """Number of free places, of 64."""
    flags: tuple[str, ...]
    """Names of the set flags."""
    accepted: int | None = None
    """Number of accepted records since power-up."""
    gaps: int | None = None
    """Number of gaps in the sequence of records."""
    overflows: int | None = None
    """Number of records dropped because the queue was full."""
    underruns: int | None = None
    """Number of times that the queue became empty while the axis moved."""
    least_fill: int | None = None
    """Smallest number of records in the queue while the axis ran."""
    delayed_steps: int | None = None
    """Number of steps delayed by the driver's timing."""


@dataclass(frozen=True, slots=True)
class AxisStatus:
    """Status of one axis and its joint; values that need SDO are None while a trajectory is streamed."""

    name: str
    node_id: int
    operational: bool
    """True in the NMT state OPERATIONAL."""
    state: str
    """Name of the drive's state in CiA 402."""
    mode: str
    moving: bool
    position: float
    """Position of the joint by the step counters, in `unit`."""
    position_known: bool
    """True if the joint has a position reference."""
    unit: str
    error: str | None
    error_code: int | None
    """Present error code, 0 without error; None while a trajectory is streamed."""
    history: tuple[str, ...] | None = None
    """Errors since power-up, newest first."""
    emergency_stopped: bool | None = None
    """True from `steptwin estop` until a fault reset; the axis cannot move meanwhile."""
    inputs: tuple[str, ...] | None = None
    """Names of the active digital inputs."""
    supply_v: float | None = None
    temperature_degc: float | None = None
    queue: QueueHealth | None = None
    """PVT queue; None if the node has not reported it."""
    frames_lost: int | None = None
    """Number of the node's frames that were lost on the busy bus since power-up."""
    emergencies_lost: int | None = None
    """Number of EMCYs that were lost since power-up because of the inhibit time."""

    @property
    def in_fault(self) -> bool:
        """True while the drive is in fault or in its fault reaction."""
        return self.state.startswith("FAULT")


@dataclass(frozen=True, slots=True)
class MachineStatus:
    """Status of all axes, and pose of the tool if every joint has a position reference."""

    robot: str
    streaming: bool
    axes: tuple[AxisStatus, ...]
    pose: PoseDocument | None
    inputs: dict[str, bool] | None
    """Levels of the inputs in the robot file; None while a trajectory is streamed."""
    speed_percent: float | None
    """Present speed of the trajectory in percent of the planned one, 0 in a pause; None without trajectory."""
    skews: dict[str, float]
    """Lead of each second motor over the joint's first motor, by its axis' name, in the joint's unit."""

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON document of the status; it has no skews if there are no second motors."""
        document = asdict(self)
        if not self.skews:
            del document["skews"]
        return document


def read_status(session: Session) -> MachineStatus:
    """Read the status of the machine without changing it.

    Raises:
        BusError: a node does not answer.
    """
    await_reports(session.link, session.machine.axes)
    streaming = session.streaming
    status_of, complete = (_reported, _by_reports) if streaming else (_read, _by_sdo)
    drives = [status_of(axis) for axis in session.machine.axes]
    knows = [bool(drive.statusword & Status.POSITION_KNOWN) for drive in drives]
    robot, units = session.robot, [drive.position_units for drive in drives]
    parts = zip(session.machine.axes, robot.axes, drives, axis_readings(robot, units, knows), strict=True)
    axes = tuple(complete(axis, drive, _common(axis, joint, drive, place)) for axis, joint, drive, place in parts)
    known = all(axis.position_known for axis in axes)
    pose = session.pose([axis.position for axis in axes[: len(robot.joints)]]) if known else None
    inputs = None if streaming else read_inputs(session)
    speed_percent = present_speed_percent(session.machine.axes)
    skews = dict(zip(robot.axis_names[len(robot.joints) :], robot.skews(np.array(units)).tolist(), strict=True))
    return MachineStatus(robot.name, streaming, axes, pose, inputs, speed_percent, skews)


def _reported(axis: AxisClient) -> DriveStatus:
    if axis.drive_status is None:
        raise BusError(f"{axis.name}: node 0x{axis.node_id:02X} does not report its status").plainly(
            f"{axis.name} does not report how it is: is the machine switched on and connected?"
        )
    return axis.drive_status


def _read(axis: AxisClient) -> DriveStatus:
    statusword, mode = axis.read(od.STATUSWORD), axis.read(od.MODE_OF_OPERATION_DISPLAY)
    return DriveStatus(statusword, State.of(statusword), mode, axis.read(od.POSITION_ACTUAL))


def _by_reports(axis: AxisClient, drive: DriveStatus, common: dict[str, Any]) -> AxisStatus:
    pvt = axis.pvt_status
    code = axis.error_codes[-1] if drive.in_fault and axis.error_codes else None
    return AxisStatus(
        **common,
        error=error_text(code) if code else None,
        error_code=code,
        queue=None if pvt is None else QueueHealth(pvt.free, _flags(pvt.flags)),
    )


_QUEUE_COUNTERS = (
    od.PVT_ACCEPTED,
    od.PVT_GAPS,
    od.PVT_OVERFLOWS,
    od.PVT_UNDERRUNS,
    od.PVT_LEAST_FILL,
    od.DELAYED_STEPS,
)


def _by_sdo(axis: AxisClient, _drive: DriveStatus, common: dict[str, Any]) -> AxisStatus:
    read = axis.read
    code = read(od.ERROR_CODE)
    return AxisStatus(
        **common,
        error=error_text(code) if code else None,
        error_code=code,
        history=error_history(axis),
        emergency_stopped=bool(read(od.EMERGENCY_STOP)),
        inputs=active_inputs(axis),
        supply_v=read(od.SUPPLY_VOLTAGE) / 100,
        temperature_degc=read(od.BOARD_TEMPERATURE) / 10,
        queue=QueueHealth(read(od.PVT_FREE_RECORDS), _flags(read(od.PVT_FLAGS)), *map(read, _QUEUE_COUNTERS)),
        frames_lost=read(od.FRAMES_LOST),
        emergencies_lost=read(od.EMCYS_LOST),
    )


def _common(axis: AxisClient, joint: Joint, drive: DriveStatus, place: JointReading) -> dict[str, Any]:
    return {
        "name": axis.name,
        "node_id": axis.node_id,
        "operational": bool(drive.statusword & Status.REMOTE),
        "state": state_text(drive.state),
        "mode": mode_text(drive.mode),
        "moving": not at_rest(drive.statusword, drive.mode),
        "position": place.position,
        "position_known": place.known,
        "unit": str(joint.unit),
    }


def active_inputs(axis: AxisClient) -> tuple[str, ...]:
    """Read the names of an axis' active inputs by SDO."""
    inputs = axis.read(od.DIGITAL_INPUTS)
    return tuple(words(bit) for bit in DigitalInput if inputs & bit)


def error_history(axis: AxisClient) -> tuple[str, ...]:
    """Read the errors since power-up by SDO; return their names, newest first."""
    count = min(axis.read(od.ERROR_HISTORY_COUNT), HISTORY_DEPTH)
    codes = [axis.read(address) & 0xFFFF for address in od.ERROR_HISTORY[:count]]
    return tuple(f"{error_text(code)} (0x{code:04X})" for code in codes)


def _flags(flags: int) -> tuple[str, ...]:
    return tuple(words(flag) for flag in PvtFlag if flags & flag)
