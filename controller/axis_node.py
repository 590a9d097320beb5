"""One axis as a CANopen node: joins the protocol services, the drive's state machine, its modes and its motion."""

from functools import partial

from controller.drive import ENERGISED, next_state
from controller.homing import Homing
from controller.interpolation import Interpolation
from controller.modes import Mode, NoMode
from controller.motion import STOP_MAX_MS, Motion, StepConfig
from protocol import cia402
from protocol.abort import AbortCode, SdoAbortError
from protocol.cia402 import ErrorCode, State, Status
from protocol.datatypes import DataType
from protocol.dictionary import ObjectDictionary
from protocol.emergency import EmergencyProducer
from protocol.frame import COB_EMCY, COB_HEARTBEAT, COB_SDO_RESPONSE, Frame
from protocol.nmt import HeartbeatProducer, NmtCommand, NmtState, target_of
from protocol.objects import HISTORY_DEPTH, key_of
from protocol.pdo import ProcessData
from protocol.pvt import VELOCITY_PER_UNIT_PER_MS
from protocol.sdo_server import SdoServer

MICROSTEP_SETTINGS = (1, 2, 8, 16)
"""TB6560AHQ datasheet (2014-10-01), page 9: the excitation modes that M1 and M2 select."""

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

    def __init__(self, node_id: int, axis: int, motion: Motion) -> None:
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
        self.dictionary = ObjectDictionary(node_id)
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
        self._heartbeat = HeartbeatProducer()
        self._emergency = EmergencyProducer()
        self.interpolation = Interpolation(
            axis,
            motion,
            self.dictionary,
            report=self._report,
            status_changed=self._pvt_status_changed,
            ramp_down=self._ramp_down,
        )
        self._modes: dict[int, Mode] = {
            cia402.Mode.NONE: NoMode(),
            cia402.Mode.HOMING: Homing(axis, motion, self.dictionary, self.interpolation.discard),
            cia402.Mode.INTERPOLATED_POSITION: self.interpolation,
        }
        self._mode_number = int(cia402.Mode.NONE)
        self._install_hooks()

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
        elif target is not self.nmt_state:
            self.nmt_state = target
            self.process_data.configurable = target is NmtState.PRE_OPERATIONAL
            self.process_data.invalidate()
        self._settle()

    def _reset_application(self) -> None:
        """Lose everything that a power cycle would lose but the axis' position."""
        self._motion.flush(self.axis)
        self.dictionary.restore_defaults(0x2000)
        self._motion.configure(self.axis, self._step_config())
        self._emergency.forget()
        self._controlword = 0
        self.outputs = 0
        self._mode_number = int(cia402.Mode.NONE)
        self.interpolation.restart()
        self._enter(State.SWITCH_ON_DISABLED)

    def _reset_communication(self) -> None:
        self.dictionary.restore_defaults(0x1000, 0x1FFF)
        self._sdo.reset()
        self._heartbeat.set_period(0, self._now_us)
        self._emergency.inhibit = 0
        self._emergency.drop_waiting()
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
        response = self._sdo.handle(data)
        if response is not None:
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
        if self._touched:  # most frames are PVT records, which change nothing that is sent at once
            self._settle()

    def on_sync(self, now_us: int) -> None:
        """Apply latched RPDOs, then send the TPDOs whose turn it is."""
        if self.nmt_state is not NmtState.OPERATIONAL:
            return
        self._now_us = now_us
        for receive_pdo in self.process_data.receive_pdos:
            receive_pdo.on_sync()
        for transmit_pdo in self.process_data.transmit_pdos:
            frame = transmit_pdo.on_sync() if transmit_pdo.exists else None
            if frame:
                self.outbox.append(frame)
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
        self._report(code, 0)
        moving = self._motion.running(self.axis) or self._motion.velocity(self.axis) != 0
        if code is ErrorCode.PVT_UNDERRUN:
            self.interpolation.underrun()
        if moving:
            self._ramp_down(stop_ms)
        self._enter(State.FAULT_REACTION_ACTIVE if self._motion.running(self.axis) else State.FAULT)
        self._settle()

    def report_communication_error(self, code: ErrorCode, now_us: int) -> None:
        """Tell by EMCY what happened to the bus; the drive goes on."""
        self._now_us = now_us
        self._report(code, 0)
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
            self._emergency.clear()
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
        if self.interpolation.running:
            self.interpolation.stopped()

    def _enter(self, state: State) -> None:
        self.state = state
        self.energised = state in ENERGISED
        self._after_stop = None
        if state is not State.OPERATION_ENABLED and self.interpolation.running:
            self.interpolation.stopped()

    def _write_mode(self, mode: int) -> None:
        if mode not in self._modes:
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        if mode != self._mode_number and self._motion.running(self.axis):
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        if mode != self._mode_number:
            self._mode_number = mode
            self._changed(0x6061)

    def statusword(self) -> int:
        """Object 0x6041, composed of the state's, the drive's and the mode's bits."""
        word = self.state.bits | Status.VOLTAGE_ENABLED
        if self.nmt_state is NmtState.OPERATIONAL:
            word |= Status.REMOTE
        if not self._motion.running(self.axis):
            word |= Status.TARGET_REACHED
        if self.state is State.OPERATION_ENABLED:
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
        write[key_of(0x1015)] = self._write_emergency_inhibit
        write[key_of(0x1017)] = lambda period_ms: self._heartbeat.set_period(period_ms * 1000, self._now_us)
        write[key_of(0x6040)] = self._write_controlword
        write[key_of(0x6060)] = self._write_mode
        write[key_of(0x60FE, 1)] = lambda physical: self._switch_outputs(physical, self.dictionary.get(0x60FE, 2))
        write[key_of(0x60FE, 2)] = lambda mask: self._switch_outputs(self.dictionary.get(0x60FE, 1), mask)
        for key in _STEP_CONFIG_KEYS:
            write[key] = partial(self._write_step_config, key)

    def _history(self, position: int) -> int:
        history = self._emergency.history
        return history[position - 1] if position <= len(history) else 0

    def _write_emergency_inhibit(self, inhibit: int) -> None:
        self._emergency.inhibit = inhibit

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

    def _settle(self) -> None:
        """After anything that happened: note changed values, then find out when to send."""
        if self.process_data.refresh(self._now_us):
            self.routes_changed = True
        self.interpolation.ready = self.state is State.OPERATION_ENABLED and self._mode is self.interpolation
        statusword = self.statusword()
        if statusword != self._statusword:
            self._statusword = statusword
            self.process_data.changed(0x6041)
        self._schedule()
        self._touched = False

    def _schedule(self) -> None:
        dues = [self._heartbeat.due_us]
        if self.nmt_state is not NmtState.STOPPED:
            dues.append(self._emergency.due_us)
        if self.nmt_state is NmtState.OPERATIONAL:
            dues += [pdo.due_us for pdo in self.process_data.transmit_pdos if pdo.exists]
        self.due_us = min((due for due in dues if due is not None), default=None)

    def poll(self, now_us: int) -> None:
        """Send what is due: heartbeat, emergencies, event-driven TPDOs."""
        self._now_us = now_us
        if self._heartbeat.poll(now_us):
            self.outbox.append(Frame(COB_HEARTBEAT + self.node_id, bytes((self.nmt_state,))))
        if self.nmt_state is not NmtState.STOPPED:
            payload = self._emergency.poll(now_us)
            if payload:
                self.outbox.append(Frame(COB_EMCY + self.node_id, payload))
        if self.nmt_state is NmtState.OPERATIONAL:
            for pdo in self.process_data.transmit_pdos:
                frame = pdo.poll(now_us) if pdo.exists else None
                if frame:
                    self.outbox.append(frame)
        self._schedule()


def _saturated(units: int) -> int:
    """A position as i32: within a segment, and by the rounding to a step, an axis may be a little beyond its ends."""
    return min(max(units, DataType.INTEGER32.low), DataType.INTEGER32.high)
