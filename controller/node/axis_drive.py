"""The drive of one axis (CiA 402): power state machine, modes of operation, stops and faults."""

from functools import partial
from typing import Final

from steptwin.controller.modes.cyclic_position import CyclicPosition
from steptwin.controller.modes.drive_mode import DriveMode
from steptwin.controller.modes.homing import Homing
from steptwin.controller.modes.interpolation import Interpolation
from steptwin.controller.modes.profile_feed import ProfileFeed
from steptwin.controller.modes.profile_position import ProfilePosition
from steptwin.controller.modes.profile_velocity import ProfileVelocity
from steptwin.controller.node.axis_context import AxisContext
from steptwin.controller.node.driver_settings import DriverSettings
from steptwin.controller.node.pins import Pin
from steptwin.controller.node.power_states import ENERGISED, leads_further, next_state
from steptwin.controller.node.stops import DISABLES, QUICK_STOPS, SHUTDOWNS, AxisStop, StopKind, fault_stop
from steptwin.controller.node.supervision import Supervision
from steptwin.controller.node.touch_probe import TouchProbes
from steptwin.protocol import cia402, od
from steptwin.protocol.cia402 import (
    LINEAR_SUBMODE,
    AbortConnection,
    Control,
    DigitalInput,
    ErrorCode,
    Mode,
    State,
    Status,
)
from steptwin.protocol.entry import DataType
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

_ABORT_CONTROLWORDS = {
    AbortConnection.DISABLE_VOLTAGE: cia402.DISABLE_VOLTAGE,
    AbortConnection.QUICK_STOP: cia402.QUICK_STOP,
}
"""Controlword that a lost connection commands, by the abort connection option code (6007h)."""

BY_PROGRAM: Final = 1
"""Detail of an emergency stop commanded by a program; 0 is the e-stop input."""

_FOLLOWING_MODES: Final = (
    Mode.PROFILE_POSITION,
    Mode.CYCLIC_SYNCHRONOUS_POSITION,
    Mode.CYCLIC_SYNCHRONOUS_VELOCITY,
)
"""Modes in which bit 13 of the statusword is the following error."""


_ENABLING: Final = (State.READY_TO_SWITCH_ON, State.SWITCHED_ON, State.OPERATION_ENABLED)
"""States that no command reaches while safe torque off is requested."""
_KEEPS_UNITS: Final = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE)
"""States in which the user units cannot change, because targets may arrive. (CiA 402-2 does not regulate this.)"""


class AxisDrive:
    """Obeys controlwords, stops for faults and reports its state in the statusword.

    The state machine, the mode and the stop in progress depend on each other at every command, so one class controls
    them. The tables, the modes, the supervision and the stops are classes of their own.
    """

    def __init__(self, context: AxisContext) -> None:
        self.axis: int = context.axis
        self.state: State = State.NOT_READY_TO_SWITCH_ON
        self.energised: bool = False
        """True while the driver's outputs are on."""
        self._context = context
        self._motion = context.motion
        self._dictionary = context.dictionary
        self._controlword = 0
        self.emergency_stopped: bool = False
        """True from an emergency stop by a program (2015h) until the fault reset."""
        self._stop_command: State | None = None
        """Target state of the command that has started the stop in progress; None if no such stop is in progress."""
        self._after_stop: State = self.state
        """State after that stop, by the option code at its start."""
        self._settled_us = 0
        """Instant from which the energised driver accepts steps (2001h:06)."""
        self._enable_due_us: int | None = None
        """The same instant while "enable operation" waits for it; else None."""
        self.fault_number: int = 0
        """Number of the last fault or emergency stop; one that occurs in FAULT counts, too."""
        self._fault_us = 0
        self.supervision: Supervision = Supervision(context)
        self._probes = TouchProbes(context)
        self.stop: AxisStop = AxisStop(context)
        self.interpolation: Interpolation = Interpolation(context, self.stop)
        self.settings: DriverSettings = DriverSettings(context, self.interpolation)
        self.feed: ProfileFeed = ProfileFeed(context, self.interpolation)
        self._cyclic = cyclic = CyclicPosition(context, self.interpolation, self.stop)
        self._profile_velocity = ProfileVelocity(
            context, self.feed, partial(cyclic.note_set_point_at, od.TARGET_VELOCITY)
        )
        self._modes: dict[int, DriveMode] = {
            Mode.NONE: DriveMode(context),
            Mode.PROFILE_POSITION: ProfilePosition(context, self.feed),
            Mode.PROFILE_VELOCITY: self._profile_velocity,
            Mode.HOMING: Homing(context, self.feed, self.interpolation),
            Mode.INTERPOLATED_POSITION: self.interpolation,
            Mode.CYCLIC_SYNCHRONOUS_POSITION: cyclic,
            Mode.CYCLIC_SYNCHRONOUS_VELOCITY: cyclic,
        }
        self.mode_number: int = int(Mode.NONE)
        context.dictionary.bind(self)

    def reset(self) -> None:
        """Reset as by a power cycle and end all pulses. An axis at standstill keeps its position."""
        self.stop.cut()
        self._controlword = 0
        self.emergency_stopped = False
        self.mode.interrupted()
        self.mode_number = int(Mode.NONE)
        self.interpolation.restart()
        self._enter(State.SWITCH_ON_DISABLED)

    def apply_parameters(self) -> None:
        """Use the parameters that a reset has loaded."""
        self.settings.apply()
        self.mode_number = self._dictionary.get(od.MODE_OF_OPERATION)
        self._take_submode(self._dictionary.get(od.INTERPOLATION_SUBMODE))

    @property
    def mode(self) -> DriveMode:
        """The mode of operation."""
        return self._modes[self.mode_number]

    # --- commands

    def obey_controlword(self, controlword: int) -> None:
        """Obey a controlword; the mode's own bits act in OPERATION ENABLED only.

        A bit that rises together with the command that enables the drive starts nothing: the mode sees no edge.

        During a ramp out of OPERATION ENABLED, only commands that lead further away from this state act. A master that
        repeats "enable operation" every millisecond cannot cancel a stop.
        """
        self._context.touch()
        previous, self._controlword = self._controlword, controlword
        was_enabled = self._enabled
        self._obey(next_state(self.state, controlword, previous))
        if self._enabled:
            self.mode.control(controlword, previous if was_enabled else controlword)

    @property
    def _enabled(self) -> bool:
        """True in OPERATION ENABLED, except during a ramp out of it."""
        return self.state is State.OPERATION_ENABLED and self._stop_command is None

    def reset_numbered_fault(self, number: int) -> None:
        """Leave FAULT, if `number` is that of the last fault (transition 15); do nothing in other states.

        A fault reset by controlword resets every fault up to its arrival. If the network delays the frame, it would
        also release a later emergency stop. A reset with a number does not.
        """
        if number != self.fault_number:
            raise SdoAbortError(AbortCode.DEVICE_STATE)  # another fault has occurred since
        if self.state is State.FAULT:
            for controlword in (0, Control.FAULT_RESET):
                self._dictionary.set(od.CONTROLWORD, controlword)
                self.obey_controlword(controlword)

    def _obey(self, target: State) -> None:
        """Change the state by command. A moving axis stops first, as the option codes select."""
        if target is self.state:
            return
        if self._stop_command and not leads_further(target, self._stop_command):
            return
        if self.supervision.torque_off and target in _ENABLING:
            return
        if target is State.OPERATION_ENABLED and self._enable_due_us is not None:
            return  # which comes when the driver has settled
        if self.state is State.FAULT:
            if any(self.supervision.causes()):
                return  # a fault cannot be reset while its cause lasts
            self.emergency_stopped = False
            self._set_error(ErrorCode.NONE)
            self._context.errors.acknowledge_faults()
        kind, end = self._stop_towards(target)
        if self._motion.running and target is not State.OPERATION_ENABLED:
            self._ramp_down(kind)
        if not self._motion.running:
            self._enter(end)
            return
        if target is State.QUICK_STOP_ACTIVE:
            self._enter(target)  # the drive stays in OPERATION ENABLED in the other stops until the ramp has ended
        self._stop_command, self._after_stop = target, end

    def _stop_towards(self, target: State) -> tuple[StopKind, State]:
        """Return how a moving axis stops for a command to a target state, and the state after the stop."""
        get = self._dictionary.get
        if target is State.QUICK_STOP_ACTIVE:
            return QUICK_STOPS[get(od.QUICK_STOP_OPTION)]
        if target is State.READY_TO_SWITCH_ON:
            return SHUTDOWNS[get(od.SHUTDOWN_OPTION)], target
        if target is State.SWITCHED_ON:
            return DISABLES[get(od.DISABLE_OPERATION_OPTION)], target
        return StopKind.CUT, target

    def _ramp_down(self, kind: StopKind, stop_ms: int | None = None) -> None:
        if kind is StopKind.CUT:
            self.stop.cut()
        else:
            self.stop.ramp_down(kind, stop_ms)
            self.mode.interrupted()

    def select_mode(self, mode: int) -> None:
        """Change to another mode of operation, unless the axis moves."""
        if mode != self.mode_number and self._motion.running:
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        if mode != self.mode_number:
            self.mode.interrupted()
            self.mode_number = mode
            self._context.changed(od.MODE_OF_OPERATION_DISPLAY)
            if self.state is State.OPERATION_ENABLED:
                # With the same word twice the new mode sees levels but no edge: no old bit starts a motion.
                self.mode.control(self._controlword, self._controlword)

    def select_submode(self, submode: int) -> None:
        """Change the interpolation sub mode (60C0h); refuse it while interpolation is enabled or the axis moves."""
        if submode == self._dictionary.get(od.INTERPOLATION_SUBMODE):
            return
        interpolates = self.mode_number == Mode.INTERPOLATED_POSITION and self.state is State.OPERATION_ENABLED
        if interpolates or self._motion.running:
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        self._take_submode(submode)

    def _take_submode(self, submode: int) -> None:
        self._modes[Mode.INTERPOLATED_POSITION] = self._cyclic if submode == LINEAR_SUBMODE else self.interpolation

    def change_units_at(self, address: int, value: int) -> None:
        """Change a factor of the user units (6091h, 6092h) or their SI unit (60A8h); refuse if motion is possible.

        The SI unit (60A8h) changes no value: it documents the factors.
        """
        if self.state in _KEEPS_UNITS:
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        if address != od.SI_UNIT_POSITION:
            self._dictionary.change_factor(address, value)

    def abort_connection(self) -> None:
        """Obey the controlword that the abort connection option code (6007h) gives for a lost connection.

        The option "fault signal" gives none: there the node requests the fault reaction, because it concerns the group.
        """
        controlword = _ABORT_CONTROLWORDS.get(AbortConnection(self._dictionary.get(od.ABORT_CONNECTION_OPTION)))
        if controlword is not None:
            self._obey(next_state(self.state, controlword, self._controlword))

    # --- states

    def _enter(self, state: State) -> None:
        """Enter a state. For OPERATION ENABLED, wait in SWITCHED ON until the driver accepts steps."""
        now_us, self._enable_due_us = self._context.now_us, None
        if state in ENERGISED and not self.energised:
            self._settled_us = now_us + self._dictionary.get(od.SETTLING_US)
        if state is State.OPERATION_ENABLED and now_us < self._settled_us:
            state, self._enable_due_us = State.SWITCHED_ON, self._settled_us
        was_energised, self.state = self.energised, state
        self.energised = state in ENERGISED
        self._context.pins.set(Pin.ENABLE, int(self.energised))
        self._stop_command = None
        self._profile_velocity.void_target()  # only a target given in OPERATION ENABLED moves an axis
        self._cyclic.end_image()
        if state is not State.OPERATION_ENABLED:
            self.mode.interrupted()
        if self.energised and not was_energised:
            self.supervision.check()

    def _settle_driver(self, now_us: int) -> None:
        """Obey a waiting "enable operation" when the driver accepts steps, unless another command has come."""
        if self._enable_due_us is None or now_us < self._enable_due_us:
            return
        self._enable_due_us = None
        self._obey(next_state(self.state, self._controlword, self._controlword))
        if self._enabled:
            self.mode.control(self._controlword, self._controlword)

    def finished(self) -> None:
        """Handle the end of all segments: the axis is at standstill."""
        if self.state is State.FAULT_REACTION_ACTIVE:
            self._enter(State.FAULT)
        elif self._stop_command:
            self._enter(self._after_stop)
        else:
            self.mode.finished()

    # --- faults

    def _count_fault(self) -> None:
        self.fault_number = self.fault_number % DataType.UNSIGNED32.high + 1
        self._fault_us = self._context.now_us

    def fault_age_ms(self) -> int:
        """Return the age of the last fault, rounded down; the highest value if there is none."""
        return (self._context.now_us - self._fault_us) // 1000 if self.fault_number else DataType.UNSIGNED32.high

    def _fault_stop(self, code: ErrorCode, detail: int) -> StopKind:
        return fault_stop(code, detail, self._dictionary.get(od.FAULT_REACTION_OPTION))

    def fault_stop_ms(self, code: ErrorCode, detail: int) -> int:
        """Return the stopping time for an error."""
        return self.stop.duration_ms(self._fault_stop(code, detail))

    def fault(self, code: ErrorCode, detail: int, stop_ms: int) -> None:
        """Enter the fault reaction: report the error, stop within `stop_ms`, then switch off.

        A drive that is switched off stays off. A drive in a fault reaction continues it, unless the new error requires
        that the pulses end at once.
        """
        if not self.energised:
            return
        self._count_fault()
        kind = self._fault_stop(code, detail)
        reacting = self.state is State.FAULT_REACTION_ACTIVE
        if reacting and kind is not StopKind.CUT:
            return
        self._report(code, detail)
        if code is ErrorCode.PVT_UNDERRUN:
            self.interpolation.underrun()
        if self._motion.running or self._motion.velocity != 0:
            self._ramp_down(kind, stop_ms)
        self._enter(State.FAULT_REACTION_ACTIVE if self._motion.running else State.FAULT)

    def stop_at_once(self, value: int) -> None:
        """Stop like the e-stop input (2015h). Even a drive that was off then needs a fault reset."""
        if not value:
            raise SdoAbortError(AbortCode.VALUE_TOO_LOW)
        self._context.touch()
        self._count_fault()
        self.emergency_stopped = True
        if self.energised:
            self._context.trip(ErrorCode.ESTOP, BY_PROGRAM)
        elif self.state is not State.FAULT:
            self._report(ErrorCode.ESTOP, BY_PROGRAM)
            self._enter(State.FAULT)

    def _report(self, code: ErrorCode, detail: int) -> None:
        self._set_error(code)
        if not self._context.errors.is_active(code):
            self._context.errors.report(code, detail)

    def _set_error(self, code: ErrorCode) -> None:
        self._dictionary.set(od.ERROR_CODE, code)
        self._context.changed(od.ERROR_CODE)

    # --- inputs

    def set_inputs(self, inputs: DigitalInput) -> None:
        """Set the axis' input levels at the start of the present tick."""
        if inputs == self.supervision.inputs:
            return
        if inputs & ~self.supervision.inputs & DigitalInput.ESTOP:
            self._count_fault()
        self._probes.inputs_changed(self.supervision.inputs, inputs)
        self.supervision.inputs = inputs
        self._context.changed(od.DIGITAL_INPUTS)
        torque_off = DigitalInput.TORQUE_OFF in inputs
        if torque_off != self.supervision.torque_off:
            self.supervision.torque_off = torque_off
            self._change_torque_off()
        if self.energised:
            self.supervision.check()
            if not self.mode.seeks_switches:
                self.supervision.check_limits()
        if self._enabled and self.mode.switches_at == self.axis:
            self.mode.inputs_changed(inputs)

    def _change_torque_off(self) -> None:
        """React to a request of safe torque off (STO), or to its end: report it, and end pulses and ENABLE at once."""
        if not self.supervision.torque_off:
            self._context.errors.resolved(ErrorCode.TORQUE_OFF)
            return
        self._context.errors.report(ErrorCode.TORQUE_OFF, 0)
        if self._motion.running:
            self.stop.cut()
        if self.energised:
            self._enter(State.FAULT if self.state is State.FAULT_REACTION_ACTIVE else State.SWITCH_ON_DISABLED)
        elif self.state is State.READY_TO_SWITCH_ON:
            self._enter(State.SWITCH_ON_DISABLED)

    def watch_other_switches(self) -> None:
        """Let the mode check the switches that it monitors at another axis."""
        watched = self.mode.switches_at
        if self._enabled and watched != self.axis:
            self.mode.inputs_changed(self._context.board.inputs[watched])

    def measured(self) -> None:
        """Check new readings of the board's analogue inputs."""
        if self.energised:
            self.supervision.check()

    # --- after every call, and when time has passed

    def settle(self, now_us: int) -> None:
        """Update the group, the queue and the supervision with the drive's state, at the end of every call."""
        self._cyclic.end_image()
        self._motion.settle_speed_limit()
        interpolating = self.mode is self.interpolation
        self.interpolation.ready = interpolating and self.state is State.OPERATION_ENABLED
        self._context.board.motion.group.hold(self.axis, hold=interpolating and bool(self._controlword & Control.HALT))
        self.settings.settle(now_us, moving=self._motion.running)
        self.supervision.watch(now_us, switches=not self.mode.seeks_switches)

    def dues_us(self) -> tuple[int | None, ...]:
        """Return when each part of the drive must be polled next; None for a part without a due time."""
        parts = self.feed, self.supervision, self.settings, self.mode
        return self._enable_due_us, *(part.due_us for part in parts)

    def poll(self, now_us: int) -> bool:
        """Do the work that is due; return True if there was any."""
        if all(due_us is None or due_us > now_us for due_us in self.dues_us()):
            return False
        self._settle_driver(now_us)
        self.feed.poll(now_us)
        self.supervision.poll(now_us)
        self.settings.poll(now_us)
        self.mode.poll(now_us)
        return True

    def statusword(self) -> int:
        """Return the statusword (6041h): the bits of state, drive and mode."""
        word = self.state.bits
        if self.supervision.supplied and not self.supervision.torque_off:
            word |= Status.VOLTAGE_ENABLED
        if self._context.reference.known:
            word |= Status.POSITION_KNOWN
        if self.mode_number in _FOLLOWING_MODES and self.supervision.following_error:
            word |= Status.FOLLOWING_ERROR
        enabled = self.state is State.OPERATION_ENABLED
        if self.mode.target_reached() if enabled else not self._motion.running:
            word |= Status.TARGET_REACHED
        if enabled:
            word |= self.mode.status_bits()
        return word
