"""Telemetry: reports that axes send by themselves, without queries, which would disturb other programs."""

import struct
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Final

from steptwin.host.client.axis import AxisClient, Objects
from steptwin.host.client.drive_status import DriveStatus, at_rest
from steptwin.host.client.reports import await_reports
from steptwin.host.common.errors import BusError
from steptwin.host.operate.session import Session
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, Status
from steptwin.protocol.frame import COB_EMCY, COB_ID_INVALID, COB_ID_NO_RTR, COB_TPDO
from steptwin.protocol.objects import ASYNCHRONOUS

SILENT_S: Final = 0.35
"""Silence until the machine counts as lost: pages show it within 0.5 s, and at 125 kbit/s two reports in a row may be
missing.
"""
_PERIOD_MS: Final = 30  # period of position and state reports at _FULL_RATE and above
_FULL_RATE: Final = 500_000
_MOTION_PERIODS: Final = 2
"""Number of these periods between reports of velocity and following error; plots need no more."""
_WORD_BYTES: Final = 4
_MOTION: Final = struct.Struct("<ii")
_INPUTS: Final = struct.Struct("<IH")
_EMERGENCY: Final = struct.Struct("<HB5s")


@dataclass(slots=True)
class AxisTelemetry:
    """The last reports of one axis.

    Attributes:
        drive: statusword, state, mode and position; None before the first report.
        heard_s: arrival of `drive`, on the clock of `time.monotonic`.
        following_error_units: difference of demanded and actual position; None if not reported.
        velocity_units_per_s: velocity; None if not reported.
        inputs: the digital inputs (60FDh); None before the first report.
        error_code: last error reported by the node; 0 after its end.
    """

    drive: DriveStatus | None = None
    heard_s: float = float("-inf")
    following_error_units: int | None = None
    velocity_units_per_s: int | None = None
    inputs: int | None = None
    error_code: int = 0

    def take_drive(self, data: bytes) -> None:
        """Store a TPDO1."""
        self.drive, self.heard_s = DriveStatus.decode(data), time.monotonic()

    def take_motion(self, data: bytes) -> None:
        """Store a TPDO2, defined by `set_up_reports`."""
        self.following_error_units, self.velocity_units_per_s = _MOTION.unpack(data)

    def take_inputs(self, data: bytes) -> None:
        """Store a TPDO4."""
        self.inputs, self.error_code = _INPUTS.unpack(data)

    def take_emergency(self, data: bytes) -> int:
        """Store an emergency; return its code."""
        code, register, _detail = _EMERGENCY.unpack(data)
        if code or not register:  # "no error" with bits in the register means that another error remains
            self.error_code = code
        return int(code)


class Telemetry:
    """The last reports of all axes; the receiving thread writes them, any thread reads them."""

    def __init__(self, session: Session, emergency: Callable[[int, int], None]) -> None:
        """Listen from now on; `emergency` is called in the receiving thread with an axis' number and an error code."""
        self.axes: tuple[AxisTelemetry, ...] = tuple(AxisTelemetry() for _ in session.machine.axes)

        def take_emergency(number: int, data: bytes) -> None:
            emergency(number, self.axes[number].take_emergency(data))

        for number, (axis, report) in enumerate(zip(session.machine.axes, self.axes, strict=True)):
            for cob_id, take in (
                (COB_TPDO[0], report.take_drive),
                (COB_TPDO[1], report.take_motion),
                (COB_TPDO[3], report.take_inputs),
                (COB_EMCY, partial(take_emergency, number)),
            ):
                session.link.network.subscribe(cob_id + axis.node_id, partial(_received, take))

    @property
    def heard_s(self) -> float:
        """Time of the oldest last report among the axes, on the clock of `time.monotonic`."""
        return min(report.heard_s for report in self.axes)

    @property
    def news_s(self) -> float:
        """Time of the newest report, on the same clock."""
        return max(report.heard_s for report in self.axes)

    @property
    def silent(self) -> bool:
        """True if an axis has not reported for SILENT_S."""
        return time.monotonic() - self.heard_s > SILENT_S

    def ask_once(self, session: Session) -> None:
        """Query values that nodes report only on a change; raise BusError if a node does not answer."""
        for axis, report in zip(session.machine.axes, self.axes, strict=True):
            report.inputs = axis.read(od.DIGITAL_INPUTS)
            held = axis.read(od.EMERGENCY_STOP)
            report.error_code = ErrorCode.ESTOP if held else axis.read(od.ERROR_CODE)


def _received(take: Callable[[bytes], object], _cob_id: int, data: bytearray, _timestamp: float) -> None:
    with suppress(ValueError, struct.error):  # a frame that cannot be decoded
        take(bytes(data))


# --- setup of reports


def set_up_reports(session: Session) -> bool:
    """Set up frequent reports with velocity and following error; return False if that must wait.

    It must wait while another program has the lease or an axis moves: a node accepts the parameters of its reports only
    in PRE-OPERATIONAL, where it executes no process data. A board with these parameters is left unchanged.
    """
    axes = session.machine.axes
    await_reports(session.link, axes)
    if session.streaming:
        return False
    period_ms = _PERIOD_MS * max(1, _FULL_RATE // session.robot.board.bitrate)
    wanted = [(axis, _objects(axis.node_id, period_ms)) for axis in axes]
    try:
        if all(_reports(axis, objects) for axis, objects in wanted):
            return True
        if not all(at_rest(axis.read(od.STATUSWORD), axis.read(od.MODE_OF_OPERATION_DISPLAY)) for axis in axes):
            return False
        with session.alone("reports"):
            session.link.network.nmt.state = "PRE-OPERATIONAL"
            for axis, objects in wanted:
                for address, value in objects:
                    axis.write(address, value)
            # One after the other, which spreads the reports over the period: a board that had to send all of them at
            # once would be late with other things.
            for axis in axes:
                axis.start_node()
                session.link.wait(period_ms / 1000 / len(axes))
    except BusError:  # another program has the lease; a node that does not answer is soon detected anyway
        return False
    return True


def _objects(node_id: int, period_ms: int) -> Objects:
    """Return the parameters of an axis' reports, in the order of writing.

    TPDO2 exists only after a master has defined it; it has the following error and the velocity.
    """
    drive, motion = od.TPDO_COMMUNICATION[:2]
    mapping = od.TPDO_MAPPING[1]
    cob_id = COB_TPDO[1] + node_id | COB_ID_NO_RTR
    mapped = (od.FOLLOWING_ERROR_ACTUAL, od.VELOCITY_ACTUAL)
    return [
        (od.address_of(drive, od.PDO_EVENT_TIMER), period_ms),
        (od.address_of(motion, od.PDO_COB_ID), cob_id | COB_ID_INVALID),
        (od.address_of(motion, od.PDO_TRANSMISSION_TYPE), ASYNCHRONOUS),
        (od.address_of(motion, od.PDO_EVENT_TIMER), _MOTION_PERIODS * period_ms),
        (od.address_of(mapping), 0),
        *((od.address_of(mapping, i), address << 8 | 8 * _WORD_BYTES) for i, address in enumerate(mapped, start=1)),
        (od.address_of(mapping), len(mapped)),
        (od.address_of(motion, od.PDO_COB_ID), cob_id),
    ]


def _reports(axis: AxisClient, objects: Objects) -> bool:
    """Return whether a node is OPERATIONAL with reports of these parameters; the last of repeated values counts."""
    operational = bool(axis.read(od.STATUSWORD) & Status.REMOTE)
    return operational and all(axis.read(address) == value for address, value in dict(objects).items())
