"""The emulated board: the firmware, its TB6560s, the wires between them and a record of what went over these."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from steptwin.controller.backend import Kernel
from steptwin.controller.firmware import Firmware
from steptwin.controller.kernel import TICK_COUNTS
from steptwin.controller.measurements import DriverMonitor, Measurements
from steptwin.controller.pins import OUTPUT_PINS, PinChange
from steptwin.emulator.can_controller import CanController
from steptwin.emulator.driver_bank import SUPPLIES, WIRING, AxisTrace, DriverBank
from steptwin.emulator.driver_module import Module
from steptwin.emulator.inputs import BoardInputs
from steptwin.emulator.operations import BoardTemperature, DriverProtect, EmergencyStop, Operation, Supply
from steptwin.emulator.switches import Switch
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.dictionary import FlashPage
from steptwin.protocol.frame import FIRST_NODE_ID
from steptwin.protocol.pvt import PvtRecord


@dataclass(frozen=True, slots=True)
class BoardConfig:
    """What is soldered, plugged and set: how many axes, the OSC capacitors, the node ids, the machine's switches."""

    axis_count: int
    osc_pf: tuple[float, ...]
    first_node_id: int = FIRST_NODE_ID
    """The first axis' node id; the others count on from it."""
    read_latency_counts: int = 0
    """How long after its arrival the processor fetches a message from the CAN controller: by default at once."""
    switches: tuple[Switch, ...] = ()
    start_steps: tuple[int, ...] = ()
    """Where each axis of the machine stands when the board is made, in steps from its true zero; none given: all 0."""
    modules: tuple[Module, ...] = ()
    """What is around each chip; none for chips on the board itself."""


class Board:
    """One board on the bus. Pulses are computed ahead in batches; the drivers look at them when somebody looks."""

    def __init__(self, config: BoardConfig, kernel: Kernel, flash: list[FlashPage] | None = None) -> None:
        """A board fresh from the factory, or with what another one had in its flash."""
        self.config = config
        self.flash: list[FlashPage] = [{} for _ in range(config.axis_count)] if flash is None else flash
        """What the firmware has stored, a page for each axis: all that outlives the power."""
        self._kernel = kernel
        modules = config.modules or (Module(),) * config.axis_count
        self._inputs = BoardInputs(config.switches, config.start_steps or (0,) * config.axis_count)
        self._drivers = DriverBank(config.osc_pf, modules, self._inputs)
        self._measurements = Measurements()
        self._held_protects = [False] * config.axis_count
        """The Protect pins that somebody holds low."""
        self._heat_due_tick: int | None = None
        """The tick at whose start the drivers' own Protect pins want to be looked at next; None: they stay high."""
        self._hot = False
        """Whether one of these is low."""
        self._on_record: dict[int, Callable[[PvtRecord], None]] = {}
        """Listeners to the records of each axis' queue."""
        self._power_up()
        self._heat_due_tick = self._next_heat_tick()

    def _power_up(self) -> None:
        """Firmware and CAN controller as they are with power."""
        self.firmware = Firmware(
            self._kernel, self.config.axis_count, self.flash, self.config.first_node_id, self._monitor
        )
        self.can = CanController(
            self.firmware.receive, self.firmware.on_can_error, self.firmware.hears, self.config.read_latency_counts
        )
        """The CAN controller; what it says to the bus it says in `poll`."""
        self._inputs.count_anew()
        self._seen = [DigitalInput(0)] * self.config.axis_count
        """The levels of the inputs that the firmware has seen."""
        self._look_at_once = self._inputs.levels != self._seen
        """Whether the inputs are to be looked at as soon as a tick begins."""
        for axis, listener in self._on_record.items():
            self.on_record(axis, listener)
        self._monitored = [self._drivers.count(axis) for axis in range(self.config.axis_count)]

    def on_record(self, axis: int, listener: Callable[[PvtRecord], None]) -> None:
        """Call a listener with each PVT record that an axis' queue takes from now on."""
        self._on_record[axis] = listener
        self.firmware.nodes[axis].drive.interpolation.on_record = listener

    def boot(self, now_counts: int) -> None:
        """Switch the board on: its nodes announce themselves."""
        self._drivers.supply(SUPPLIES, now_counts, 1)
        self.firmware.boot(now_counts)
        self.poll(now_counts)

    def power_cycle(self, now_counts: int) -> None:
        """Switch the supply off and on: all pins fall, the firmware begins anew. Motors and clock stay as they are.

        `can` is another one afterwards, which nobody has attached to the bus yet. A pulse that has begun still ends,
        since no supply is gone within microseconds; what would come after it does not.
        """
        self._take_pins()
        self._drivers.drop_pins(now_counts)
        self._drivers.supply(reversed(SUPPLIES), now_counts, 0)
        motion = self.firmware.motion
        self._drivers.show(self._drivers.cut_off(motion.take_edges(), now_counts), motion.tick * TICK_COUNTS)
        self._power_up()
        self.firmware.advance(now_counts)
        self._heat_due_tick = self._next_heat_tick()
        self.boot(now_counts)
        self._measure(self._measurements, now_counts)

    @property
    def moving(self) -> bool:
        """Whether the board may have something to say at any tick: a motion runs, or one just over passed a switch."""
        return self._inputs.unsettled or any(
            self.firmware.motion.running(axis) for axis in range(self.config.axis_count)
        )

    def operate(self, operation: Operation, now_counts: int) -> None:
        """Do something to the machine. The firmware sees inputs with the next tick, measured values at once."""
        match operation:
            case EmergencyStop(pressed):
                self._inputs.emergency_stop = pressed
            case DriverProtect(axis, active):
                self._held_protects[axis] = active
                self._look_at_protect(axis)
            case Supply(supply_10mv):
                self._measure(replace(self._measurements, supply_10mv=supply_10mv), now_counts)
            case BoardTemperature(temperature_decidegc):
                self._measure(replace(self._measurements, temperature_decidegc=temperature_decidegc), now_counts)
        self._look_at_once = self._look_at_once or self._inputs.levels != self._seen

    def _measure(self, measurements: Measurements, now_counts: int) -> None:
        self._measurements = measurements
        self.firmware.measure(measurements.supply_10mv, measurements.temperature_decidegc, now_counts)

    def advance(self, until_counts: int) -> int:
        """Let time pass; return the instant reached: earlier than asked for if there are frames to send.

        No tick is computed before the firmware has seen the inputs at its start.
        """
        motion = self.firmware.motion
        if until_counts < motion.tick * TICK_COUNTS:
            return until_counts  # within a tick that is computed already
        while (due_tick := self._due_tick) is not None and due_tick * TICK_COUNTS <= until_counts:
            due_counts = due_tick * TICK_COUNTS
            if motion.tick < due_tick:
                reached = self._advance_freely(due_counts - 1)  # what happens at the start of the tick comes after
                if reached < due_counts - 1:
                    return reached
            if (self._look_at_once or self._heat_is_due or self._inputs.may_have_changed(motion)) and self._look():
                return due_counts
        return self._advance_freely(until_counts)

    @property
    def _due_tick(self) -> int | None:
        """The next tick at whose start the inputs are to be looked at."""
        motion = self.firmware.motion
        if self._look_at_once:
            return motion.tick
        due_tick, heat_due_tick = self._inputs.due_tick(motion), self._heat_due_tick
        if due_tick is None or (heat_due_tick is not None and heat_due_tick < due_tick):
            due_tick = heat_due_tick
        return due_tick

    def _look(self) -> bool:
        """Let the firmware see the inputs at the start of the tick to come; whether they have changed."""
        motion = self.firmware.motion
        self.drain()
        self._inputs.look(motion)
        if self._hot or self._heat_is_due:
            low = [self._look_at_protect(axis) for axis in range(self.config.axis_count)]
            self._hot = any(low)
            self._heat_due_tick = self._next_heat_tick()
        self._look_at_once = False
        levels = self._inputs.levels
        if levels == self._seen:
            return False
        self._seen = levels
        self.firmware.set_inputs(levels, motion.tick * TICK_COUNTS)
        return True

    @property
    def _heat_is_due(self) -> bool:
        return self._heat_due_tick is not None and self._heat_due_tick <= self.firmware.motion.tick

    def _look_at_protect(self, axis: int) -> bool:
        """See the pin as it is at the start of the tick to come; whether the driver itself holds it low."""
        tick_counts = self.firmware.motion.tick * TICK_COUNTS
        low = not self._drivers.drivers[axis].protect_level(tick_counts)
        self._inputs.protects[axis] = low or self._held_protects[axis]
        return low

    def _next_heat_tick(self) -> int | None:
        """Up to the start of which tick no driver switches itself off, as far as that is known now."""
        tick = self.firmware.motion.tick
        stays = (driver.protect_stays_until(tick * TICK_COUNTS) for driver in self._drivers.drivers)
        ticks = [max(-(-counts // TICK_COUNTS), tick + 1) for counts in stays if counts is not None]
        return min(ticks, default=None)

    def _advance_freely(self, until_counts: int) -> int:
        """Let time pass in which no input changes."""
        motion = self.firmware.motion
        reached = self.firmware.advance(until_counts)
        while reached < until_counts and motion.room_ticks == 0:
            self.drain()
            reached = self.firmware.advance(until_counts)
        return reached

    def poll(self, now_counts: int) -> None:
        """Let the processor do what is due: look at its inputs, fetch messages, then send."""
        firmware = self.firmware
        if self._look_at_once and firmware.motion.tick * TICK_COUNTS == now_counts:
            self._look()
        if self.can.next_due_counts is not None:
            self.can.poll(now_counts)
        firmware.poll(now_counts)
        for frame in firmware.take_frames():
            self.can.send(frame, now_counts)
        if self._hot:
            self._take_pins()

    @property
    def next_due_counts(self) -> int | None:
        """When the board next does something by itself."""
        due_counts, read_counts = self.firmware.next_due_counts, self.can.next_due_counts
        if due_counts is None or (read_counts is not None and read_counts < due_counts):
            due_counts = read_counts
        if self._look_at_once:
            tick_counts = self.firmware.motion.tick * TICK_COUNTS
            due_counts = tick_counts if due_counts is None else min(due_counts, tick_counts)
        elif self._heat_due_tick is not None:
            heat_counts = self._heat_due_tick * TICK_COUNTS
            due_counts = heat_counts if due_counts is None else min(due_counts, heat_counts)
        return due_counts

    def quiet_until(self, counts: int) -> bool:
        """Whether it is known by now that nothing happens up to an instant: it is within a tick computed already."""
        due_counts = self.next_due_counts
        return counts < self.firmware.motion.tick * TICK_COUNTS and (due_counts is None or due_counts > counts)

    def drain(self) -> None:
        """Show the drivers all pulses placed so far."""
        self._take_pins()
        self._drivers.show(self.firmware.motion.take_edges(), self.firmware.motion.tick * TICK_COUNTS)

    def _monitor(self, axis: int) -> DriverMonitor:
        """What has become of an axis' pulses since power-up, those of the tick in progress included."""
        self.drain()
        counted, before = self._drivers.count(axis), self._monitored[axis]
        return DriverMonitor(*(now - then for now, then in zip(counted, before, strict=True)))

    def _take_pins(self) -> None:
        for change in self.firmware.take_pins():
            self._drivers.set_pin(change)
            self._look_at_once |= self._hot and change.pin in WIRING  # RESET may end the thermal shutdown

    @property
    def pin_changes(self) -> list[PinChange]:
        """Changes of the pins that the firmware holds at a level, as far as the drivers have been shown them."""
        return self._drivers.pin_changes

    def output_changes(self) -> list[PinChange]:
        """Every change of a digital output so far, in order of time; all outputs are 0 before their first."""
        self.drain()
        return [change for change in self._drivers.pin_changes if change.pin in OUTPUT_PINS]

    def take_pin_changes(self) -> list[PinChange]:
        """Hand out what `pin_changes` holds, and forget it."""
        self.drain()
        changes, self._drivers.pin_changes = self._drivers.pin_changes, []
        return changes

    def position_steps(self, axis: int) -> int:
        """Where an axis' driver has brought its motor since power-up."""
        self.drain()
        return self._drivers.drivers[axis].position_steps

    def take_trace(self, axis: int) -> AxisTrace:
        """As `trace`, and forget it: the next one begins here. So a board may run for ever."""
        trace = self.trace(axis)
        self._drivers.forget(axis)
        return trace

    def trace(self, axis: int) -> AxisTrace:
        """Return everything that happened at an axis' driver so far and was not taken."""
        self.drain()
        return self._drivers.trace(axis, self.firmware.motion.tick * TICK_COUNTS)
