"""How a machine is: by what its nodes say themselves and, while nobody streams, by what they answer.

A node serves one SDO dialogue at a time, so a host that streams would be disturbed by questions: what only they tell is
None then.
"""

from dataclasses import asdict, dataclass
from typing import Any

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.drive_status import at_rest
from steptwin.host.client.words import error_text, mode_text, state_text, words
from steptwin.host.common.errors import BusError
from steptwin.host.operate.session import Session
from steptwin.host.robots.joint import Joint
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, State, Status
from steptwin.protocol.objects import HISTORY_DEPTH
from steptwin.protocol.pvt import PvtFlag


@dataclass(frozen=True, slots=True)
class QueueHealth:
    """An axis' PVT queue; the counters are None while somebody streams.

    Attributes:
        free: places, of 64.
        flags: what it reports now, in words.
        accepted: records taken since power-up.
        gaps: times that records were missing.
        overflows: times that it was full.
        underruns: times that it ran dry while the axis moved.
        least_fill: records, while it ran.
        delayed_steps: pulses that had to wait for the driver's timing.
    """

    free: int
    flags: tuple[str, ...]
    accepted: int | None = None
    gaps: int | None = None
    overflows: int | None = None
    underruns: int | None = None
    least_fill: int | None = None
    delayed_steps: int | None = None


@dataclass(frozen=True, slots=True)
class AxisStatus:
    """One axis.

    Attributes:
        name: of the joint.
        node_id: of its node.
        operational: whether the node exchanges process data.
        state: of the drive, as CiA 402 writes it.
        mode: of operation.
        moving: whether it is on its way.
        position: by the step counter, in `unit`.
        position_known: whether that means anything.
        unit: mm or deg.
        error: the present one in words.
        error_code: as CiA 402 numbers it, 0 for none.
        history: earlier errors since power-up in words, the newest first.
        inputs: that are active.
        supply_v: of the motors.
        temperature_degc: of the board.
        queue: for trajectories; None if the node has not said anything about it.
    """

    name: str
    node_id: int
    operational: bool
    state: str
    mode: str
    moving: bool
    position: float
    position_known: bool
    unit: str
    error: str | None
    error_code: int | None
    history: tuple[str, ...] | None
    inputs: tuple[str, ...] | None
    supply_v: float | None
    temperature_degc: float | None
    queue: QueueHealth | None

    @property
    def in_fault(self) -> bool:
        """Whether the drive is."""
        return self.state.startswith("FAULT")


@dataclass(frozen=True, slots=True)
class MachineStatus:
    """All axes, and the tool's pose if every position is known."""

    robot: str
    streaming: bool
    axes: tuple[AxisStatus, ...]
    pose: dict[str, float] | None

    def to_dict(self) -> dict[str, Any]:
        """As the JSON document says it."""
        return {"robot": self.robot, "streaming": self.streaming, "axes": [asdict(a) for a in self.axes]} | {
            "pose": self.pose
        }


def read_status(session: Session) -> MachineStatus:
    """Ask how the machine is; nothing on it changes.

    Raises:
        BusError: a node does not answer.
    """
    session.listen()
    streaming = session.streaming
    pairs = zip(session.machine.axes, session.robot.joints, strict=True)
    axes = tuple(_heard(axis, joint) if streaming else _asked(axis, joint) for axis, joint in pairs)
    known = all(axis.position_known for axis in axes)
    pose = session.pose([axis.position for axis in axes]) if known else None
    return MachineStatus(session.robot.name, streaming, axes, pose)


def _heard(axis: AxisClient, joint: Joint) -> AxisStatus:
    status = axis.drive_status
    if status is None:
        raise BusError(f"{axis.name}: node 0x{axis.node_id:02X} says nothing")
    pvt = axis.pvt_status
    codes = axis.error_codes
    return AxisStatus(
        **_common(axis, joint, status.statusword, status.mode, status.position_units),
        error=error_text(codes[-1]) if status.in_fault and codes else None,
        error_code=codes[-1] if status.in_fault and codes else None,
        history=None,
        inputs=None,
        supply_v=None,
        temperature_degc=None,
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


def _asked(axis: AxisClient, joint: Joint) -> AxisStatus:
    read = axis.read
    code = read(od.ERROR_CODE)
    return AxisStatus(
        **_common(axis, joint, read(od.STATUSWORD), read(od.MODE_OF_OPERATION_DISPLAY), read(od.POSITION_ACTUAL)),
        error=error_text(code) if code else None,
        error_code=code,
        history=error_history(axis),
        inputs=active_inputs(axis),
        supply_v=read(od.SUPPLY_VOLTAGE) / 100,
        temperature_degc=read(od.BOARD_TEMPERATURE) / 10,
        queue=QueueHealth(read(od.PVT_FREE_RECORDS), _flags(read(od.PVT_FLAGS)), *map(read, _QUEUE_COUNTERS)),
    )


def _common(axis: AxisClient, joint: Joint, statusword: int, mode: int, position_units: int) -> dict[str, Any]:
    return {
        "name": axis.name,
        "node_id": axis.node_id,
        "operational": bool(statusword & Status.REMOTE),
        "state": state_text(State.of(statusword)),
        "mode": mode_text(mode),
        "moving": not at_rest(statusword, mode),
        "position": joint.to_position(position_units),
        "position_known": bool(statusword & Status.POSITION_KNOWN),
        "unit": str(joint.unit),
    }


def active_inputs(axis: AxisClient) -> tuple[str, ...]:
    """The names of an axis' active inputs, by SDO."""
    inputs = axis.read(od.DIGITAL_INPUTS)
    return tuple(words(bit) for bit in DigitalInput if inputs & bit)


def error_history(axis: AxisClient) -> tuple[str, ...]:
    """The errors since power-up in words, the newest first, by SDO."""
    count = min(axis.read(od.ERROR_HISTORY_COUNT), HISTORY_DEPTH)
    codes = [axis.read(address) & 0xFFFF for address in od.ERROR_HISTORY[:count]]
    return tuple(f"{error_text(code)} (0x{code:04X})" for code in codes)


def _flags(flags: int) -> tuple[str, ...]:
    return tuple(words(flag) for flag in PvtFlag if flags & flag)
