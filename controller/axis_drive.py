"""One axis' drive: power state, modes of operation, stops and faults, as CiA 402 joins them."""

from collections.abc import Iterator
from typing import Protocol

from steptwin.controller.cyclic_position import CyclicPosition
from steptwin.controller.drive import ENERGISED, next_state
from steptwin.controller.driver_settings import DriverSettings
from steptwin.controller.homing import Homing
from steptwin.controller.interpolation import Interpolation
from steptwin.controller.measurements import Measurements, Monitor
from steptwin.controller.modes import Mode, Trip
from steptwin.controller.motion import STOP_MAX_MS, Motion
from steptwin.controller.pins import Pin
from steptwin.controller.profile_feed import ProfileFeed
from steptwin.controller.profile_position import ProfilePosition
from steptwin.controller.profile_velocity import ProfileVelocity
from steptwin.controller.stops import DISABLES, HALTS, OPTIONS, QUICK_STOPS, SHUTDOWNS, Ramp, fault_ramp
from steptwin.controller.supervision import Supervision
from steptwin.controller.sync_clock import SyncClock
from steptwin.protocol import cia402, od
from steptwin.protocol.abort import AbortCode, SdoAbortError
from steptwin.protocol.cia402 import AbortConnection, Control, DigitalInput, ErrorCode, State, Status
from steptwin.protocol.dictionary import ObjectDictionary, WriteHook
from steptwin.protocol.homing_methods import HOMING_METHODS
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS

_ABORT_CONTROLWORDS = {
    AbortConnection.DISABLE_VOLTAGE: cia402.DISABLE_VOLTAGE,
    AbortConnection.QUICK_STOP: cia402.QUICK_STOP,
}
"""What the drive obeys in place of its lost host."""


_FOLLOWING_MODES = (cia402.Mode.PROFILE_POSITION, cia402.Mode.CYCLIC_SYNCHRONOUS_POSITION)
"""The modes in which bit 13 of the statusword is a following error."""


class Node(Protocol):
    """What a drive asks of the node that it belongs to."""

    @property
    def now_us(self) -> int:
        """The time of the call that is being served."""
        ...

    def report(self, code: ErrorCode, detail: int) -> None:
        """Send an EMCY unless the error is active already."""
        ...

    def resolved(self, code: ErrorCode) -> None:
        """An error is no more."""
        ...

    def faults_acknowledged(self) -> None:
        """The host has reset the fault: what has no cause any more is over."""
        ...

    def is_reported(self, code: ErrorCode) -> bool:
        """Whether an error is active, whatever its detail."""
        ...

    def changed(self, address: int) -> None:
        """A value has changed that process data may report."""
        ...

    def set_pin(self, pin: Pin, level: int) -> None:
        """Let a pin take a level."""
        ...

    def touch(self) -> None:
        """Something has happened after which the drive may have something to say."""
        ...


class AxisDrive:
    """Obeys controlwords, stops for faults and says what it is doing by the statusword."""

    def __init__(
        self,
        axis: int,
        motion: Motion,
        dictionary: ObjectDictionary,
        node: Node,
        measurements: Measurements,
        monitor: Monitor,
        sync_clock: SyncClock,
        trip: Trip,
    ) -> None:
        self.axis = axis
        self.state = State.NOT_READY_TO_SWITCH_ON
        self.energised = False
        """Whether the driver's outputs are to be on."""
        self.position_known = False
        """Whether the axis was told where it is and has not been cut off in motion since."""
        self._motion = motion
        self._dictionary = dictionary
        self._node = node
        self._controlword = 0
        self._after_stop: State | None = None
        self.settings = DriverSettings(dictionary, node.set_pin)
        self.supervision = Supervision(axis, motion, dictionary, measurements, monitor, trip)
        self.interpolation = Interpolation(
            axis,
            motion,
            dictionary,
            report=node.report,
            resolved=node.resolved,
            status_changed=lambda: node.changed(od.PVT_FLAGS),
            ramp_down=lambda: self._ramp_down(DISABLES[1]),
        )
        self.feed = ProfileFeed(
            axis,
            motion,
            dictionary,
            now_us=lambda: node.now_us,
            close_records=self.interpolation.close,
            refused=lambda: trip(axis, ErrorCode.SEGMENT_REFUSED),
        )
        self._profile_velocity = ProfileVelocity(axis, motion, dictionary, self.feed)
        self._homing = Homing(
            axis,
            motion,
            dictionary,
            self.feed,
            now_us=lambda: node.now_us,
            inputs=lambda: self.supervision.inputs,
            discard_records=self.interpolation.discard,
            referenced=self._referenced,
            report=node.report,
            resolved=node.resolved,
        )
        self._modes: dict[int, Mode] = {
            cia402.Mode.NONE: Mode(axis, motion),
            cia402.Mode.PROFILE_POSITION: ProfilePosition(
                axis, motion, dictionary, self.feed, now_us=lambda: node.now_us
            ),
            cia402.Mode.PROFILE_VELOCITY: self._profile_velocity,
            cia402.Mode.HOMING: self._homing,
            cia402.Mode.INTERPOLATED_POSITION: self.interpolation,
            cia402.Mode.CYCLIC_SYNCHRONOUS_POSITION: CyclicPosition(
                axis,
                motion,
                dictionary,
                sync_clock,
                now_us=lambda: node.now_us,
                close_records=self.interpolation.close,
                ramp_down=lambda: self._ramp_down(HALTS[dictionary.get(od.HALT_OPTION)]),
                trip=trip,
            ),
        }
        self.mode_number = int(cia402.Mode.NONE)
        self._install_hooks()

    def _install_hooks(self) -> None:
        write = self._dictionary.write_hooks
        write[od.CONTROLWORD] = self._write_controlword
        write[od.MODE_OF_OPERATION] = self._write_mode
        write[od.TARGET_VELOCITY] = self._write_target_velocity
        for address, values in OPTIONS.items():
            write[address] = _one_of(values)
        write[od.HOMING_METHOD] = _one_of(frozenset(HOMING_METHODS))

    def reset(self) -> None:
        """Lose what a power cycle would lose, pulses at once. A standing axis is where it was."""
        self._cut()
        self._controlword = 0
        self.mode.interrupted()
        self.mode_number = int(cia402.Mode.NONE)
        self.interpolation.restart()
        self._enter(State.SWITCH_ON_DISABLED)

    @property
    def mode(self) -> Mode:
        """The mode of operation."""
        return self._modes[self.mode_number]

    # --- commands

    def _write_controlword(self, controlword: int) -> None:
        """Obey a controlword. While a ramp leads out of OPERATION ENABLED the last command says what comes after it.

        "Enable operation" then keeps the drive enabled, as transition 4 would after the ramp; the ramp goes on to rest.
        """
        self._node.touch()
        previous, self._controlword = self._controlword, controlword
        self._obey(next_state(self.state, controlword, previous))
        if self.state is State.OPERATION_ENABLED and self._after_stop is None:
            self.mode.control(controlword, previous)

    def _obey(self, target: State) -> None:
        """Change state by command: a moving axis stops first, in the way that the option codes ask for."""
        if target is (self._after_stop or self.state):
            return
        if self.state is State.FAULT:
            if any(self.supervision.causes()):
                return
            self._set_error(ErrorCode.NONE)
            self._node.faults_acknowledged()
        ramp, end = self._way_to(target)
        if self._motion.running(self.axis) and target is not State.OPERATION_ENABLED:
            self._stop(ramp)
        if not self._motion.running(self.axis):
            self._enter(end)
        elif end in (State.READY_TO_SWITCH_ON, State.SWITCHED_ON):
            self._after_stop = end
        else:
            self._enter(target)

    def _way_to(self, target: State) -> tuple[Ramp, State]:
        """How a moving axis stops on its way to a state, and the state in which that ends."""
        get = self._dictionary.get
        if target is State.QUICK_STOP_ACTIVE:
            return QUICK_STOPS[get(od.QUICK_STOP_OPTION)]
        if target is State.READY_TO_SWITCH_ON:
            return SHUTDOWNS[get(od.SHUTDOWN_OPTION)], target
        if target is State.SWITCHED_ON:
            return DISABLES[get(od.DISABLE_OPERATION_OPTION)], target
        return Ramp.CUT, target

    def _write_mode(self, mode: int) -> None:
        if mode not in self._modes:
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        if mode != self.mode_number and self._motion.running(self.axis):
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        if mode != self.mode_number:
            self.mode.interrupted()
            self.mode_number = mode
            self._node.changed(od.MODE_OF_OPERATION_DISPLAY)
            if self.state is State.OPERATION_ENABLED:  # without an edge: only levels count in a mode just entered
                self.mode.control(self._controlword, self._controlword)

    def _write_target_velocity(self, units_per_s: int) -> None:
        self._node.touch()
        self._profile_velocity.write_target(units_per_s)

    def abort_connection(self) -> None:
        """Do what a lost host would have done last, by 0x6007; a fault is the group's matter and tripped elsewhere."""
        controlword = _ABORT_CONTROLWORDS.get(AbortConnection(self._dictionary.get(od.ABORT_CONNECTION_OPTION)))
        if controlword is not None:
            self._obey(next_state(self.state, controlword, self._controlword))

    # --- stops

    def stop_ms(self, ramp: Ramp) -> int:
        """How long a ramp takes from the present velocity: at least 1 ms, at most what fits."""
        if ramp.value is None:
            return 1
        velocity = abs(self._motion.velocity(self.axis))
        deceleration = self._dictionary.get(ramp.value) * VELOCITY_PER_UNIT_PER_MS
        return min(max(1, -(-velocity * 1_000_000 // deceleration)), STOP_MAX_MS)

    def halt_deceleration(self) -> int:
        """The deceleration of a halt, in units per second squared, by 0x605D."""
        return self._dictionary.get(HALTS[self._dictionary.get(od.HALT_OPTION)].value)

    def _stop(self, ramp: Ramp) -> None:
        if ramp is Ramp.CUT:
            self._cut()
        else:
            self._ramp_down(ramp)

    def _ramp_down(self, ramp: Ramp, stop_ms: int | None = None) -> None:
        """Stop with constant deceleration; dead where there is no room for it."""
        velocity = self._motion.velocity(self.axis)
        self._motion.stop(self.axis, self.stop_ms(ramp) if stop_ms is None else stop_ms)
        if velocity and not self._motion.running(self.axis):
            self._lose_position()
        self.mode.interrupted()

    def _cut(self) -> None:
        """End all pulses now: a motor in motion goes on as far as it likes."""
        if self._motion.velocity(self.axis):
            self._lose_position()
        self._motion.flush(self.axis)

    def _lose_position(self) -> None:
        self.position_known = False
        self._homing.position_lost()

    def select_microsteps(self, microsteps: int) -> None:
        """Set the driver to another excitation mode; its reset moves the rotor to where that begins."""
        self.settings.set_microsteps(microsteps)
        self._lose_position()

    def _referenced(self) -> None:
        """The axis has been told where it is."""
        self.position_known = True
        self.supervision.referenced()

    def _enter(self, state: State) -> None:
        was_energised, self.state = self.energised, state
        self.energised = state in ENERGISED
        self._node.set_pin(Pin.ENABLE, int(self.energised))
        self._after_stop = None
        if state is not State.OPERATION_ENABLED:
            self.mode.interrupted()
        if self.energised and not was_energised:
            self.supervision.check()

    def finished(self) -> None:
        """The axis has come to rest at the end of its segments."""
        if self.state is State.FAULT_REACTION_ACTIVE:
            self._enter(State.FAULT)
        elif self.state is State.QUICK_STOP_ACTIVE:
            self._enter(QUICK_STOPS[self._dictionary.get(od.QUICK_STOP_OPTION)].end)
        elif self._after_stop:
            self._enter(self._after_stop)
        else:
            self.mode.finished()

    # --- faults

    def _fault_ramp(self, code: ErrorCode, detail: int) -> Ramp:
        return fault_ramp(code, detail, self._dictionary.get(od.FAULT_REACTION_OPTION))

    def fault_stop_ms(self, code: ErrorCode, detail: int) -> int:
        """How long the drive would take to stop for an error."""
        return self.stop_ms(self._fault_ramp(code, detail))

    def fault(self, code: ErrorCode, detail: int, stop_ms: int) -> None:
        """Enter the fault reaction: say why, stop within the time given, then switch off.

        A drive that is switched off stays as it is: a fault must not switch it on. One that reacts to a fault already
        goes on with that, unless this one leaves it no time.
        """
        if not self.energised:
            return
        ramp = self._fault_ramp(code, detail)
        reacting = self.state is State.FAULT_REACTION_ACTIVE
        if reacting and ramp is not Ramp.CUT:
            return
        self._set_error(code)
        if not self._node.is_reported(code):
            self._node.report(code, detail)
        if code is ErrorCode.PVT_UNDERRUN:
            self.interpolation.underrun()
        moving = self._motion.running(self.axis) or self._motion.velocity(self.axis) != 0
        if moving and ramp is not Ramp.CUT:
            self._ramp_down(ramp, stop_ms)
        elif moving:
            self._cut()
        self._enter(State.FAULT_REACTION_ACTIVE if self._motion.running(self.axis) else State.FAULT)

    def _set_error(self, code: ErrorCode) -> None:
        self._dictionary.set(od.ERROR_CODE, code)
        self._node.changed(od.ERROR_CODE)

    # --- inputs

    def set_inputs(self, inputs: DigitalInput) -> None:
        """The axis' inputs have these levels as of the tick that begins now."""
        if inputs == self.supervision.inputs:
            return
        self.supervision.inputs = inputs
        self._node.changed(od.DIGITAL_INPUTS)
        if self.energised:
            self.supervision.check()
            if not self.mode.seeks_switches:
                self.supervision.check_limits()
        if self.state is State.OPERATION_ENABLED and self._after_stop is None:
            self.mode.inputs_changed(inputs)

    # --- what the drive says

    def settle(self, now_us: int) -> None:
        """After anything that happened: let the group, the queue and the supervision know how the drive stands."""
        interpolating = self.mode is self.interpolation
        self.interpolation.ready = interpolating and self.state is State.OPERATION_ENABLED
        self._motion.group.hold(self.axis, hold=interpolating and bool(self._controlword & Control.HALT))
        self.settings.settle(now_us, moving=self._motion.running(self.axis))
        self.supervision.watch(now_us, switches=not self.mode.seeks_switches)

    def dues_us(self) -> Iterator[int | None]:
        """When the drive has something to do by itself."""
        yield self.feed.due_us
        yield self.supervision.due_us
        yield self.settings.due_us
        yield self.mode.due_us

    def poll(self, now_us: int) -> bool:
        """Do what is due; whether anything was."""
        if all(due_us is None or due_us > now_us for due_us in self.dues_us()):
            return False
        self.feed.poll(now_us)
        self.supervision.poll(now_us)
        self.settings.poll(now_us)
        self.mode.poll(now_us)
        return True

    def statusword(self) -> int:
        """Object 0x6041, composed of the state's, the drive's and the mode's bits."""
        word = self.state.bits | Status.VOLTAGE_ENABLED
        if self.position_known:
            word |= Status.POSITION_KNOWN
        if self.mode_number in _FOLLOWING_MODES and self.supervision.following_error:
            word |= Status.FOLLOWING_ERROR
        enabled = self.state is State.OPERATION_ENABLED
        if self.mode.target_reached() if enabled else not self._motion.running(self.axis):
            word |= Status.TARGET_REACHED
        if enabled:
            word |= self.mode.status_bits()
        return word


def _one_of(values: frozenset[int]) -> WriteHook:
    def check(value: int) -> None:
        if value not in values:
            raise SdoAbortError(AbortCode.VALUE_RANGE)

    return check
