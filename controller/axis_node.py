"""One axis as a CANopen node: joins the protocol services, the drive's state machine, its modes and its motion."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

from steptwin.controller.axis_drive import AxisDrive
from steptwin.controller.measurements import Measurements, Monitor
from steptwin.controller.modes import Trip
from steptwin.controller.motion import INVERT_DIR, REVERSED, Motion, StepConfig
from steptwin.controller.pins import MODE_LEVELS, OUTPUT_PINS, Pin
from steptwin.controller.sync_clock import SyncClock
from steptwin.protocol import cia402, od
from steptwin.protocol.abort import AbortCode, SdoAbortError
from steptwin.protocol.cia402 import AbortConnection, ErrorCode, State, Status
from steptwin.protocol.cob_id import check_cob_id
from steptwin.protocol.datatypes import DataType
from steptwin.protocol.dictionary import FlashPage, ObjectDictionary
from steptwin.protocol.emergency import EmergencyProducer
from steptwin.protocol.frame import COB_HEARTBEAT, COB_ID_INVALID, COB_SDO_RESPONSE, Frame
from steptwin.protocol.heartbeat_consumer import HeartbeatConsumer
from steptwin.protocol.nmt import HeartbeatProducer, NmtCommand, NmtState, after_error, target_of
from steptwin.protocol.objects import HISTORY_DEPTH
from steptwin.protocol.pdo import ProcessData
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS
from steptwin.protocol.sdo_server import SdoServer
from steptwin.protocol.storage import ParameterStorage
from steptwin.protocol.sync import SyncConsumer

_FAULT_STATES = (State.FAULT_REACTION_ACTIVE, State.FAULT)
_PDO_LENGTH_ERRORS = (ErrorCode.PDO_TOO_SHORT, ErrorCode.PDO_TOO_LONG)

_STEP_CONFIG_KEYS = (
    od.MICROSTEPS,
    od.STEPLEN_NS,
    od.STEPSPACE_NS,
    od.DIRSETUP_NS,
    od.DIRHOLD_NS,
    od.MAX_PROFILE_VELOCITY,
    od.POLARITY,
    od.INVERT_MASK,
)
"""In the order of StepConfig's fields."""


_CHOICES = {
    od.MICROSTEPS: tuple(MODE_LEVELS),
    od.INVERT_MASK: (0, INVERT_DIR),
    od.POLARITY: (0, REVERSED),  # position and velocity can only be reversed together
}
"""The values that may be written where a range does not say it."""


class AxisNode:
    """The firmware of one axis. Every call that depends on time is told the time; frames leave by `outbox`."""

    def __init__(
        self,
        node_id: int,
        axis: int,
        motion: Motion,
        flash_page: FlashPage,
        measurements: Measurements,
        monitor: Monitor,
        sync_clock: SyncClock,
        trip: Trip,
    ) -> None:
        self.node_id = node_id
        self.axis = axis
        self.nmt_state = NmtState.INITIALISING
        self.now_us = 0
        """The time of the call that is being served."""
        self.outbox: list[Frame] = []
        self.pin_changes: list[tuple[Pin, int]] = []
        """Pins and the levels that they take now, to be fetched like the frames."""
        self._pins = dict.fromkeys(Pin, 0)
        self.due_us: int | None = None
        """When `poll` wants to be called next."""
        self.dictionary = ObjectDictionary(node_id, stored=flash_page)
        self.process_data = ProcessData(self.dictionary)
        self._motion = motion
        self._measurements = measurements
        self._monitor = monitor
        self._trip = trip
        self._clock_zero_us = 0
        """When the time stamp 0x1013 was 0."""
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
        self.drive = AxisDrive(axis, motion, self.dictionary, self, measurements, monitor, sync_clock, trip)
        self._install_hooks()
        ParameterStorage(self.dictionary, flash_page, busy=self._board_moves)

    # --- power-up and network management

    def boot(self, now_us: int) -> None:
        """Power-up: announce the node, then wait in PRE-OPERATIONAL and SWITCH ON DISABLED."""
        self.now_us = now_us
        self._reset_application()
        self.set_pin(Pin.RESET, 1)
        self._reset_communication()
        self._settle()

    def on_nmt(self, command: NmtCommand, now_us: int) -> None:
        """Obey a network management command that is meant for this node."""
        self.now_us = now_us
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
        """Lose everything that a power cycle would lose but the position of a standing axis."""
        self.drive.reset()
        self.dictionary.reset(0x2000)
        self._configure(self._step_config())
        self._emergency.forget()
        self._switch_outputs(0)

    def _reset_communication(self) -> None:
        self.dictionary.reset(0x1000, 0x1FFF)
        self._sdo.reset()
        self._heartbeat.set_period(self.dictionary.get(od.PRODUCER_HEARTBEAT_TIME) * 1000, self.now_us)
        self._emergency.inhibit = self.dictionary.get(od.EMCY_INHIBIT_TIME)
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
        self.now_us = now_us
        for response in self._sdo.handle(data):
            self.outbox.append(Frame(COB_SDO_RESPONSE + self.node_id, response))
        self._settle()

    def on_rpdo(self, number: int, data: bytes, now_us: int) -> None:
        """Take process data, in OPERATIONAL only."""
        if self.nmt_state is not NmtState.OPERATIONAL:
            return
        self.now_us = now_us
        error = self.process_data.receive_pdos[number].receive(data)
        if error:
            self.report(error, number + 1)
        elif self._emergency.register:
            self._resolve(lambda code, detail: code in _PDO_LENGTH_ERRORS and detail == number + 1)
        if self._touched:  # most frames are PVT records, which change nothing that is sent at once
            self._settle()

    def on_sync(self, data: bytes, now_us: int) -> None:
        """Apply latched RPDOs, then send the TPDOs whose turn it is."""
        if self.nmt_state is not NmtState.OPERATIONAL:
            return
        self.now_us = now_us
        counter = self._sync.counter_of(data)
        if counter is None:
            self.report(ErrorCode.SYNC_LENGTH, len(data))
            self._settle()
            return
        if self._emergency.register:
            self._resolve(lambda code, _: code is ErrorCode.SYNC_LENGTH)
        for receive_pdo in self.process_data.receive_pdos:
            receive_pdo.on_sync()
        self.drive.mode.on_sync()
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
        self.now_us = now_us
        if self._heartbeat_consumer.receive(producer_id, data, now_us) and self.drive.state not in _FAULT_STATES:
            self._resolve(self._is_over)
            self._settle()
            return
        deadline_us = self._heartbeat_consumer.due_us
        # Most deadlines only move away: that is noticed when the one before would have been due.
        if deadline_us is not None and (self.due_us is None or deadline_us < self.due_us):
            self._schedule()

    # --- a lost host

    def _watch_connection(self) -> None:
        """Report the producers that have fallen silent."""
        for producer_id in self._heartbeat_consumer.poll(self.now_us):
            self.report(ErrorCode.HEARTBEAT_LOST, producer_id)
            self.connection_lost = True

    def abort_connection(self, now_us: int) -> None:
        """Do what the host would have done last, by 0x6007, and leave OPERATIONAL, by 0x1029."""
        self.now_us = now_us
        self.connection_lost = False
        if self.dictionary.get(od.ABORT_CONNECTION_OPTION) == AbortConnection.FAULT_SIGNAL:
            self._trip(self.axis, ErrorCode.HEARTBEAT_LOST)
        else:
            self.drive.abort_connection()
        self._change_nmt_state(after_error(self.nmt_state, self.dictionary.get(od.COMMUNICATION_ERROR_BEHAVIOUR)))
        self._settle()

    def on_can_error(self, code: ErrorCode, now_us: int, *, active: bool) -> None:
        """Tell by EMCY what befalls the board's CAN controller; the drive goes on."""
        self.now_us = now_us
        if active:
            self.report(code, 0)
        else:
            self.resolved(code)
        self._settle()

    # --- the drive

    @contextmanager
    def acting(self, now_us: int) -> Iterator[AxisDrive]:
        """Let the drive do something of the board's own accord, then see what there is to say."""
        self.now_us = now_us
        yield self.drive
        self._settle()

    def review(self, now_us: int) -> None:
        """Something beyond this node has changed, its group's time perhaps: see what there is to say."""
        self.now_us = now_us
        self._settle()

    def statusword(self) -> int:
        """Object 0x6041: the drive's word, and whether the node listens to controlwords by PDO."""
        return self.drive.statusword() | (Status.REMOTE if self.nmt_state is NmtState.OPERATIONAL else 0)

    # --- what the dictionary reads and writes elsewhere

    def _install_hooks(self) -> None:
        read, write = self.dictionary.read_hooks, self.dictionary.write_hooks
        read[od.ERROR_REGISTER] = lambda: self._emergency.register
        read[od.ERROR_HISTORY_COUNT] = lambda: len(self._emergency.history)
        for i in range(1, HISTORY_DEPTH + 1):
            read[od.ERROR_HISTORY[i - 1]] = partial(self._history, i)
        read[od.TIME_STAMP] = lambda: self.now_us - self._clock_zero_us & 0xFFFF_FFFF
        read[od.BOARD_CLOCK_US] = lambda: self.now_us & 0xFFFF_FFFF
        read[od.STATUSWORD] = self.statusword
        read[od.BOARD_TEMPERATURE] = lambda: self._measurements.temperature_decidegc
        read[od.SUPPLY_VOLTAGE] = lambda: self._measurements.supply_10mv
        read[od.ROTOR_POSITION_STEPS] = lambda: self._monitor(self.axis).rotor_steps
        read[od.LOST_STEPS] = lambda: self._monitor(self.axis).lost_steps
        read[od.DRIVER_VIOLATIONS] = lambda: self._monitor(self.axis).violations
        read[od.MODE_OF_OPERATION_DISPLAY] = lambda: self.drive.mode_number
        read[od.POSITION_DEMAND] = lambda: _saturated(self._motion.demand_units(self.axis))
        read[od.POSITION_ACTUAL] = lambda: _saturated(self._motion.counter_units(self.axis))
        read[od.VELOCITY_ACTUAL] = self._velocity_units_per_s
        read[od.FOLLOWING_ERROR_ACTUAL] = lambda: _saturated(self.drive.supervision.following_error_units)
        read[od.POSITION_DEMAND_STEPS] = lambda: self._motion.demand_steps(self.axis)
        read[od.DIGITAL_INPUTS] = lambda: self.drive.supervision.inputs
        write[od.ERROR_HISTORY_COUNT] = lambda _: self._emergency.history.clear()
        write[od.TIME_STAMP] = self._set_clock
        write[od.EMCY_COB_ID] = lambda cob_id: check_cob_id(self.dictionary.get(od.EMCY_COB_ID), cob_id)
        write[od.EMCY_INHIBIT_TIME] = self._write_emergency_inhibit
        write[od.PRODUCER_HEARTBEAT_TIME] = lambda period_ms: self._heartbeat.set_period(period_ms * 1000, self.now_us)
        write[od.MOTION_PROFILE_TYPE] = self._write_profile_type
        write[od.DIGITAL_OUTPUTS] = lambda physical: self._switch_outputs(
            physical & self.dictionary.get(od.DIGITAL_OUTPUTS_MASK)
        )
        write[od.DIGITAL_OUTPUTS_MASK] = lambda mask: self._switch_outputs(
            self.dictionary.get(od.DIGITAL_OUTPUTS) & mask
        )
        for key in _STEP_CONFIG_KEYS:
            write[key] = partial(self._write_step_config, key)

    def _set_clock(self, time_us: int) -> None:
        self._clock_zero_us = self.now_us - time_us

    def _history(self, position: int) -> int:
        history = self._emergency.history
        return history[position - 1] if position <= len(history) else 0

    def _write_profile_type(self, profile_type: int) -> None:
        if profile_type not in (cia402.LINEAR_RAMP, cia402.JERK_LIMITED_RAMP):
            raise SdoAbortError(AbortCode.VALUE_RANGE)

    def _write_emergency_inhibit(self, inhibit: int) -> None:
        self._emergency.inhibit = inhibit

    def _board_moves(self) -> bool:
        """An STM32F103 halts while it writes its flash: no axis may want steps then."""
        return any(self._motion.running(axis) for axis in range(self._motion.axis_count))

    def _switch_outputs(self, outputs: int) -> None:
        """In any drive state, and no state or fault switches them back: a gripper must not drop its load."""
        for pin, bit in OUTPUT_PINS.items():
            self.set_pin(pin, int(bool(outputs & bit)))

    def _velocity_units_per_s(self) -> int:
        return self._motion.velocity(self.axis) * 1000 // VELOCITY_PER_UNIT_PER_MS

    def _write_step_config(self, key: int, value: int) -> None:
        """Steps may be reconfigured while the driver is off: a TB6560 changes its mode only in reset (page 15).

        Records that wait are dropped: the old limit has let them in, the room for their edges follows from the new one.
        """
        if self.drive.energised:
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        if value not in _CHOICES.get(key, (value,)):
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        self.drive.interpolation.discard()
        self._configure(self._step_config({key: value}))

    def _configure(self, config: StepConfig) -> None:
        if config.microsteps != self._motion.config(self.axis).microsteps:
            self.drive.select_microsteps(config.microsteps)
        self._motion.configure(self.axis, config)

    def _step_config(self, changes: dict[int, int] | None = None) -> StepConfig:
        changes = changes or {}
        return StepConfig(*(changes.get(key, self.dictionary.get(key)) for key in _STEP_CONFIG_KEYS))

    # --- what the drive asks of its node

    def set_pin(self, pin: Pin, level: int) -> None:
        """Let a pin take a level."""
        if self._pins[pin] != level:
            self._pins[pin] = level
            self.pin_changes.append((pin, level))

    def touch(self) -> None:
        """Something has happened after which there may be something to say."""
        self._touched = True

    def changed(self, address: int) -> None:
        """A value has changed that event-driven TPDOs report."""
        self._touched = True
        self.process_data.changed(address)

    def report(self, code: ErrorCode, detail: int) -> None:
        """Send an EMCY unless the error is active already."""
        self._touched = True
        self._emergency.raise_error(code, detail)

    def is_reported(self, code: ErrorCode) -> bool:
        """Whether an error is active, whatever its detail."""
        return self._emergency.is_active(code)

    def resolved(self, code: ErrorCode) -> None:
        """An error is no more."""
        self._resolve(lambda active, _: active is code)

    def faults_acknowledged(self) -> None:
        """The host has reset the fault: what has no cause any more is over."""
        self._resolve(self._is_over)

    def _resolve(self, gone: Callable[[ErrorCode, int], bool]) -> None:
        self._touched = True
        self._emergency.resolve(gone)

    def _is_over(self, code: ErrorCode, detail: int) -> bool:
        """Whether an active error has no cause any more once the drive is out of its fault."""
        if code is ErrorCode.HEARTBEAT_LOST:
            return detail not in self._heartbeat_consumer.lost
        return not code.communication

    # --- frames out

    def _settle(self) -> None:
        """After anything that happened: note changed values, then find out when to send."""
        if self.process_data.refresh(self.now_us) or self._heartbeat_consumer.changed:
            self._heartbeat_consumer.changed = False
            self.routes_changed = True
        self.drive.settle(self.now_us)
        statusword = self.statusword()
        if statusword != self._statusword:
            self._statusword = statusword
            self.process_data.changed(od.STATUSWORD)
        self._schedule()
        self._touched = False

    def _schedule(self) -> None:
        dues = [self._heartbeat.due_us, self._heartbeat_consumer.due_us, *self.drive.dues_us()]
        if self.nmt_state is not NmtState.STOPPED:
            dues.append(self._emergency.due_us)
        if self.nmt_state is NmtState.OPERATIONAL:
            dues += [pdo.due_us for pdo in self.process_data.transmit_pdos if pdo.exists]
        known = [due for due in dues if due is not None]
        self.due_us = min(known) if known else None

    def poll(self, now_us: int) -> None:
        """Do what is due: let the drive act, send heartbeat, emergencies, event-driven TPDOs."""
        self.now_us = now_us
        if self.drive.poll(now_us):
            self._settle()
        self._watch_connection()
        if self._heartbeat.poll(now_us):
            self.outbox.append(Frame(COB_HEARTBEAT + self.node_id, bytes((self.nmt_state,))))
        if self.nmt_state is not NmtState.STOPPED:
            payload = self._emergency.poll(now_us)
            cob_id = self.dictionary.get(od.EMCY_COB_ID)
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
