"""The emulated board: the firmware, its drivers, its CAN controller and its inputs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from steptwin.controller.motion.axis_motion import PinEdges
from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.group_time import RateRamp
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.controller.node.axis_context import BoardReadings
from steptwin.controller.node.firmware import Firmware
from steptwin.controller.node.pins import OUTPUT_PINS, Pin, PinChange
from steptwin.emulator.board.board_firmware import BoardFirmware, BoardProgram, BoardPulses, OtherFirmwareError
from steptwin.emulator.board.environment import AxisEnvironment, BoardEnvironment
from steptwin.emulator.board.inputs import BoardInputs
from steptwin.emulator.board.local_clock import CRYSTAL_PPM_MAX, LocalClock
from steptwin.emulator.board.own_program import OwnProgram
from steptwin.emulator.bus.can_controller import CanController
from steptwin.emulator.drivers.axis_wires import Condition, Wire
from steptwin.emulator.drivers.driver_bank import SUPPLIES, AxisTrace, DriverBank, DriverMonitor
from steptwin.emulator.drivers.driver_module import Module
from steptwin.emulator.drivers.output_follower import OutputFollower
from steptwin.emulator.operations import BoardOperation
from steptwin.emulator.world.switches import Switch, Travel
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.dictionary import FlashPage
from steptwin.protocol.frame import FIRST_NODE_ID
from steptwin.protocol.object_view import ObjectView
from steptwin.protocol.od import UNITS_PER_FULL_STEP


@dataclass(frozen=True, slots=True)
class BoardConfig:
    """Hardware of a board: drivers, node ids, switches.

    Positions are in substeps (`ChipSheet.substeps`). All drivers of a board have the same number of substeps per full
    step.
    """

    modules: tuple[Module, ...]
    """The driver of each axis: its chip, and the module around it."""
    first_node_id: int = FIRST_NODE_ID
    """Node id of the first axis; the next axes have the next ids."""
    read_latency_counts: int = 0
    """Time from the arrival of a frame until the processor reads it from the CAN controller."""
    switches: tuple[Switch, ...] = ()
    start_substeps: tuple[int, ...] = ()
    """Initial position of each axis' rotor, in substeps from its zero; empty for all 0."""
    travels: tuple[Travel, ...] = ()
    """Travel along which each axis' switches are placed; empty if it is the travel of the axis' own rotor."""
    view: ObjectView | None = None
    """Objects that the bus sees in place of those of StepTwin's firmware."""
    crystal_ppm: int = 0
    """Error of the board's crystal in ppm, positive if it is fast; `drifting_board.make_board` uses it."""

    def __post_init__(self) -> None:
        if abs(self.crystal_ppm) > CRYSTAL_PPM_MAX:
            raise ValueError(f"crystal_ppm {self.crystal_ppm} is not from {-CRYSTAL_PPM_MAX} to {CRYSTAL_PPM_MAX}")
        if len({module.chip.substeps for module in self.modules}) != 1:
            raise ValueError("the drivers of a board must have the same number of substeps in a full step")

    @property
    def axis_count(self) -> int:
        """Number of axes."""
        return len(self.modules)

    @property
    def substeps(self) -> int:
        """Substeps per full step."""
        return self.modules[0].chip.substeps

    @property
    def period_min_counts(self) -> int:
        """Shortest time between two pulses that a driver counts."""
        return min(module.chip.period_min_counts for module in self.modules)


class Shaft(NamedTuple):
    """True position of one axis' rotor."""

    position_units: int
    """Position since power-up, in wire units."""
    slipped_full_steps: int
    """Signed full steps by which the rotor has slipped since power-up: four for each electrical turn."""


class Board:
    """One board on the bus.

    The firmware computes pulses ahead in batches; the drivers process them on demand. Most methods determine how far
    time may advance before the firmware must read its inputs again. Inputs, drivers and CAN controller are classes of
    their own.
    """

    def __init__(
        self,
        config: BoardConfig,
        kernel: Kernel,
        flash: list[FlashPage] | None = None,
        program: BoardProgram | None = None,
    ) -> None:
        """Create a board without power.

        Args:
            config: its hardware.
            kernel: motion kernel of StepTwin's firmware.
            flash: parameters stored before by StepTwin's firmware, one page for each axis; None for a new board.
            program: program of the processor; None for StepTwin's firmware.
        """
        self.config = config
        self._own: OwnProgram | None = None
        """StepTwin's firmware; None if the board runs another one."""
        if program is None:
            program = self._own = OwnProgram(kernel, config.axis_count, flash)
        self._program = program
        starts = config.start_substeps or (0,) * config.axis_count
        self.inputs: BoardInputs = BoardInputs(config.switches, starts, config.travels, config.period_min_counts)
        self.drivers: DriverBank = DriverBank(config.modules, self.inputs, at_edges=self._own is None)
        self.measurements: BoardReadings = BoardReadings()
        """Present values at the board's analogue inputs."""
        self._held_protects = [False] * config.axis_count
        """Per axis: the driver's Protect pin is held low externally."""
        self._shorted = [False] * config.axis_count
        """Per axis: the motor has a short circuit."""
        self._heat_due_tick: int | None = None
        """Tick at whose start the drivers' Protect pins must be read next; None while they stay high."""
        self.down: bool = False
        """True while the processor is without power or in reset."""
        self._hot = False
        """True while a driver reports that a protection keeps its outputs off."""
        self._watching_outputs = False
        """True if each change of a digital output must be processed at once."""
        self.output_change_count: int = 0
        """Number of digital output changes since the machine was switched on."""
        self.rotor_of: Callable[[int], Shaft] | None = None
        """Returns the shaft of an axis, if motors are simulated in the loop; else None."""
        self._power_up()
        self._heat_due_tick = self._next_heat_tick()

    def _power_up(self) -> None:
        """Create the firmware and the CAN controller of a new power-up."""
        self.running: BoardFirmware = self._program.start(self)
        """The firmware since power-up."""
        self.motion: BoardPulses = self.running.motion
        """The firmware's pulses."""
        self.can: CanController = self._make_controller()
        """The CAN controller; `poll` fills its mailboxes with the firmware's frames."""
        self.inputs.restart_count()
        self._seen = [DigitalInput(0)] * self.config.axis_count
        """Input levels that the firmware has read last."""
        self._look_at_once = self.inputs.levels != self._seen
        """True if the inputs must be read at the start of the next tick."""
        self._program.connect(self)

    @property
    def own(self) -> OwnProgram:
        """StepTwin's firmware, its flash, and the internal data that it reports.

        Raises:
            OtherFirmwareError: the board runs another firmware.
        """
        if self._own is None:
            raise OtherFirmwareError("the board does not run StepTwin's firmware")
        return self._own

    @property
    def runs_own(self) -> bool:
        """True if the board runs StepTwin's firmware."""
        return self._own is not None

    @property
    def firmware(self) -> Firmware:
        """StepTwin's firmware since power-up; raises like `own`."""
        return self.own.firmware

    @property
    def rate_ramps(self) -> list[RateRamp]:
        """Ramps of the group's time rate, since power-up or since they were last taken.

        Only StepTwin's firmware reports them.
        """
        return [] if self._own is None else self._own.rate_ramps

    def take_rate_ramps(self) -> list[RateRamp]:
        """Return `rate_ramps` up to now and clear it."""
        return [] if self._own is None else self._own.take_rate_ramps()

    def _make_controller(self) -> CanController:
        firmware = self.running
        return CanController(
            firmware.receive,
            firmware.on_can_error,
            firmware.hears,
            self.config.read_latency_counts,
            on_bus_off=firmware.on_bus_off,
        )

    @property
    def own_clock(self) -> LocalClock | None:
        """Clock of traces and pin changes; None for the clock of the simulation."""
        return None

    def boot(self, now_counts: int) -> None:
        """Switch the board on; its nodes announce themselves."""
        self.drivers.supply(SUPPLIES, now_counts, 1)
        self.running.boot(now_counts)
        Board.poll(self, now_counts)  # not the subclass' method, whose instants are of another clock; likewise below

    def power_cycle(self, now_counts: int) -> None:
        """Switch the supply off and on: all pins fall and the firmware restarts. Motors and clock do not change.

        Afterwards `can` is a new controller, which the caller attaches to the bus. A begun pulse still ends, because a
        supply does not fall within microseconds. There are no later pulses.
        """
        self.power_down(now_counts)
        self.start(now_counts)

    def power_down(self, now_counts: int) -> None:
        """Switch the supply off until `start`, like `power_cycle`, but with the new controller off the bus."""
        self._take_pins()
        self.drivers.drop_pins(now_counts)
        self.output_change_count += 1
        self.drivers.supply(reversed(SUPPLIES), now_counts, 0)
        self._fall_silent(self.drivers.cut_off(self.motion.take_edges(), now_counts), now_counts)

    def reset(self, now_counts: int) -> None:
        """Hold the processor in reset until `start`: its pins float at once, even during a pulse.

        The drivers keep their power. Afterwards `can` is a new controller, which the caller attaches to the bus.
        """
        self._take_pins()
        self.drivers.release_pins(now_counts)
        self.output_change_count += 1
        self._fall_silent(self.drivers.cut_short(self.motion.take_edges(), now_counts), now_counts)

    def _fall_silent(self, last_edges: list[PinEdges], now_counts: int) -> None:
        """Pass the last edges to the drivers; create the firmware that `start` will begin."""
        self.drivers.show(last_edges, self.motion.tick * TICK_COUNTS)
        self._power_up()
        self.can.power_down()
        self.down = True
        self._look_at_once = False
        self.running.advance(now_counts)
        self._heat_due_tick = self._next_heat_tick()

    def start(self, now_counts: int) -> None:
        """Start the firmware of a board that is down; the caller attaches its controller to the bus again."""
        self.down = False
        self.can.power_up()
        self.drivers.hold_pins(now_counts)
        self._look_at_once = self.inputs.levels != self._seen
        Board.boot(self, now_counts)
        self.measure(self.measurements, now_counts)

    def follow_outputs(self) -> list[OutputFollower]:
        """Return an output follower for each driver, for motors in the loop; call it before `boot`.

        From now on `place` sets the rotor positions for the switches; the drivers' counts do not.
        """
        self.inputs.leave_drivers()
        return self.drivers.follow_outputs()

    @property
    def slipped_full_steps(self) -> list[int]:
        """Full steps by which `slip` has moved each axis' rotor since power-up."""
        return self.drivers.slipped_full_steps

    def place(self, rotors_substeps: Sequence[int]) -> None:
        """Set the rotor positions for the switches, in substeps from their zeros."""
        if self.inputs.place(rotors_substeps):
            self._note_inputs()

    def distances_to_change(self) -> list[tuple[Travel, int]]:
        """Return, for each axis with switches, its travel and the shortest distance in substeps to a switch change."""
        return self.inputs.distances_to_change()

    @property
    def moving(self) -> bool:
        """True while an event is possible at any tick: in motion, or while the last motion may change a switch."""
        return self.inputs.unsettled or bool(self.motion.running_axes)

    def operate(self, operation: BoardOperation, now_counts: int) -> None:
        """Operate the machine. The firmware reads inputs with the next tick, measured values at once.

        Operations on drivers and motors act at the start of the next tick, because pulses are computed ahead.
        """
        operation.apply_to(self, now_counts)
        self._note_inputs()

    def hold_protect(self, axis: int, *, held: bool) -> None:
        """Hold the Protect pin of a driver low externally, or release it."""
        self._held_protects[axis] = held
        self._look_at_protect(axis)

    def short(self, axis: int, *, shorted: bool) -> None:
        """Short-circuit a motor, or remove the short circuit."""
        self.drain()
        self._shorted[axis] = shorted
        self.drivers.short(axis, self.computed_counts, shorted=shorted)
        self._look_at_once = not self.down
        self._hot = True

    def slip(self, axis: int, full_steps: int) -> None:
        """Move a rotor by full steps that the driver has not made."""
        self.drain()
        self.drivers.slip(axis, full_steps, self.computed_counts)
        self.inputs.shift(axis, full_steps * self.config.substeps, self.motion)

    def set_wire(self, axis: int, wire: Wire, condition: Condition) -> None:
        """Set the condition of a wire to a driver."""
        self.drain()
        self.drivers.set_wire(axis, wire, condition, self.computed_counts)
        self.inputs.expect(self.drivers.noisy_axes)
        self.inputs.unsettle(axis, self.motion)

    def set_driver_mode(self, axis: int, microsteps: int | None) -> None:
        """Set the microstep mode of a driver; None restores the board's mode, or that of its switches at power-up."""
        self.drain()
        self.drivers.set_mode(axis, microsteps, self.computed_counts)
        self.inputs.unsettle(axis, self.motion)

    def _note_inputs(self) -> None:
        """Schedule reading the inputs at the start of the next tick, if they have changed and the firmware runs."""
        self._look_at_once = self._look_at_once or (not self.down and self.inputs.levels != self._seen)

    @property
    def environment(self) -> BoardEnvironment:
        """What the machine around the board is like now; switches as they were read last."""
        return BoardEnvironment(
            self.inputs.emergency_stop,
            self.measurements.supply_10mv,
            self.measurements.temperature_decidegc,
            tuple(map(AxisEnvironment, self.inputs.levels, self.inputs.stuck, self._held_protects, self._shorted)),
            self.can.bitrate,
            torque_off=self.inputs.torque_off,
        )

    def measure(self, measurements: BoardReadings, now_counts: int) -> None:
        """Set the values that the board measures, and the drivers' supply voltage."""
        self.measurements = measurements
        self.drivers.supply_voltage(self.computed_counts, -(-measurements.supply_10mv // 100))
        self.running.measure(measurements.supply_10mv, measurements.temperature_decidegc, now_counts)

    def advance(self, until_counts: int) -> int:
        """Advance time; return the instant reached, which is earlier than `until_counts` if there are frames to send.

        A tick is computed only after the firmware has read the inputs at its start.
        """
        motion = self.motion
        if until_counts < motion.tick * TICK_COUNTS:
            return until_counts  # within a tick that is computed already
        while (due_tick := self._due_tick) is not None and due_tick * TICK_COUNTS <= until_counts:
            due_counts = due_tick * TICK_COUNTS
            if motion.tick < due_tick:
                reached = self._advance_freely(due_counts - 1)  # the inputs must be read before the tick starts
                if reached < due_counts - 1:
                    return reached
            if (self._look_at_once or self._heat_is_due or self.inputs.may_have_changed(motion)) and self._look():
                return due_counts
        return self._advance_freely(until_counts)

    @property
    def _due_tick(self) -> int | None:
        """Next tick at whose start the inputs must be read; None while they cannot change."""
        motion = self.motion
        if self._look_at_once:
            return motion.tick
        due_tick, heat_due_tick = self.inputs.due_tick(motion), self._heat_due_tick
        if due_tick is None or (heat_due_tick is not None and heat_due_tick < due_tick):
            due_tick = heat_due_tick
        return due_tick

    def _look(self) -> bool:
        """Read the inputs at the start of the next tick and pass them to the firmware; return whether they changed."""
        motion = self.motion
        if self._hot or self._heat_is_due or self.inputs.restless:
            self.drain()
        else:
            for rotor in self.inputs.due_rotors(motion):
                self.drain_axis(rotor)
        self.inputs.look(motion)
        if self.inputs.restless:
            self.inputs.expect(self.drivers.noisy_axes)
        if self._hot or self._heat_is_due:
            low = [self._look_at_protect(axis) for axis in range(self.config.axis_count)]
            self._hot = any(low)
            self._heat_due_tick = self._next_heat_tick()
        self._look_at_once = False
        levels = self.inputs.levels
        if levels == self._seen or self.down:
            return False
        self._seen = levels
        self.running.set_inputs(levels, motion.tick * TICK_COUNTS)
        return True

    @property
    def _heat_is_due(self) -> bool:
        return self._heat_due_tick is not None and self._heat_due_tick <= self.motion.tick

    def _look_at_protect(self, axis: int) -> bool:
        """Read a driver's fault output at the start of the next tick; return whether a protection keeps it off."""
        reported = self.drivers.drivers[axis].fault_inputs(self.motion.tick * TICK_COUNTS)
        held = DigitalInput.DRIVER_PROTECT if self._held_protects[axis] else DigitalInput(0)
        self.inputs.of_drivers[axis] = reported | held
        return bool(reported)

    def _next_heat_tick(self) -> int | None:
        """Return the tick before which no driver will shut down; None if none ever will.

        The estimate assumes the highest power; it becomes more exact as a shutdown approaches. A shorted motor and a
        latch may act after any change of a pin, which the module's couplers delay.
        """
        tick, drivers = self.motion.tick, self.drivers.drivers
        may_act = (shorted or driver.chip.latched for shorted, driver in zip(self._shorted, drivers, strict=True))
        if any(driver.reports_latch and acts for driver, acts in zip(drivers, may_act, strict=True)):
            return tick + 1
        stays = (driver.fault_stays_until(tick * TICK_COUNTS) for driver in drivers)
        ticks = [max(-(-counts // TICK_COUNTS), tick + 1) for counts in stays if counts is not None]
        return min(ticks, default=None)

    def _advance_freely(self, until_counts: int) -> int:
        """Advance time while no input changes; return the instant reached."""
        motion = self.motion
        reached = self.running.advance(until_counts)
        while reached < until_counts and motion.room_ticks == 0:
            self.drain()
            reached = self.running.advance(until_counts)
        return reached

    def poll(self, now_counts: int) -> None:
        """Do the processor's due work: read inputs, receive frames, then send."""
        firmware = self.running
        if self._look_at_once and self.motion.tick * TICK_COUNTS == now_counts:
            self._look()
        if self.can.next_due_counts is not None:
            self.can.poll(now_counts)
        firmware.poll(now_counts)
        if firmware.transmit.services or firmware.transmit.process_data:
            self._fill_mailboxes(now_counts)
        if firmware.pins and (self._hot or self._watching_outputs):
            self._take_pins()

    def _fill_mailboxes(self, now_counts: int) -> None:
        """Pass waiting frames to the CAN controller, as its driver does for a free mailbox."""
        can, transmit = self.can, self.running.transmit
        while can.has_free_mailbox and (frame := transmit.take(can.mailboxes, can.idle_since_counts, now_counts)):
            can.send(frame, now_counts)

    @property
    def next_due_counts(self) -> int | None:
        """Instant of the board's next work without external events; None if there is none."""
        firmware, read_counts = self.running, self.can.next_due_counts
        due_counts = firmware.next_due_counts if self.motion.events else firmware.due_counts
        if due_counts is None or (read_counts is not None and read_counts < due_counts):
            due_counts = read_counts
        pause_counts = firmware.transmit.due_counts
        if pause_counts is not None and self.can.has_free_mailbox:  # else the end of the next transmission calls `poll`
            due_counts = pause_counts if due_counts is None else min(due_counts, pause_counts)
        if self._look_at_once:
            tick_counts = self.motion.tick * TICK_COUNTS
            due_counts = tick_counts if due_counts is None else min(due_counts, tick_counts)
        elif self._heat_due_tick is not None:
            heat_counts = self._heat_due_tick * TICK_COUNTS
            due_counts = heat_counts if due_counts is None else min(due_counts, heat_counts)
        return due_counts

    def quiet_until(self, counts: int) -> bool:
        """Return whether nothing can happen up to an instant, because it is within a computed tick."""
        due_counts = self.next_due_counts
        return counts < self.motion.tick * TICK_COUNTS and (due_counts is None or due_counts > counts)

    def next_tick_counts(self, now_counts: int) -> int:
        """Return the start of the next servo tick after now."""
        return (now_counts // TICK_COUNTS + 1) * TICK_COUNTS

    @property
    def computed_counts(self) -> int:
        """Instant up to which all pulses are computed, at the start of a servo tick."""
        return self.motion.tick * TICK_COUNTS

    def drain(self) -> None:
        """Pass all computed pulses to the drivers."""
        self._take_pins()
        self.drivers.show(self.motion.take_edges(), self.motion.tick * TICK_COUNTS)

    def drain_axis(self, axis: int) -> None:
        """Pass one axis' computed pulses to its driver; to do so for all axes at each query would be slow."""
        self._take_pins()
        motion = self.motion
        self.drivers.show_axis(axis, motion.axes[axis].take_edges(), motion.tick * TICK_COUNTS)

    def driver_counts(self, axis: int) -> DriverMonitor:
        """Return the counts of an axis' driver, including the pulses of the present tick."""
        self.drain_axis(axis)
        return self.drivers.count(axis)

    def shaft(self, axis: int) -> Shaft:
        """Return the position of an axis' rotor; without motors in the loop, from the driver's steps and `slip`."""
        if self.rotor_of is not None:
            return self.rotor_of(axis)
        self.drain_axis(axis)
        units = self.drivers.rotor_substeps(axis) * UNITS_PER_FULL_STEP // self.config.substeps
        return Shaft(units, self.drivers.slipped_full_steps[axis])

    def _take_pins(self) -> None:
        for change in self.running.take_pins():
            self.drivers.set_pin(change)
            self.output_change_count += change.pin in OUTPUT_PINS
            self._look_at_once |= self._hot and change.pin not in OUTPUT_PINS  # RESET may end the thermal shutdown

    @property
    def pin_changes(self) -> list[PinChange]:
        """Changes of the firmware's static pins that have reached the drivers."""
        return self.drivers.pin_changes

    def watch_outputs(self) -> None:
        """Make `output_change_count` count each change at once."""
        self._watching_outputs = True

    def output_level(self, axis: int, pin: Pin) -> int:
        """Return the level of a digital output."""
        return self.drivers.level(axis, pin)

    def output_changes(self) -> list[PinChange]:
        """Return all changes of digital outputs so far, in order of time; the outputs are initially 0."""
        self.drain()
        return [change for change in self.drivers.pin_changes if change.pin in OUTPUT_PINS]

    def take_pin_changes(self) -> list[PinChange]:
        """Return `pin_changes` up to now and clear it."""
        self._take_pins()
        changes, self.drivers.pin_changes = self.drivers.pin_changes, []
        return changes

    def position_steps(self, axis: int) -> int:
        """Return the steps counted by an axis' driver since power-up."""
        self.drain_axis(axis)
        return self.drivers.drivers[axis].chip.position_steps

    def position_full_steps(self, axis: int) -> float:
        """Return the position of an axis' rotor since power-up."""
        self.drain_axis(axis)
        return self.drivers.rotor_substeps(axis) / self.config.substeps

    def positions_full_steps(self) -> list[float]:
        """Return `position_full_steps` of all axes."""
        self.drain()
        return [self.drivers.rotor_substeps(axis) / self.config.substeps for axis in range(self.config.axis_count)]

    def driver_microsteps(self, axis: int) -> int:
        """Return the microsteps per full step of an axis' driver, which may differ from the firmware's setting."""
        self.drain_axis(axis)
        return self.drivers.drivers[axis].microsteps

    def take_trace(self, axis: int) -> AxisTrace:
        """Return the trace of an axis and begin a new one, so memory stays bounded in endless runs."""
        trace = self.trace(axis)
        self.drivers.forget(axis)
        return trace

    def trace(self, axis: int) -> AxisTrace:
        """Return the trace of an axis since power-up, or since it was last taken."""
        self.drain_axis(axis)
        return self.drivers.trace(axis, self.motion.tick * TICK_COUNTS)
