"""The master's client of one axis node: objects by SDO, state of the drive, process data."""

import struct
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, TypeVar

import canopen
from canopen.objectdictionary import ObjectDictionary, ObjectDictionaryError
from canopen.sdo.base import SdoVariable

from steptwin.host.client.drive_status import FAULT_STATES, STOPPED, DriveStatus
from steptwin.host.client.links import Link
from steptwin.host.client.shared_node import DoubtfulAnswerError, Patience, SharedNode
from steptwin.host.client.waiting import wait_until
from steptwin.host.client.words import RAN_DRY, error_text, error_words, state_text, state_words
from steptwin.host.common.errors import BusError, DeviceFaultError
from steptwin.protocol import od
from steptwin.protocol.cia402 import (
    ENABLE_OPERATION,
    SHUTDOWN,
    SWITCH_ON,
    DigitalOutput,
    ErrorCode,
    Mode,
    State,
)
from steptwin.protocol.frame import COB_NMT, COB_RPDO, COB_TPDO
from steptwin.protocol.nmt import NmtCommand, NmtState
from steptwin.protocol.pvt import PvtFlag, PvtStatus

_BYTE: Final = range(256)
Objects = list[tuple[int, int]]
"""Dictionary entries as (address, value), in the order of writing."""


@dataclass(frozen=True, slots=True)
class AxisSettings:
    """Settings of one axis, in the units of its dictionary entries."""

    microsteps: int
    steplen_ns: int
    stepspace_ns: int
    dirsetup_ns: int
    dirhold_ns: int
    velocity_max_units_per_s: int
    deceleration_units_per_s2: int
    """Deceleration of a halt, a quick stop and the stop after a fault."""
    settling_us: int = 0
    """Time from ENABLE until the driver accepts steps."""

    def objects(self) -> Objects:
        """Return the entries of these settings; a settling time of 0 is not written."""
        settling = [(od.SETTLING_US, self.settling_us)] if self.settling_us else []
        return [
            (od.MICROSTEPS if self.microsteps in _BYTE else od.MICROSTEPS_WORD, self.microsteps),
            (od.STEPLEN_NS, self.steplen_ns),
            (od.STEPSPACE_NS, self.stepspace_ns),
            (od.DIRSETUP_NS, self.dirsetup_ns),
            (od.DIRHOLD_NS, self.dirhold_ns),
            (od.MAX_PROFILE_VELOCITY, self.velocity_max_units_per_s),
            (od.PROFILE_DECELERATION, self.deceleration_units_per_s2),
            (od.QUICK_STOP_DECELERATION, self.deceleration_units_per_s2),
            *settling,
        ]


_STATUS_WAIT_S: Final = 0.001
_STATE_TIMEOUT_S: Final = 2.0
_DIALOGUES_MAX: Final = 5
_OF_A_LATE_HOST: Final = (ErrorCode.HEARTBEAT_LOST, ErrorCode.PVT_UNDERRUN)
"""Errors of an axis whose host is late."""
_LOST_CONNECTION: Final = tuple(code for code in ErrorCode if code.lost_connection)
"""Errors after which a node may leave OPERATIONAL and report by EMCY only."""
_HELD_UP_S: Final = 0.1
"""Shortest delay of this program that may have caused them: the period of the host's heartbeat."""
_NO_ANSWER: Final = "No SDO response received"
"""Message of the canopen library after a time-out; it raises the same exception for other errors."""
_RESTARTED: Final = "has restarted (boot-up message)"
_DISTURBED: Final = (0x0503_0000, 0x0504_0001)
"""Abort codes caused by another client, whose request came between the segments of a string that this one reads."""
_Answer = TypeVar("_Answer")
_ENABLING: Final = {
    State.SWITCH_ON_DISABLED: SHUTDOWN,
    State.READY_TO_SWITCH_ON: SWITCH_ON,
    State.SWITCHED_ON: ENABLE_OPERATION,
    State.QUICK_STOP_ACTIVE: ENABLE_OPERATION,
}
"""Controlword of the next step towards OPERATION ENABLED, by state."""


class AxisClient:
    """The client of one node; every error that it raises names the axis.

    Its methods share this name and the node's SDO channel: reading and writing objects, the state of the drive, and
    process data in both directions.
    """

    def __init__(self, link: Link, name: str, node_id: int, dictionary: ObjectDictionary, patience: Patience) -> None:
        self.name = name
        self.node_id = node_id
        self.drive_status: DriveStatus | None = None
        """Last report by TPDO1; None before the first."""
        self.pvt_status: PvtStatus | None = None
        """Last report by TPDO3; None before the first."""
        self._stops_reported = 0
        self._link = link
        self._record_cob_id = COB_RPDO[3] + node_id
        self._boots_since_enabled: int | None = None
        self._node: canopen.RemoteNode = link.network.add_node(SharedNode(node_id, dictionary, patience))
        self._errors = self._node.emcy
        self._node.nmt.add_heartbeat_callback(self._on_heartbeat)
        link.network.subscribe(COB_TPDO[0] + node_id, self._on_drive_status)
        link.network.subscribe(COB_TPDO[2] + node_id, self._on_pvt_status)

    def _on_drive_status(self, _cob_id: int, data: bytearray, _timestamp: float) -> None:
        with suppress(ValueError):
            before, self.drive_status = self.drive_status, DriveStatus.decode(bytes(data))
            if before is not None and self.drive_status.state in STOPPED and before.state not in STOPPED:
                self._stops_reported += 1

    def _on_pvt_status(self, _cob_id: int, data: bytearray, _timestamp: float) -> None:
        with suppress(ValueError):
            self.pvt_status = PvtStatus.decode(bytes(data))

    def _on_heartbeat(self, nmt_state: int) -> None:
        if nmt_state == NmtState.INITIALISING and self._boots_since_enabled is not None:  # the boot-up message
            self._boots_since_enabled += 1

    # --- the node's own reports

    @property
    def restarted(self) -> bool:
        """True if the node has restarted since this client enabled it, for example by a reset of its board."""
        return bool(self._boots_since_enabled)

    @property
    def stops(self) -> int:
        """Number of reported stops and faults, caused by another program or the machine itself."""
        return self._stops_reported + self.error_codes.count(ErrorCode.ESTOP)

    @property
    def in_fault(self) -> bool:
        """True while the drive is in fault or has lost its connection (reported by EMCY only)."""
        if self.drive_status is not None and self.drive_status.in_fault:
            return True
        active = self._errors.active
        return bool(active) and any(error.code in _LOST_CONNECTION for error in active)

    @property
    def interpolating(self) -> bool:
        """True while the axis executes PVT records, even if they hold it at standstill."""
        status = self.drive_status
        return status is not None and status.interpolating and not self.in_fault

    @property
    def halted(self) -> bool:
        """True while the axis is at standstill within its PVT records, because its group is halted."""
        status = self.drive_status
        return status is not None and status.halted and not self.in_fault

    @property
    def done(self) -> bool:
        """True while the axis has no PVT record running or queued."""
        status = self.pvt_status
        return status is not None and status.flags & (PvtFlag.RUNNING | PvtFlag.EMPTY) == PvtFlag.EMPTY

    @property
    def error_codes(self) -> list[int]:
        """Error codes that the node has reported by EMCY, oldest first."""
        return [error.code for error in self._errors.log if error.code]

    def fault(self) -> DeviceFaultError:
        """Return an error that names the node's last report."""
        codes = self.error_codes
        if not codes:
            return DeviceFaultError(f"{self.name}: the drive is in fault and has reported no error code").plainly(
                f"{self.name}: a fault, without a reason"
            )
        text = f"{self.name}: {error_text(codes[-1])} (EMCY 0x{codes[-1]:04X})"
        late = self._late_text() if codes[-1] in _OF_A_LATE_HOST else ""
        return DeviceFaultError(f"{text}{late}").plainly(f"{self.name}: {error_words(codes[-1])}{late}")

    def ran_dry(self) -> DeviceFaultError:
        """Return an error for a queue that ran empty at standstill; boards have no error code for it."""
        late = self._late_text()
        return DeviceFaultError(f"{self.name}: {RAN_DRY} before the end of its stream{late}").plainly(
            f"{self.name}: {error_words(ErrorCode.PVT_UNDERRUN)}{late}"
        )

    def _late_text(self) -> str:
        """Return a text with the delay of this program, if that may have let a queue run empty; else an empty text."""
        held_up_s = self._link.held_up_s
        if held_up_s < _HELD_UP_S:
            return ""
        return f"; this computer was too slow: this program was held up for {1000 * held_up_s:.0f} ms"

    def restart(self) -> DeviceFaultError:
        """Return the error of a node that has restarted."""
        unknown = "its position is unknown: home it"
        return DeviceFaultError(f"{self.name} (node 0x{self.node_id:02X}) {_RESTARTED}; {unknown}").plainly(
            f"{self.name}: its board has restarted; {unknown}"
        )

    # --- objects

    def read(self, address: int) -> int:
        """Read a numeric object by SDO.

        Raises:
            BusError: the node does not answer.
            DeviceFaultError: the node refuses the request.
        """
        return self._dialogue(f"reading {od.place_text(address)}", lambda: int(self._variable(address).raw))

    def write(self, address: int, value: int) -> None:
        """Write a numeric object by SDO; raises as `read`."""
        variable = self._variable(address)
        self._dialogue(f"writing {value} to {od.place_text(address)}", lambda: setattr(variable, "raw", value))

    def read_text(self, address: int) -> str:
        """Read a string by SDO; raises as `read`."""
        return self._dialogue(f"reading {od.place_text(address)}", lambda: str(self._variable(address).raw))

    def write_text(self, address: int, text: str) -> None:
        """Write a string by SDO; raises as `read`."""
        self._dialogue(f"writing {text!r} to {od.place_text(address)}", lambda: self._download(address, text))

    def ensure(self, address: int, value: int) -> bool:
        """Write a numeric object if its value differs; return whether it was written; raises as `read`."""
        if self.read(address) == value:
            return False
        self.write(address, value)
        return True

    def _download(self, address: int, text: str) -> None:
        self._node.sdo.download(*od.index_and_subindex(address), text.encode("ascii"))

    def _variable(self, address: int) -> SdoVariable:
        index, subindex = od.index_and_subindex(address)
        entry = self._node.sdo[index]
        return entry if isinstance(entry, SdoVariable) else entry[subindex]

    def _dialogue(self, what: str, exchange: Callable[[], _Answer]) -> _Answer:
        """Make an SDO transfer; repeat it if its answer may have been for another program at the same node."""
        left = _DIALOGUES_MAX
        while True:
            try:
                return exchange()
            except canopen.SdoAbortedError as error:
                left -= 1
                if not left or error.code not in _DISTURBED:
                    raise DeviceFaultError(f"{self.name}: {what} was refused: {error}").plainly(
                        f"{self.name}: the board refuses what this program asks for"
                    ) from error
            except (canopen.SdoCommunicationError, DoubtfulAnswerError) as error:
                left -= 1
                if not left or str(error) == _NO_ANSWER:
                    raise self._unanswered(str(error)) from error
            except ObjectDictionaryError as error:
                wrong = f"node 0x{self.node_id:02X} answers with a wrong number of bytes"
                raise BusError(f"{self.name}: {what}: {wrong}").plainly(
                    f"{self.name} gives answers that this program does not know"
                ) from error
            self._link.wait(_STATUS_WAIT_S)

    def _unanswered(self, error: str) -> BusError:
        """Return the error for a request without a valid answer."""
        malformed = sum(client.malformed for client in self._node.sdo_channels)
        dropped = f"; {malformed} answers without 8 bytes were dropped" if malformed else ""
        how = "does not answer" if error == _NO_ANSWER else "gives no valid answer"
        if self.restarted:
            how = f"{_RESTARTED} and {how}"
        return BusError(f"{self.name}: node 0x{self.node_id:02X} {how} ({error}{dropped})").plainly(
            f"{self.name} {how}: is the machine switched on and connected?"
        )

    # --- the node and its drive

    def start_node(self) -> None:
        """Set the node to OPERATIONAL from any NMT state; an OPERATIONAL node is not disturbed."""
        self._link.network.send_message(COB_NMT, bytes((NmtCommand.START, self.node_id)))

    def state(self) -> State:
        """Read the statusword and return the state of the drive."""
        return State.of(self.read(od.STATUSWORD))

    def mode(self, statusword: int) -> int:
        """Return the mode of operation, from the last report if its statusword equals this one, else by SDO."""
        report = self.drive_status
        if report is not None and report.statusword == statusword:
            return report.mode
        return self.read(od.MODE_OF_OPERATION_DISPLAY)

    def executing(self) -> int:
        """Read the sequence number of the present PVT record."""
        return self.read(od.PVT_EXECUTING_SEQUENCE)

    def watch_for_restarts(self) -> None:
        """Make `restarted` report restarts from now on."""
        self._boots_since_enabled = 0

    def enable(self) -> None:
        """Bring the drive to OPERATION ENABLED; raise DeviceFaultError if that fails."""
        if not self.begin_enabling():
            self.await_enabled()

    def begin_enabling(self) -> bool:
        """Send the controlwords to OPERATION ENABLED; return False if the driver still settles.

        Raises:
            DeviceFaultError: the drive does not reach the state.
        """
        self.watch_for_restarts()
        state, told = State.NOT_READY_TO_SWITCH_ON, 0

        def done() -> bool:
            nonlocal state, told
            state = self.state()
            if state is State.SWITCHED_ON and told == ENABLE_OPERATION:
                return True
            told = _ENABLING.get(state, told)
            if state in _ENABLING:
                self.write(od.CONTROLWORD, told)
            return state not in _ENABLING

        wait_until(self._link, done, _STATE_TIMEOUT_S, _STATUS_WAIT_S)
        if state is not State.SWITCHED_ON:
            self._require_enabled(state)
        return state is State.OPERATION_ENABLED

    def await_enabled(self) -> None:
        """Wait until the driver has settled (2001h:06); raise DeviceFaultError if the drive is not enabled after it."""
        timeout_s = _STATE_TIMEOUT_S + 1e-6 * self.read(od.SETTLING_US)
        state = State.SWITCHED_ON

        def done() -> bool:
            nonlocal state
            state = self.state()
            return state is not State.SWITCHED_ON

        wait_until(self._link, done, timeout_s)
        self._require_enabled(state)

    def _require_enabled(self, state: State) -> None:
        if state is State.OPERATION_ENABLED:
            return
        why = error_words(self.read(od.ERROR_CODE)) if state in FAULT_STATES else f"it is {state_words(state)}"
        raise DeviceFaultError(f"{self.name}: cannot be enabled, the drive is in {state_text(state)}").plainly(
            f"{self.name} cannot be switched on: {why}"
        )

    def disable(self) -> None:
        """Switch the drive's power off."""
        self.write(od.CONTROLWORD, 0)

    def emergency_stop(self) -> None:
        """Stop the axis and hold it in FAULT, with its power off, until a fault reset."""
        self.write(od.EMERGENCY_STOP, 1)

    def switch_output(self, output: DigitalOutput, *, on: bool) -> None:
        """Switch one digital output; the other outputs of the axis do not change."""
        outputs = self.read(od.DIGITAL_OUTPUTS)
        self.write(od.DIGITAL_OUTPUTS, outputs | output if on else outputs & ~output)

    # --- process data out

    def send_record(self, payload: bytes) -> None:
        """Send the eight bytes of a PVT record by RPDO4."""
        self._link.network.send_message(self._record_cob_id, payload)

    def send_interpolation_controlword(self, controlword: int) -> None:
        """Send a controlword by RPDO1, together with the mode interpolated position; it takes effect at once."""
        data = struct.pack("<Hb", controlword, Mode.INTERPOLATED_POSITION)
        self._link.network.send_message(COB_RPDO[0] + self.node_id, data)

    def send_latched_controlword(self, controlword: int) -> None:
        """Send a controlword by RPDO2; it takes effect at the next SYNC."""
        self._link.network.send_message(COB_RPDO[1] + self.node_id, struct.pack("<H", controlword))
