"""One axis as a CANopen node: joins the protocol services, the drive's state machine, its modes and its motion."""

from collections.abc import Callable
from functools import partial

from controller.drive import ENERGISED, next_state
from controller.homing import Homing
from controller.interpolation import Interpolation
from controller.modes import Mode, NoMode
from controller.motion import STOP_MAX_MS, Motion, StepConfig
from controller.profile_feed import ProfileFeed
from controller.profile_position import ProfilePosition
from controller.profile_velocity import ProfileVelocity
from protocol import cia402
from protocol.abort import AbortCode, SdoAbortError
from protocol.cia402 import AbortConnection, Control, ErrorCode, State, Status
from protocol.cob_id import check_cob_id
from protocol.datatypes import DataType
from protocol.dictionary import FlashPage, ObjectDictionary
from protocol.emergency import EmergencyProducer
from protocol.frame import COB_HEARTBEAT, COB_ID_INVALID, COB_SDO_RESPONSE, Frame
from protocol.heartbeat_consumer import HeartbeatConsumer
from protocol.nmt import HeartbeatProducer, NmtCommand, NmtState, after_error, target_of
from protocol.objects import HISTORY_DEPTH, key_of
from protocol.pdo import ProcessData
from protocol.pvt import VELOCITY_PER_UNIT_PER_MS
from protocol.sdo_server import SdoServer
from protocol.storage import ParameterStorage
from protocol.sync import SyncConsumer

MICROSTEP_SETTINGS = (1, 2, 8, 16)
"""TB6560AHQ datasheet (2014-10-01), page 9: the excitation modes that M1 and M2 select."""

_ABORT_CONTROLWORDS = {
    AbortConnection.DISABLE_VOLTAGE: cia402.DISABLE_VOLTAGE,
    AbortConnection.QUICK_STOP: cia402.QUICK_STOP,
}
"""What the drive obeys in place of its lost host."""

_FAULT_STATES = (State.FAULT_REACTION_ACTIVE, State.FAULT)
_PDO_LENGTH_ERRORS = (ErrorCode.PDO_TOO_SHORT, ErrorCode.PDO_TOO_LONG)

_STEP_CONFIG_KEYS = (
    key_of(0x2000, 1),
    key_of(0x2001, 1),
    key_of(0x2001, 2),
    key_of(0x2001, 3),
    key_of(0x2001, 4),
    key_of(0x607F),
)
"""In the order of StepConfig's fields."""


class AxisNode:
    """The firmware of one axis. Every call that depends on time is told the time; frames leave by `outbox`."""

    def __init__(self, node_id: int, axis: int, motion: Motion, flash_page: FlashPage) -> None:
        self.node_id = node_id
        self.axis = axis
        self.nmt_state = NmtState.INITIALISING
        self.state = State.NOT_READY_TO_SWITCH_ON
        self.energised = False
        """Whether the driver's outputs are to be on."""
        self.outputs = 0
        """The levels of the axis' digital outputs, by their bits in 0x60FE:01."""
        self.outbox: list[Frame] = []
        self.due_us: int | None = None
        """When `poll` wants to be called next."""
        self.dictionary = ObjectDictionary(node_id, stored=flash_page)
        self.process_data = ProcessData(self.dictionary)
        self._motion = motion
        self._now_us = 0
        self._controlword = 0
        self._after_stop: State | None = None
        self._statusword = 0
        self._touched = False
        """Whether anything happened since the last look at what there is to send."""
        self.routes_changed = True
        """Whether the COB-IDs that this node listens to may have changed."""
        self._sdo = SdoServer(self.dictionary)
        self._sync = SyncConsumer(self.dictionary)
        self._heartbeat = HeartbeatProducer()
        self._emergency = EmergencyProducer()
        self._heartbeat_consumer = HeartbeatConsumer(self.dictionary)
        self.connection_lost = False
        """Whether a node that this one listens to has just been lost: `abort_connection` answers it."""
        self.interpolation = Interpolation(
            axis,
            motion,
            self.dictionary,
            report=self._report,
            resolved=lambda gone: self._resolve(lambda code, _: code is gone),
            status_changed=self._pvt_status_changed,
            ramp_down=self._ramp_down,
        )
        self._feed = ProfileFeed(
            axis,
            motion,
            self.dictionary,
            now_us=lambda: self._now_us,
            close_records=self.interpolation.close,
            refused=self._profile_refused,
        )
        self._profile_velocity = ProfileVelocity(axis, motion, self.dictionary, self._feed)
        self._modes: dict[int, Mode] = {
            cia402.Mode.NONE: NoMode(axis, motion),
            cia402.Mode.PROFILE_POSITION: ProfilePosition(axis, motion, self.dictionary, self._feed),
            cia402.Mode.PROFILE_VELOCITY: self._profile_velocity,
            cia402.Mode.HOMING: Homing(axis, motion, self.dictionary, self.interpolation.discard),
            cia402.Mode.INTERPOLATED_POSITION: self.interpolation,
        }
        self._mode_number = int(cia402.Mode.NONE)
        self._install_hooks()
        ParameterStorage(self.dictionary, flash_page, busy=self._board_moves)

    # --- power-up and network management

    def boot(self, now_us: int) -> None:
        """Power-up: announce the node, then wait in PRE-OPERATIONAL and SWITCH ON DISABLED."""
        self._now_us = now_us
        self._reset_application()
        self._reset_communication()
        self._settle()

    def on_nmt(self, command: NmtCommand, now_us: int) -> None:
        """Obey a network management command that is meant for this node."""
        self._now_us = now_us
        if command is NmtCommand.RESET_NODE:
            self._reset_application()
        target = target_of(command)
        if target is NmtState.INITIALISING:
            self._reset_communication()
        else:
            self._change_nmt_state(target)
        self._settle()

    def _change_nmt_state(self, target: NmtState) -> None:
        if target is not self.nmt_state:
            self.nmt_state = target
            self.process_data.configurable = target is NmtState.PRE_OPERATIONAL
            self.process_data.invalidate()

    def _reset_application(self) -> None:
        """Lose everything that a power cycle would lose but the axis' position."""
        self._motion.flush(self.axis)
        self.dictionary.reset(0x2000)
        self._motion.configure(self.axis, self._step_config())
        self._emergency.forget()
        self._controlword = 0
        self.outputs = 0
        self._mode.interrupted()
        self._mode_number = int(cia402.Mode.NONE)
        self.interpolation.restart()
        self._enter(State.SWITCH_ON_DISABLED)

    def _reset_communication(self) -> None:
        self.dictionary.reset(0x1000, 0x1FFF)
        self._sdo.reset()
        self._heartbeat.set_period(self.dictionary.get(0x1017) * 1000, self._now_us)
        self._emergency.inhibit = self.dictionary.get(0x1015)
        self._emergency.reset_communication()
        self._heartbeat_consumer.restart()
        self.connection_lost = False
        self.nmt_state = NmtState.PRE_OPERATIONAL
        self.process_data.configurable = True
        self.process_data.invalidate()
        self.outbox.append(Frame(COB_HEARTBEAT + self.node_id, bytes((NmtState.INITIALISING,))))

    # --- frames in

    def on_sdo(self, data: bytes, now_us: int) -> None:
        """Answer an SDO request; a stopped node stays silent."""
        if self.nmt_state is NmtState.STOPPED:
            return
        self._now_us = now_us
        for response in self._sdo.handle(data):
            self.outbox.append(Frame(COB_SDO_RESPONSE + self.node_id, response))
        self._settle()

    def on_rpdo(self, number: int, data: bytes, now_us: int) -> None:
        """Take process data, in OPERATIONAL only."""
        if self.nmt_state is not NmtState.OPERATIONAL:
            return
        self._now_us = now_us
        error = self.process_data.receive_pdos[number].receive(data)
        if error:
            self._report(error, number + 1)
        elif self._emergency.register:
            self._resolve(lambda code, detail: code in _PDO_LENGTH_ERRORS and detail == number + 1)
        if self._touched:  # most frames are PVT records, which change nothing that is sent at once
            self._settle()

    def on_sync(self, data: bytes, now_us: int) -> None:
        """Apply latched RPDOs, then send the TPDOs whose turn it is."""
        if self.nmt_state is not NmtState.OPERATIONAL:
            return
        self._now_us = now_us
        counter = self._sync.counter_of(data)
        if counter is None:
            self._report(ErrorCode.SYNC_LENGTH, len(data))
            self._settle()
            return
        if self._emergency.register:
            self._resolve(lambda code, _: code is ErrorCode.SYNC_LENGTH)
        for receive_pdo in self.process_data.receive_pdos:
            receive_pdo.on_sync()
        for transmit_pdo in self.process_data.transmit_pdos:
            frame = transmit_pdo.on_sync(counter) if transmit_pdo.exists else None
            if frame:
                self.outbox.append(frame)
        self._settle()

    @property
    def heartbeat_producers(self) -> list[int]:
        """The node ids whose heartbeats this node wants to hear."""
        return self._heartbeat_consumer.producers

    def on_heartbeat(self, producer_id: int, data: bytes, now_us: int) -> None:
        """Hear another node's heartbeat, in every state; a lost one that is back is an error less.

        While the drive is in fault the error stays: it goes with the fault reset.
        """
        self._now_us = now_us
        if self._heartbeat_consumer.receive(producer_id, data, now_us) and self.state not in _FAULT_STATES:
            self._resolve(self._is_over)
        self._settle()

    # --- a lost host

    def _watch_connection(self) -> None:
        """Report the producers that have fallen silent."""
        for producer_id in self._heartbeat_consumer.poll(self._now_us):
            self._report(ErrorCode.HEARTBEAT_LOST, producer_id)
            self.connection_lost = True

    @property
    def signals_lost_connection(self) -> bool:
        """Whether a lost connection is a fault of the drive, by 0x6007."""
        return self.dictionary.get(0x6007) == AbortConnection.FAULT_SIGNAL

    def abort_connection(self, now_us: int) -> None:
        """Do what the host would have done last, by 0x6007, and leave OPERATIONAL, by 0x1029.

        A fault that is to be signalled is the firmware's to begin: it may concern the whole group.
        """
        self._now_us = now_us
        self.connection_lost = False
        controlword = _ABORT_CONTROLWORDS.get(AbortConnection(self.dictionary.get(0x6007)))
        if controlword is not None:
            target = next_state(self.state, controlword, self._controlword)
            if target is not (self._after_stop or self.state):
                self._leave_for(target)
        self._change_nmt_state(after_error(self.nmt_state, self.dictionary.get(0x1029, 1)))
        self._settle()

    # --- motion's news

    def finished(self, now_us: int) -> None:
        """The axis has come to rest at the end of its segments."""
        self._now_us = now_us
        if self.state is State.FAULT_REACTION_ACTIVE:
            self._enter(State.FAULT)
        elif self.state is State.QUICK_STOP_ACTIVE:
            self._enter(State.SWITCH_ON_DISABLED)
        elif self._after_stop:
            self._enter(self._after_stop)
        else:
            self._mode.finished()
        self._settle()

    def time_scaled(self, now_us: int) -> None:
        """The group's time halts, has come to rest or goes on: report what that changes."""
        self._now_us = now_us
        self._settle()

    def stop_ms(self) -> int:
        """How long the quick-stop ramp 0x6085 takes from the present velocity: at least 1 ms, at most what fits."""
        velocity = abs(self._motion.velocity(self.axis))
        deceleration = self.dictionary.get(0x6085) * VELOCITY_PER_UNIT_PER_MS
        return min(max(1, -(-velocity * 1_000_000 // deceleration)), STOP_MAX_MS)

    def fault(self, code: ErrorCode, stop_ms: int, now_us: int) -> None:
        """Enter the fault reaction: say why, ramp down, then switch off.

        A drive that reacts to a fault already or is switched off stays as it is: a fault must not switch it on again.
        """
        self._now_us = now_us
        if self.state is State.FAULT_REACTION_ACTIVE or not self.energised:
            return
        self._set_error(code)
        if not self._emergency.is_active(code):
            self._report(code, 0)
        moving = self._motion.running(self.axis) or self._motion.velocity(self.axis) != 0
        if code is ErrorCode.PVT_UNDERRUN:
            self.interpolation.underrun()
        if moving:
            self._ramp_down(stop_ms)
        self._enter(State.FAULT_REACTION_ACTIVE if self._motion.running(self.axis) else State.FAULT)
        self._settle()

    def on_can_error(self, code: ErrorCode, now_us: int, *, active: bool) -> None:
        """Tell by EMCY what befalls the board's CAN controller; the drive goes on."""
        self._now_us = now_us
        if active:
            self._report(code, 0)
        else:
            self._resolve(lambda gone, _: gone is code)
        self._settle()

    # --- the drive

    @property
    def _mode(self) -> Mode:
        return self._modes[self._mode_number]

    def _write_controlword(self, controlword: int) -> None:
        """Obey a controlword. While a ramp leads out of OPERATION ENABLED the last command says what comes after it.

        "Enable operation" then keeps the drive enabled, as transition 4 would after the ramp; the ramp goes on to rest.
        """
        self._touched = True
        previous, self._controlword = self._controlword, controlword
        target = next_state(self.state, controlword, previous)
        if target is not (self._after_stop or self.state):
            self._leave_for(target)
        if self.state is State.OPERATION_ENABLED and self._after_stop is None:
            self._mode.control(controlword, previous)

    def _leave_for(self, target: State) -> None:
        """Change state by command: a moving axis ramps down first, unless its voltage is to be cut."""
        if self.state is State.FAULT:
            self._set_error(ErrorCode.NONE)
            self._resolve(self._is_over)
        if self._motion.running(self.axis):
            if target is State.SWITCH_ON_DISABLED:
                self._motion.flush(self.axis)
            elif target is not State.OPERATION_ENABLED:
                self._ramp_down()
        moving = self._motion.running(self.axis)
        if moving and target in (State.READY_TO_SWITCH_ON, State.SWITCHED_ON):
            self._after_stop = target
        elif target is State.QUICK_STOP_ACTIVE and not moving:
            self._enter(State.SWITCH_ON_DISABLED)
        else:
            self._enter(target)

    def _ramp_down(self, stop_ms: int | None = None) -> None:
        """Stop with constant deceleration, by default that of the quick stop; dead where there is no room for it."""
        self._motion.stop(self.axis, self.stop_ms() if stop_ms is None else stop_ms)
        self._mode.interrupted()

    def _enter(self, state: State) -> None:
        self.state = state
        self.energised = state in ENERGISED
        self._after_stop = None
        if state is not State.OPERATION_ENABLED:
            self._mode.interrupted()

    def _write_mode(self, mode: int) -> None:
        if mode not in self._modes:
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        if mode != self._mode_number and self._motion.running(self.axis):
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        if mode != self._mode_number:
            self._mode.interrupted()
            self._mode_number = mode
            self._changed(0x6061)
            if self.state is State.OPERATION_ENABLED:  # without an edge: only levels count in a mode just entered
                self._mode.control(self._controlword, self._controlword)

    def statusword(self) -> int:
        """Object 0x6041, composed of the state's, the drive's and the mode's bits."""
        word = self.state.bits | Status.VOLTAGE_ENABLED
        if self.nmt_state is NmtState.OPERATIONAL:
            word |= Status.REMOTE
        enabled = self.state is State.OPERATION_ENABLED
        if self._mode.target_reached() if enabled else not self._motion.running(self.axis):
            word |= Status.TARGET_REACHED
        if enabled:
            word |= self._mode.status_bits()
        return word

    # --- what the dictionary reads and writes elsewhere

    def _install_hooks(self) -> None:
        read, write = self.dictionary.read_hooks, self.dictionary.write_hooks
        read[key_of(0x1001)] = lambda: self._emergency.register
        read[key_of(0x1003)] = lambda: len(self._emergency.history)
        for i in range(1, HISTORY_DEPTH + 1):
            read[key_of(0x1003, i)] = partial(self._history, i)
        read[key_of(0x2012, 5)] = lambda: self._now_us & 0xFFFF_FFFF
        read[key_of(0x6041)] = self.statusword
        read[key_of(0x6061)] = lambda: self._mode_number
        read[key_of(0x6062)] = lambda: _saturated(self._motion.demand_units(self.axis))
        read[key_of(0x6064)] = lambda: _saturated(self._motion.counter_units(self.axis))
        read[key_of(0x606C)] = self._velocity_units_per_s
        read[key_of(0x60F4)] = self._following_error_units
        write[key_of(0x1003)] = lambda _: self._emergency.history.clear()
        write[key_of(0x1014)] = lambda cob_id: check_cob_id(self.dictionary.get(0x1014), cob_id)
        write[key_of(0x1015)] = self._write_emergency_inhibit
        write[key_of(0x1017)] = lambda period_ms: self._heartbeat.set_period(period_ms * 1000, self._now_us)
        write[key_of(0x6040)] = self._write_controlword
        write[key_of(0x6060)] = self._write_mode
        write[key_of(0x6086)] = self._write_profile_type
        write[key_of(0x60FE, 1)] = lambda physical: self._switch_outputs(physical, self.dictionary.get(0x60FE, 2))
        write[key_of(0x60FE, 2)] = lambda mask: self._switch_outputs(self.dictionary.get(0x60FE, 1), mask)
        write[key_of(0x60FF)] = self._write_target_velocity
        for key in _STEP_CONFIG_KEYS:
            write[key] = partial(self._write_step_config, key)

    def _history(self, position: int) -> int:
        history = self._emergency.history
        return history[position - 1] if position <= len(history) else 0

    def _write_target_velocity(self, units_per_s: int) -> None:
        self._touched = True
        self._profile_velocity.write_target(units_per_s)

    def _write_profile_type(self, profile_type: int) -> None:
        if profile_type not in (cia402.LINEAR_RAMP, cia402.JERK_LIMITED_RAMP):
            raise SdoAbortError(AbortCode.VALUE_RANGE)

    def _profile_refused(self) -> None:
        """A profile's segment was refused: it would leave the range of a position."""
        self.fault(ErrorCode.SEGMENT_REFUSED, self.stop_ms(), self._now_us)

    def _write_emergency_inhibit(self, inhibit: int) -> None:
        self._emergency.inhibit = inhibit

    def _board_moves(self) -> bool:
        """An STM32F103 halts while it writes its flash: no axis may want steps then."""
        return any(self._motion.running(axis) for axis in range(self._motion.axis_count))

    def _switch_outputs(self, physical: int, mask: int) -> None:
        """In any drive state, and no state or fault switches them back: a gripper must not drop its load."""
        self.outputs = physical & mask

    def _velocity_units_per_s(self) -> int:
        return self._motion.velocity(self.axis) * 1000 // VELOCITY_PER_UNIT_PER_MS

    def _following_error_units(self) -> int:
        return _saturated(self._motion.demand_units(self.axis) - self._motion.counter_units(self.axis))

    def _write_step_config(self, key: int, value: int) -> None:
        """Steps may be reconfigured while the driver is off: a TB6560 changes its mode only in reset (page 15).

        Records that wait are dropped: the old limit has let them in, the room for their edges follows from the new one.
        """
        if self.energised:
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        if key == key_of(0x2000, 1) and value not in MICROSTEP_SETTINGS:
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        self.interpolation.discard()
        self._motion.configure(self.axis, self._step_config({key: value}))

    def _step_config(self, changes: dict[int, int] | None = None) -> StepConfig:
        changes = changes or {}
        return StepConfig(*(changes.get(key, self.dictionary.get(key >> 8, key & 0xFF)) for key in _STEP_CONFIG_KEYS))

    # --- frames out

    def _changed(self, index: int, subindex: int = 0) -> None:
        """A value has changed that event-driven TPDOs report."""
        self._touched = True
        self.process_data.changed(index, subindex)

    def _pvt_status_changed(self) -> None:
        self._changed(0x2012, 3)

    def _set_error(self, code: ErrorCode) -> None:
        self.dictionary.set(0x603F, 0, code)
        self._changed(0x603F)

    def _report(self, code: ErrorCode, detail: int) -> None:
        self._touched = True
        self._emergency.raise_error(code, detail)

    def _resolve(self, gone: Callable[[ErrorCode, int], bool]) -> None:
        self._touched = True
        self._emergency.resolve(gone)

    def _is_over(self, code: ErrorCode, detail: int) -> bool:
        """Whether an active error has no cause any more once the drive is out of its fault."""
        if code is ErrorCode.HEARTBEAT_LOST:
            return detail not in self._heartbeat_consumer.lost
        return not code.communication

    def _settle(self) -> None:
        """After anything that happened: note changed values, then find out when to send."""
        if self.process_data.refresh(self._now_us) or self._heartbeat_consumer.changed:
            self._heartbeat_consumer.changed = False
            self.routes_changed = True
        interpolating = self._mode is self.interpolation
        self.interpolation.ready = interpolating and self.state is State.OPERATION_ENABLED
        self._motion.group.hold(self.axis, hold=interpolating and bool(self._controlword & Control.HALT))
        statusword = self.statusword()
        if statusword != self._statusword:
            self._statusword = statusword
            self.process_data.changed(0x6041)
        self._schedule()
        self._touched = False

    def _schedule(self) -> None:
        dues = [self._heartbeat.due_us, self._heartbeat_consumer.due_us, self._feed.due_us]
        if self.nmt_state is not NmtState.STOPPED:
            dues.append(self._emergency.due_us)
        if self.nmt_state is NmtState.OPERATIONAL:
            dues += [pdo.due_us for pdo in self.process_data.transmit_pdos if pdo.exists]
        self.due_us = min((due for due in dues if due is not None), default=None)

    def poll(self, now_us: int) -> None:
        """Do what is due: fill the queue of a profile, send heartbeat, emergencies, event-driven TPDOs."""
        self._now_us = now_us
        if self._feed.due_us is not None and self._feed.due_us <= now_us:
            self._feed.fill()
            self._settle()
        self._watch_connection()
        if self._heartbeat.poll(now_us):
            self.outbox.append(Frame(COB_HEARTBEAT + self.node_id, bytes((self.nmt_state,))))
        if self.nmt_state is not NmtState.STOPPED:
            payload = self._emergency.poll(now_us)
            cob_id = self.dictionary.get(0x1014)
            if payload and not cob_id & COB_ID_INVALID:
                self.outbox.append(Frame(cob_id, payload))
        if self.nmt_state is NmtState.OPERATIONAL:
            for pdo in self.process_data.transmit_pdos:
                frame = pdo.poll(now_us) if pdo.exists else None
                if frame:
                    self.outbox.append(frame)
        self._schedule()


def _saturated(units: int) -> int:
    """A position as i32: within a segment, and by the rounding to a step, an axis may be a little beyond its ends."""
    return min(max(units, DataType.INTEGER32.low), DataType.INTEGER32.high)
