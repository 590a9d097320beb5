"""The emulated board: the firmware, its drivers, its CAN controller and the inputs that the machine gives it."""

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
from steptwin.protocol.od import UNITS_PER_FULL_STEP


@dataclass(frozen=True, slots=True)
class BoardConfig:
    """Hardware of a board: the driver of each axis, node ids, the machine's switches.

    Positions are in substeps of the drivers (`ChipSheet.substeps`), which all divide a full step alike.
    """

    modules: tuple[Module, ...]
    """The driver of each axis: its chip, and the module around it."""
    first_node_id: int = FIRST_NODE_ID
    """Node id of the first axis; the next axes have the next ids."""
    read_latency_counts: int = 0
    """Counts from a message's arrival until the processor fetches it from the CAN controller."""
    switches: tuple[Switch, ...] = ()
    start_substeps: tuple[int, ...] = ()
    """Position of each axis' rotor when the board is made, in substeps from its zero; empty: all 0."""
    travels: tuple[Travel, ...] = ()
    """The way along which each axis' switches stand; empty: that of its own rotor."""
    crystal_ppm: int = 0
    """How fast the board's crystal is, in parts per million; `drifting_board.make_board` heeds it."""

    def __post_init__(self) -> None:
        if abs(self.crystal_ppm) > CRYSTAL_PPM_MAX:
            raise ValueError(f"crystal_ppm {self.crystal_ppm} is not from {-CRYSTAL_PPM_MAX} to {CRYSTAL_PPM_MAX}")
        if len({module.chip.substeps for module in self.modules}) != 1:
            raise ValueError("the drivers of a board do not divide a full step alike")

    @property
    def axis_count(self) -> int:
        """Number of axes."""
        return len(self.modules)

    @property
    def substeps(self) -> int:
        """Substeps in a full step."""
        return self.modules[0].chip.substeps

    @property
    def period_min_counts(self) -> int:
        """Shortest time between two pulses that a driver counts."""
        return min(module.chip.period_min_counts for module in self.modules)


class Shaft(NamedTuple):
    """Where one axis' rotor really is."""

    position_units: int
    """Since power-up, in wire units."""
    slipped_full_steps: int
    """Full steps by which it has fallen out of step since power-up, signed: four for each electrical turn."""


class Board:
    """One board on the bus.

    Pulses are computed ahead in batches; the drivers process them on demand. Most methods decide how far time may pass
    before the firmware must see its inputs again, so they belong together; inputs, drivers and CAN controller are parts
    of their own.
    """

    def __init__(
        self,
        config: BoardConfig,
        kernel: Kernel,
        flash: list[FlashPage] | None = None,
        program: BoardProgram | None = None,
    ) -> None:
        """Make a board without power.

        Args:
            config: its hardware.
            kernel: form of our firmware's kernel.
            flash: parameters that our firmware stored before, a page for each axis; None for a new board.
            program: what the processor runs; None for our firmware.
        """
        self.config = config
        self._own: OwnProgram | None = None
        """Our firmware; None if the board runs another."""
        if program is None:
            program = self._own = OwnProgram(kernel, config.axis_count, flash)
        self._program = program
        starts = config.start_substeps or (0,) * config.axis_count
        self.inputs: BoardInputs = BoardInputs(config.switches, starts, config.travels, config.period_min_counts)
        self.drivers: DriverBank = DriverBank(config.modules, self.inputs, at_edges=self._own is None)
        self.measurements: BoardReadings = BoardReadings()
        """What the board measures."""
        self._held_protects = [False] * config.axis_count
        """True for each axis whose Protect pin is held low from outside."""
        self._shorted = [False] * config.axis_count
        """True for each axis whose motor is short-circuited."""
        self._heat_due_tick: int | None = None
        """Tick at whose start the drivers' own Protect pins must be read next; None while they stay high."""
        self.down: bool = False
        """True while the processor has no power or is in reset."""
        self._hot = False
        """True while a driver tells that a protection holds its outputs off."""
        self._watching_outputs = False
        """True if the board must note each change of a digital output at once."""
        self.output_change_count: int = 0
        """Number of changes of digital outputs since the machine was switched on."""
        self.rotor_of: Callable[[int], Shaft] | None = None
        """Tells where an axis' rotor is, if motors turn with the board."""
        self._power_up()
        self._heat_due_tick = self._next_heat_tick()

    def _power_up(self) -> None:
        """Make a new firmware and a new CAN controller, as power-up does."""
        self.running: BoardFirmware = self._program.start(self)
        """The firmware since power-up."""
        self.motion: BoardPulses = self.running.motion
        """Its pulses."""
        self.can: CanController = self._make_controller()
        """The CAN controller; `poll` fills its mailboxes with the firmware's frames."""
        self.inputs.restart_count()
        self._seen = [DigitalInput(0)] * self.config.axis_count
        """Levels of the inputs that the firmware has seen last."""
        self._look_at_once = self.inputs.levels != self._seen
        """True if the inputs must be read at the start of the next tick."""
        self._program.connect(self)

    @property
    def own(self) -> OwnProgram:
        """Our firmware, its flash, and what it tells beside its pins and frames.

        Raises:
            OtherFirmwareError: the board runs another.
        """
        if self._own is None:
            raise OtherFirmwareError("the board does not run StepTwin's firmware")
        return self._own

    @property
    def runs_own(self) -> bool:
        """True if the board runs our firmware."""
        return self._own is not None

    @property
    def firmware(self) -> Firmware:
        """Our firmware since power-up; raises as `own`."""
        return self.own.firmware

    @property
    def rate_ramps(self) -> list[RateRamp]:
        """Ramps of the time of the axes that interpolate, since power-up or since they were taken last.

        Only our firmware can say where they are.
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
        """The clock of traces and pin changes; None if it is the simulation's."""
        return None

    def boot(self, now_counts: int) -> None:
        """Switch the board on; its nodes announce themselves."""
        self.drivers.supply(SUPPLIES, now_counts, 1)
        self.running.boot(now_counts)
        Board.poll(self, now_counts)  # not that of a subclass, which takes instants of another clock; so below

    def power_cycle(self, now_counts: int) -> None:
        """Switch the supply off and on: all pins fall and the firmware restarts. Motors and clock stay as they are.

        Afterwards `can` is a new controller, which the caller attaches to the bus. A pulse that has begun still ends,
        since no supply falls within microseconds; later pulses do not come.
        """
        self.power_down(now_counts)
        self.start(now_counts)

    def power_down(self, now_counts: int) -> None:
        """Switch the supply off, until `start`: as `power_cycle`, but the new controller stays off the bus."""
        self._take_pins()
        self.drivers.drop_pins(now_counts)
        self.output_change_count += 1
        self.drivers.supply(reversed(SUPPLIES), now_counts, 0)
        self._fall_silent(self.drivers.cut_off(self.motion.take_edges(), now_counts), now_counts)

    def reset(self, now_counts: int) -> None:
        """Hold the processor in reset, until `start`: its pins float at once, also in a pulse. The drivers have power.

        Afterwards `can` is a new controller, which the caller attaches to the bus.
        """
        self._take_pins()
        self.drivers.release_pins(now_counts)
        self.output_change_count += 1
        self._fall_silent(self.drivers.cut_short(self.motion.take_edges(), now_counts), now_counts)

    def _fall_silent(self, last_edges: list[PinEdges], now_counts: int) -> None:
        """Show the drivers the last edges; make the firmware that `start` begins."""
        self.drivers.show(last_edges, self.motion.tick * TICK_COUNTS)
        self._power_up()
        self.can.power_down()
        self.down = True
        self._look_at_once = False
        self.running.advance(now_counts)
        self._heat_due_tick = self._next_heat_tick()

    def start(self, now_counts: int) -> None:
        """Let the firmware of a board that is down begin; the caller attaches its controller to the bus again."""
        self.down = False
        self.can.power_up()
        self.drivers.hold_pins(now_counts)
        self._look_at_once = self.inputs.levels != self._seen
        Board.boot(self, now_counts)
        self.measure(self.measurements, now_counts)

    def follow_outputs(self) -> list[OutputFollower]:
        """Return what follows each driver's outputs, for motors that turn with them; call this before `boot`.

        From now on the switches are where `place` puts the rotors, not where the drivers have counted.
        """
        self.inputs.leave_drivers()
        return self.drivers.follow_outputs()

    @property
    def slipped_full_steps(self) -> list[int]:
        """Way by which `slip` has moved each axis' rotor since power-up."""
        return self.drivers.slipped_full_steps

    def place(self, rotors_substeps: Sequence[int]) -> None:
        """Let the machine's switches follow the rotors, in substeps from their zeros."""
        if self.inputs.place(rotors_substeps):
            self._note_inputs()

    def ways_to_change(self) -> list[tuple[Travel, int]]:
        """Return, for each axis with switches, its way and the least distance on it, in substeps, to a change."""
        return self.inputs.ways_to_change()

    @property
    def moving(self) -> bool:
        """True while an event is possible at any tick: a motion runs, or the last one may still change a switch."""
        return self.inputs.unsettled or bool(self.motion.running_axes)

    def operate(self, operation: BoardOperation, now_counts: int) -> None:
        """Operate the machine. The firmware sees inputs with the next tick, measured values at once.

        What happens at the drivers and motors happens at the start of the next tick, since pulses are computed ahead.
        """
        operation.apply_to(self, now_counts)
        self._note_inputs()

    def hold_protect(self, axis: int, *, held: bool) -> None:
        """Hold the Protect pin of a driver low from outside, or release it."""
        self._held_protects[axis] = held
        self._look_at_protect(axis)

    def short(self, axis: int, *, shorted: bool) -> None:
        """Let a motor be short-circuited, or whole again."""
        self.drain()
        self._shorted[axis] = shorted
        self.drivers.short(axis, self.computed_counts, shorted=shorted)
        self._look_at_once = not self.down
        self._hot = True

    def slip(self, axis: int, full_steps: int) -> None:
        """Let a rotor jump by full steps that no driver has made."""
        self.drain()
        self.drivers.slip(axis, full_steps, self.computed_counts)
        self.inputs.shift(axis, full_steps * self.config.substeps, self.motion)

    def set_wire(self, axis: int, wire: Wire, condition: Condition) -> None:
        """Let a wire to a driver be like this."""
        self.drain()
        self.drivers.set_wire(axis, wire, condition, self.computed_counts)
        self.inputs.expect(self.drivers.noisy_axes)
        self.inputs.unsettle(axis, self.motion)

    def set_driver_mode(self, axis: int, microsteps: int | None) -> None:
        """Set a driver to a microstep mode; None: as the board has it, or its switches had it at power-up."""
        self.drain()
        self.drivers.set_mode(axis, microsteps, self.computed_counts)
        self.inputs.unsettle(axis, self.motion)

    def _note_inputs(self) -> None:
        """Read the inputs at the start of the next tick if they have changed and there is a firmware to see it."""
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
        )

    def measure(self, measurements: BoardReadings, now_counts: int) -> None:
        """Let the board measure other values from now on, and the drivers have this supply."""
        self.measurements = measurements
        self.drivers.supply_voltage(self.computed_counts, -(-measurements.supply_10mv // 100))
        self.running.measure(measurements.supply_10mv, measurements.temperature_decidegc, now_counts)

    def advance(self, until_counts: int) -> int:
        """Let time pass; return the instant reached, which is earlier than `until_counts` if there are frames to send.

        A tick is computed only after the firmware has seen the inputs at its start.
        """
        motion = self.motion
        if until_counts < motion.tick * TICK_COUNTS:
            return until_counts  # within a tick that is computed already
        while (due_tick := self._due_tick) is not None and due_tick * TICK_COUNTS <= until_counts:
            due_counts = due_tick * TICK_COUNTS
            if motion.tick < due_tick:
                reached = self._advance_freely(due_counts - 1)  # the start of the tick itself comes after the look
                if reached < due_counts - 1:
                    return reached
            if (self._look_at_once or self._heat_is_due or self.inputs.may_have_changed(motion)) and self._look():
                return due_counts
        return self._advance_freely(until_counts)

    @property
    def _due_tick(self) -> int | None:
        """Next tick at whose start the inputs must be read; None while they stay as they are."""
        motion = self.motion
        if self._look_at_once:
            return motion.tick
        due_tick, heat_due_tick = self.inputs.due_tick(motion), self._heat_due_tick
        if due_tick is None or (heat_due_tick is not None and heat_due_tick < due_tick):
            due_tick = heat_due_tick
        return due_tick

    def _look(self) -> bool:
        """Read the inputs at the start of the next tick and show them to the firmware; return True if they changed."""
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
        """Read what a driver tells at the start of the next tick; return True if a protection holds it off."""
        told = self.drivers.drivers[axis].told(self.motion.tick * TICK_COUNTS)
        held = DigitalInput.DRIVER_PROTECT if self._held_protects[axis] else DigitalInput(0)
        self.inputs.of_drivers[axis] = told | held
        return bool(told)

    def _next_heat_tick(self) -> int | None:
        """Return the tick up to whose start no driver will switch itself off; None if no driver ever will.

        The estimate assumes the highest power; the nearer a shutdown is, the more exact it becomes. A motor that is
        shorted and a latch may act with any change of a pin, which a module's parts delay.
        """
        tick, drivers = self.motion.tick, self.drivers.drivers
        may_act = (shorted or driver.chip.latched for shorted, driver in zip(self._shorted, drivers, strict=True))
        if any(driver.tells_latch and acts for driver, acts in zip(drivers, may_act, strict=True)):
            return tick + 1
        stays = (driver.told_until(tick * TICK_COUNTS) for driver in drivers)
        ticks = [max(-(-counts // TICK_COUNTS), tick + 1) for counts in stays if counts is not None]
        return min(ticks, default=None)

    def _advance_freely(self, until_counts: int) -> int:
        """Let time pass during which no input changes; return the instant reached."""
        motion = self.motion
        reached = self.running.advance(until_counts)
        while reached < until_counts and motion.room_ticks == 0:
            self.drain()
            reached = self.running.advance(until_counts)
        return reached

    def poll(self, now_counts: int) -> None:
        """Let the processor do its due work: read its inputs, fetch messages, then send."""
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
        """Pass waiting frames to the CAN controller, as its driver does when a mailbox becomes free."""
        can, transmit = self.can, self.running.transmit
        while can.has_free_mailbox and (frame := transmit.take(can.mailboxes, can.idle_since_counts, now_counts)):
            can.send(frame, now_counts)

    @property
    def next_due_counts(self) -> int | None:
        """Instant of the board's next work of its own; None if there is none."""
        firmware, read_counts = self.running, self.can.next_due_counts
        due_counts = firmware.next_due_counts if self.motion.events else firmware.due_counts
        if due_counts is None or (read_counts is not None and read_counts < due_counts):
            due_counts = read_counts
        pause_counts = firmware.transmit.due_counts
        if pause_counts is not None and self.can.has_free_mailbox:  # if none is free, the next frame sent calls `poll`
            due_counts = pause_counts if due_counts is None else min(due_counts, pause_counts)
        if self._look_at_once:
            tick_counts = self.motion.tick * TICK_COUNTS
            due_counts = tick_counts if due_counts is None else min(due_counts, tick_counts)
        elif self._heat_due_tick is not None:
            heat_counts = self._heat_due_tick * TICK_COUNTS
            due_counts = heat_counts if due_counts is None else min(due_counts, heat_counts)
        return due_counts

    def quiet_until(self, counts: int) -> bool:
        """Return True if nothing can happen up to an instant: it lies within a tick that is computed already."""
        due_counts = self.next_due_counts
        return counts < self.motion.tick * TICK_COUNTS and (due_counts is None or due_counts > counts)

    def next_tick_counts(self, now_counts: int) -> int:
        """Return the instant after now when the next servo tick begins."""
        return (now_counts // TICK_COUNTS + 1) * TICK_COUNTS

    @property
    def computed_counts(self) -> int:
        """Instant up to which all pulses are computed: the start of a servo tick."""
        return self.motion.tick * TICK_COUNTS

    def drain(self) -> None:
        """Let the drivers process all pulses computed so far."""
        self._take_pins()
        self.drivers.show(self.motion.take_edges(), self.motion.tick * TICK_COUNTS)

    def drain_axis(self, axis: int) -> None:
        """Let one driver process its pulses: those of all axes, for each question about one, would hold up a board."""
        self._take_pins()
        motion = self.motion
        self.drivers.show_axis(axis, motion.axes[axis].take_edges(), motion.tick * TICK_COUNTS)

    def driver_counts(self, axis: int) -> DriverMonitor:
        """Return the counts of an axis' driver, including the pulses of the tick in progress."""
        self.drain_axis(axis)
        return self.drivers.count(axis)

    def shaft(self, axis: int) -> Shaft:
        """Return where an axis' rotor is: without motors it is where the driver's steps and `slip` have put it."""
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
        """Changes, already at the drivers, of the pins that the firmware holds at a level."""
        return self.drivers.pin_changes

    def watch_outputs(self) -> None:
        """Let `output_change_count` count each change at once."""
        self._watching_outputs = True

    def output_level(self, axis: int, pin: Pin) -> int:
        """Return the level of a digital output."""
        return self.drivers.level(axis, pin)

    def output_changes(self) -> list[PinChange]:
        """Return all changes of digital outputs so far, in order of time; outputs are 0 at first."""
        self.drain()
        return [change for change in self.drivers.pin_changes if change.pin in OUTPUT_PINS]

    def take_pin_changes(self) -> list[PinChange]:
        """Return `pin_changes` up to now and clear it."""
        self._take_pins()
        changes, self.drivers.pin_changes = self.drivers.pin_changes, []
        return changes

    def position_steps(self, axis: int) -> int:
        """Return the steps that an axis' driver has counted since power-up."""
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
        """Return the microsteps per full step that an axis' driver makes, whatever the firmware takes them for."""
        self.drain_axis(axis)
        return self.drivers.drivers[axis].microsteps

    def take_trace(self, axis: int) -> AxisTrace:
        """Return the trace of an axis and begin the next one here, so that a board may run for ever."""
        trace = self.trace(axis)
        self.drivers.forget(axis)
        return trace

    def trace(self, axis: int) -> AxisTrace:
        """Return the trace of an axis since power-up, or since it was taken last."""
        self.drain_axis(axis)
        return self.drivers.trace(axis, self.motion.tick * TICK_COUNTS)
