"""One axis as a CANopen node: network management, frames in and out, and the services between bus and drive."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from steptwin.controller.node.axis_context import AxisContext, BoardContext
from steptwin.controller.node.axis_drive import AxisDrive
from steptwin.controller.node.charge import Charge
from steptwin.controller.node.lss_slave import LssSlave
from steptwin.controller.node.pins import AxisPins, Pin
from steptwin.controller.node.stops import LOSS_EFFECTS, ConnectionLoss
from steptwin.controller.node.time_of_day import TimeOfDay
from steptwin.controller.node.transmit_queue import Outbox, Service
from steptwin.protocol import od
from steptwin.protocol.cia402 import AbortConnection, ErrorCode, State, Status
from steptwin.protocol.dictionary import FlashPage, ObjectDictionary
from steptwin.protocol.frame import COB_HEARTBEAT, COB_SDO_RESPONSE, Frame
from steptwin.protocol.lss import COB_LSS_RESPONSE, UNCONFIGURED
from steptwin.protocol.nmt import GuardedNode, HeartbeatProducer, NmtCommand, NmtState, after_error, target_of
from steptwin.protocol.pdo import ProcessData, act_on_sync
from steptwin.protocol.sdo_server import SdoServer
from steptwin.protocol.storage import ParameterStorage, checksum

_RETRY_US: Final = 1000
"""Time after which an EMCY is tried again if the transmit queue has no place."""
_OPERATIONAL: Final = NmtState.OPERATIONAL  # bound once: access to an enum's member costs time for every frame
_FAULT_STATES: Final = (State.FAULT_REACTION_ACTIVE, State.FAULT)
_GUARDING_MASTER: Final = 0
"""Detail of a lost heartbeat (8130h) if the master of node guarding is lost; else it is a node id."""
_SILENT: Final = (NmtState.STOPPED, NmtState.INITIALISING)
"""NMT states in which a node neither answers SDO requests nor sends EMCYs."""


class AxisNode:
    """The firmware of one axis. Every call receives the time; frames to send go to the board's transmit queue."""

    def __init__(self, axis: int, node_id: int, flash_page: FlashPage, board: BoardContext) -> None:
        self.axis = axis
        self.serial_number = node_id
        """Set in the factory to the default node id of the axis. LSS may change the node id, not the serial number."""
        self.nmt_state: NmtState = NmtState.INITIALISING
        self.due_us: int | None = None
        """Time of the next call of `poll`; None if nothing is due."""
        self.routes_changed: bool = True
        """True if the node's COB-IDs may have changed; the firmware resets it."""
        self.connection_loss: ConnectionLoss | None = None
        """Reason of a connection loss by time-out, until `abort_connection` handles it; else None."""
        self._resetting = False
        """True while the axis stops before the node is reset."""
        self._context = context = AxisContext(axis, node_id, flash_page, board)
        self.dictionary: ObjectDictionary = context.dictionary
        identity = *map(context.dictionary.get, (od.VENDOR_ID, od.PRODUCT_CODE, od.REVISION_NUMBER)), node_id
        self._lss = LssSlave(identity, node_id, flash_page, board.bit_timing, busy=self._board_moves)
        self.node_id: int = self._lss.active_id
        self.process_data: ProcessData = context.process_data
        self.pins: AxisPins = context.pins
        self._motion = context.motion
        self._clock_zero_us = 0
        """Instant when the high resolution time stamp (1013h) was 0."""
        self._statusword = 0
        self._sdo = SdoServer(self.dictionary)
        self._heartbeat = HeartbeatProducer()
        self._guarded = GuardedNode()
        self._time_of_day = TimeOfDay(context)
        self._heartbeats = context.heartbeats
        self._errors = context.errors
        self._bit_timing = board.bit_timing
        self._outbox = Outbox(axis, board.transmit, context.dictionary, context.errors)
        self._charge = Charge(self.dictionary)
        self.drive: AxisDrive = AxisDrive(context)
        self.dictionary.bind(self)
        ParameterStorage(self.dictionary, flash_page, busy=self._board_moves)

    @property
    def board_clock_us(self) -> int:
        """Time since power-up, modulo 2^32."""
        return self._context.now_us & 0xFFFF_FFFF

    @property
    def time_stamp_us(self) -> int:
        """The high resolution time stamp (1013h)."""
        return self._context.now_us - self._clock_zero_us & 0xFFFF_FFFF

    def set_clock(self, time_us: int) -> None:
        """Set the high resolution time stamp."""
        self._clock_zero_us = self._context.now_us - time_us

    @property
    def robot_name_crc(self) -> int:
        """CRC-32 of the robot's name (2016h)."""
        return checksum(self.dictionary.text(od.ROBOT_NAME))

    def switch_outputs_at(self, address: int, value: int) -> None:
        """Set the digital outputs (60FEh:01 and its mask :02); `value` is the new value of one of these entries."""
        other = od.DIGITAL_OUTPUTS if address == od.DIGITAL_OUTPUTS_MASK else od.DIGITAL_OUTPUTS_MASK
        self.pins.switch_outputs(value & self.dictionary.get(other))

    def set_heartbeat_period(self, period_ms: int) -> None:
        """Set the heartbeat's period; 0 switches it off. A node with a heartbeat does not answer node guarding."""
        self._heartbeat.set_period(period_ms * 1000, self._context.now_us)
        self._guarded.restart()

    def restart_guarding(self, _value: int) -> None:
        """Wait for the next request of the guarding master, because the node life time changes (100Ch, 100Dh)."""
        self._guarded.due_us = None

    @property
    def configured(self) -> bool:
        """True if the node has a node id; without one it only uses LSS."""
        return self.node_id != UNCONFIGURED

    def _board_moves(self) -> bool:
        """Return whether an axis of the board moves: an STM32F103 cannot make steps while it writes its flash."""
        return bool(self._context.board.motion.running_axes)

    # --- power-up and network management

    def boot(self, now_us: int) -> None:
        """Power up: announce the node, then wait in PRE-OPERATIONAL and SWITCH ON DISABLED."""
        self._context.now_us = now_us
        self._reset_application()
        self.pins.set(Pin.RESET, 1)
        self._reset_communication()
        self._end_call()

    def on_nmt(self, command: NmtCommand, now_us: int) -> None:
        """Obey an NMT command to this node; ignore it while the node waits for a reset."""
        if self._resetting or not self.configured:
            return
        self._context.now_us = now_us
        target = target_of(command)
        if command is NmtCommand.RESET_NODE:
            self._begin_reset()
        elif target is NmtState.INITIALISING:
            self._reset_communication()
            self._lose_connection(ConnectionLoss.RESET_COMMUNICATION)
        elif target is not self.nmt_state:
            self._change_nmt_state(target)
            if target is NmtState.STOPPED:
                self._lose_connection(ConnectionLoss.NMT_STOPPED)
        self._end_call()

    def _begin_reset(self) -> None:
        """Stop the axis by the abort connection option code (6007h), send nothing meanwhile, then restart.

        With the option "no action" the pulses end at once.
        """
        self._lose_connection(ConnectionLoss.RESET_APPLICATION)
        if self.dictionary.get(od.ABORT_CONNECTION_OPTION) == AbortConnection.NO_ACTION:
            self.drive.stop.cut()
        self._heartbeat.set_period(0, self._context.now_us)
        self._change_nmt_state(NmtState.INITIALISING)
        self._resetting = True

    def _change_nmt_state(self, target: NmtState) -> None:
        if target is not self.nmt_state:
            self.nmt_state = target
            self.process_data.configurable = target is NmtState.PRE_OPERATIONAL
            self.process_data.invalidate()

    def _reset_application(self) -> None:
        """Reset the application as by a power cycle. An axis at standstill keeps its position."""
        self.drive.reset()
        self.dictionary.reset(first_index=0x2000)
        self.drive.apply_parameters()
        self._errors.forget()
        self.pins.switch_outputs(0)

    def _reset_communication(self) -> None:
        self._take_node_id()
        self.dictionary.reset(last_index=0x1FFF)
        self._sdo.reset()
        self.set_heartbeat_period(self.dictionary.get(od.PRODUCER_HEARTBEAT_TIME))
        self._errors.reset_communication()
        self._heartbeats.restart()
        self._outbox.reset()
        self._charge.forget()
        self.connection_loss = None
        self.nmt_state = NmtState.PRE_OPERATIONAL if self.configured else NmtState.INITIALISING
        self.process_data.configurable = True
        self.process_data.invalidate()
        if not self.configured:
            self.set_heartbeat_period(0)
            return
        self._send(Service.NMT, COB_HEARTBEAT + self.node_id, bytes((NmtState.INITIALISING,)))

    def _take_node_id(self) -> None:
        """Use the node id that a master has set by LSS. Stored COB-IDs do not change."""
        self.node_id = self._lss.active_id = self._lss.pending_id
        self._context.board.node_ids[self.axis] = self.node_id
        self.dictionary.renumber(self.node_id)
        self.routes_changed = True

    # --- frames in

    def on_lss(self, data: bytes, now_us: int) -> None:
        """Obey a request of an LSS master in any NMT state."""
        self._context.now_us = now_us
        answer = self._lss.handle(data, now_us)
        if answer:
            self._send(Service.LSS, COB_LSS_RESPONSE, answer)
        if self._lss.joins:
            self._reset_communication()
        self._end_call()

    def on_sdo(self, data: bytes, now_us: int) -> None:
        """Answer an SDO request, unless the node is stopped or restarts."""
        if self.nmt_state in _SILENT:
            return
        self._context.now_us = now_us
        for response in self._sdo.handle(data):
            self._send(Service.SDO, COB_SDO_RESPONSE + self.node_id, response)
        self._end_call()

    def on_rpdo(self, number: int, data: bytes, now_us: int) -> None:
        """Receive process data, in OPERATIONAL only."""
        if self.nmt_state is not _OPERATIONAL:
            return
        context = self._context
        context.now_us = now_us
        pdo = self.process_data.receive_pdos[number]
        error = pdo.receive(data)
        if error:
            self._errors.report(error, number + 1)
        elif self._errors.register:
            self._errors.pdo_received(number, in_fault=self.drive.state in _FAULT_STATES)
        if pdo.timeout_us:
            pdo.deadline_us = now_us + pdo.timeout_us
            self._note_deadline(pdo.deadline_us)
        if context.touched:  # false for most frames: a PVT record changes nothing that is sent at once
            self._end_call()

    def on_sync(self, data: bytes, now_us: int) -> None:
        """Apply the RPDOs latched for SYNC, then send the TPDOs that this SYNC triggers; both in OPERATIONAL only.

        SYNC is also active in PRE-OPERATIONAL (CiA 301, table 38), so its length is checked there.
        """
        if self.nmt_state in _SILENT:
            return
        self._context.now_us = now_us
        counter = self.process_data.sync_counter(data)
        if counter is None:
            self._errors.report(ErrorCode.SYNC_LENGTH, len(data))
            self._end_call()
            return
        if self._errors.register:
            self._errors.resolved(ErrorCode.SYNC_LENGTH)
        if self.nmt_state is not _OPERATIONAL:
            self._end_call()
            return
        act_on_sync(self.process_data.receive_pdos)
        self.drive.mode.on_sync()
        for number, transmit_pdo in enumerate(self.process_data.transmit_pdos):
            frame = transmit_pdo.on_sync(counter) if transmit_pdo.exists else None
            if frame:
                self._outbox.send_process_data(number, frame, now_us)
        self._end_call()

    def on_guarding(self, _data: bytes, now_us: int) -> None:
        """Answer a request of node guarding in any NMT state, unless the node sends heartbeats or restarts."""
        if self._heartbeat.period_us or self.nmt_state is NmtState.INITIALISING:
            return
        self._context.now_us = now_us
        get = self.dictionary.get
        if self._guarded.lost and self.drive.state not in _FAULT_STATES:
            self._errors.resolved(ErrorCode.HEARTBEAT_LOST, _GUARDING_MASTER)
        life_time_us = 1000 * get(od.GUARD_TIME) * get(od.LIFE_TIME_FACTOR)
        answer = self._guarded.answer(self.nmt_state, life_time_us, now_us)
        self._send(Service.NMT, COB_HEARTBEAT + self.node_id, answer)
        self._end_call()

    def on_time(self, data: bytes, now_us: int) -> None:
        """Set the time of day by TIME, in PRE-OPERATIONAL and OPERATIONAL."""
        if self.nmt_state in _SILENT:
            return
        self._context.now_us = now_us
        self._time_of_day.receive(data)

    @property
    def heartbeat_producers(self) -> list[int]:
        """Node ids of the monitored heartbeats."""
        return self._heartbeats.producers

    def on_heartbeat(self, producer_id: int, data: bytes, now_us: int) -> None:
        """Receive another node's heartbeat in any NMT state; a producer that is back resolves its error.

        If the drive is in fault, the error stays active until the fault reset.
        """
        self._context.now_us = now_us
        if self._heartbeats.receive(producer_id, data, now_us) and self.drive.state not in _FAULT_STATES:
            self._errors.acknowledge_faults()
            self._end_call()
            return
        if self._heartbeats.due_us is not None:
            self._note_deadline(self._heartbeats.due_us)

    def _note_deadline(self, deadline_us: int) -> None:
        """Schedule the next poll for a deadline, if that is earlier.

        A frame usually moves its deadline to a later time. Then `due_us` stays, and that poll schedules again.
        """
        if self.due_us is None or deadline_us < self.due_us:
            self._set_due_time()

    # --- errors of the bus

    def _watch_connection(self) -> None:
        """Report late RPDOs, lost heartbeat producers and a lost master."""
        if self.nmt_state is NmtState.OPERATIONAL:
            for number, pdo in enumerate(self.process_data.receive_pdos, start=1):
                if pdo.timed_out(self._context.now_us):
                    self._errors.report(ErrorCode.RPDO_TIMEOUT, number)
                    self.connection_loss = ConnectionLoss.RPDO_TIMEOUT
        for producer_id in self._heartbeats.poll(self._context.now_us):
            self._errors.report(ErrorCode.HEARTBEAT_LOST, producer_id)
            self._charge.forget()
            self.connection_loss = ConnectionLoss.HEARTBEAT
        if self._guarded.poll(self._context.now_us):
            self._errors.report(ErrorCode.HEARTBEAT_LOST, _GUARDING_MASTER)
            self.connection_loss = ConnectionLoss.LIFE_GUARDING

    def abort_connection(self, loss: ConnectionLoss, now_us: int) -> None:
        """React to a time-out that means a lost master; called after the polls of all nodes."""
        self._context.now_us = now_us
        self.connection_loss = None
        self._lose_connection(loss)
        self._end_call()

    def on_bus_off(self, now_us: int) -> None:
        """React to the bus-off of the board's CAN controller."""
        self._context.now_us = now_us
        self._lose_connection(ConnectionLoss.BUS_OFF)
        self._end_call()

    def _lose_connection(self, loss: ConnectionLoss) -> None:
        """Apply the abort connection option code (6007h) and, after a bus error, the error behaviour (1029h).

        The option code acts on the drive. The error behaviour determines the NMT state.
        """
        effect, get = LOSS_EFFECTS[loss], self.dictionary.get
        if get(od.ABORT_CONNECTION_OPTION) == AbortConnection.FAULT_SIGNAL:
            self._context.trip(effect.code, effect.detail)
        else:
            self.drive.abort_connection()
        if effect.by_error_behaviour:
            self._change_nmt_state(after_error(self.nmt_state, get(od.COMMUNICATION_ERROR_BEHAVIOUR)))

    def on_can_error(self, code: ErrorCode, now_us: int, *, active: bool) -> None:
        """Report an error of the board's CAN controller, or its end, by EMCY.

        If the drive is in fault, the error of a bus-off ends with the fault reset.
        """
        self._context.now_us = now_us
        if active:
            self._errors.report(code, 0)
        elif code is not ErrorCode.CAN_BUS_OFF_RECOVERED or self.drive.state not in _FAULT_STATES:
            self._errors.resolved(code, 0)
        self._end_call()

    # --- the drive

    @contextmanager
    def drive_at(self, now_us: int) -> Iterator[AxisDrive]:
        """Yield the drive for actions of the caller, then report the changes."""
        self._context.now_us = now_us
        yield self.drive
        self._end_call()

    def report_changes(self, now_us: int) -> None:
        """Report changes whose cause is outside of this node, such as a halt of its group."""
        self._context.now_us = now_us
        self._end_call()

    def statusword(self) -> int:
        """Return the statusword (6041h): the drive's bits, and "remote" if the node obeys controlwords by PDO."""
        return self.drive.statusword() | (Status.REMOTE if self.nmt_state is NmtState.OPERATIONAL else 0)

    # --- frames out

    def _end_call(self) -> None:
        """End a call: apply changed PDO parameters, announce a changed statusword, schedule the next poll."""
        if self._resetting and not self._motion.running:
            self._resetting = False
            self._reset_application()
            self._reset_communication()
        if self.process_data.refresh(self._context.now_us) or self._heartbeats.changed:
            if self._heartbeats.changed:
                self._charge.watch_changed()
            self._heartbeats.changed = False
            self.routes_changed = True
        self.drive.settle(self._context.now_us)
        self._charge.settle(self._context.now_us)
        statusword = self.statusword()
        if statusword != self._statusword:
            self._statusword = statusword
            self.process_data.changed(od.STATUSWORD)
        self._set_due_time()
        self._context.touched = False

    def _set_due_time(self) -> None:
        dues = [
            self._heartbeat.due_us,
            self._heartbeats.due_us,
            self._guarded.due_us,
            self._outbox.due_us,
            self._charge.due_us,
            self._bit_timing.due_us,
            *self.drive.dues_us(),
        ]
        if self.nmt_state not in _SILENT:
            dues.append(self._errors.due_us)
        if self.nmt_state is NmtState.OPERATIONAL:
            dues += [pdo.due_us for pdo in self.process_data.transmit_pdos if pdo.exists]
            dues += [pdo.deadline_us for pdo in self.process_data.receive_pdos]
        known = [due for due in dues if due is not None]
        self.due_us = min(known) if known else None

    def poll(self, now_us: int) -> None:
        """Do the work that is due: the drive, then heartbeat, EMCY and event-driven TPDOs."""
        self._context.now_us = now_us
        if self.drive.poll(now_us):
            self._end_call()
        self._watch_connection()
        self._charge.poll(now_us, watched=self._heartbeats.due_us is not None)
        self._bit_timing.poll(now_us)
        if self._heartbeat.poll(now_us):
            self._send(Service.NMT, COB_HEARTBEAT + self.node_id, bytes((self.nmt_state,)))
        self._outbox.poll(now_us)
        if self.nmt_state not in _SILENT:
            if not self._outbox.has_room(Service.EMCY):  # try again later: no EMCY is lost
                self._errors.postpone(now_us + _RETRY_US)
            elif emergency := self._errors.next_frame(now_us):
                self._outbox.send(Service.EMCY, emergency, now_us)
        if self.nmt_state is NmtState.OPERATIONAL:
            for number, pdo in enumerate(self.process_data.transmit_pdos):
                frame = pdo.poll(now_us) if pdo.exists else None
                if frame:
                    self._outbox.send_process_data(number, frame, now_us)
        self._set_due_time()

    def _send(self, service: Service, cob_id: int, data: bytes) -> None:
        self._outbox.send(service, Frame(cob_id, data), self._context.now_us)
