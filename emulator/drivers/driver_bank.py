"""The drivers of a board, their wires from the firmware's pins, and the record of all edges."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steptwin.controller.motion.axis_motion import PinEdges
from steptwin.controller.node.pins import OUTPUT_PINS, Pin, PinChange
from steptwin.emulator.board.edges import Int8Array, Int64Array
from steptwin.emulator.board.inputs import BoardInputs
from steptwin.emulator.drivers.axis_wires import AxisWires, Condition, Wire
from steptwin.emulator.drivers.driver import Driver
from steptwin.emulator.drivers.driver_module import Module
from steptwin.emulator.drivers.limits import Violations
from steptwin.emulator.drivers.output_follower import OutputFollower
from steptwin.emulator.drivers.outputs import ChipOutputs
from steptwin.emulator.drivers.terminals import LevelChange, Rail, TerminalEdges
from steptwin.protocol.drivers import ActiveEdge

SUPPLIES = (Rail.VDD, Rail.VM)
"""The drivers' supplies, in the order of switching on."""

_FIRST_OFF = (Pin.ENABLE, Pin.RESET)
"""Pins that fall before all others at power-down, because M1 and M2 may change in reset only."""


class DriverMonitor(NamedTuple):
    """Counts of one axis' driver, and its mode."""

    rotor_steps: int
    """Signed number of steps that the driver has counted."""
    lost_steps: int
    """Steps made minus steps counted, both signed: the lag of the rotor."""
    violations: int
    """Number of pulses that have violated a limit of the driver."""
    microsteps: int = 0
    """Microsteps per full step, from the chip's pins or the module's switches; 0 if unknown."""


@dataclass(frozen=True, slots=True)
class AxisTrace:
    """Record of one driver: times in counts since boot, DIR levels after each edge."""

    clk_rise_counts: Int64Array
    clk_fall_counts: Int64Array
    """The fall of each pulse; the end of the trace for a pulse that has not ended."""
    active_edge: ActiveEdge
    """Edge of STEP at which CLK of the chip rises."""
    dir_counts: Int64Array
    dir_levels: Int8Array
    step_counts: Int64Array
    step_signs: Int8Array
    violations: Violations
    outputs: ChipOutputs
    """Phase currents and field angle at any instant since the start of the trace."""
    substeps: int
    """Substeps per full step."""
    position_steps: int
    """Steps counted since power-up."""
    position_full_steps: float
    """Position of the rotor since power-up."""
    slip_counts: Int64Array
    """Instants when the rotor slipped."""
    slip_full_steps: Int64Array
    """Signed full steps of each slip."""


class DriverBank:
    """The drivers of all axes.

    Pulses are computed ahead in batches. `show` passes a batch to the drivers and reports the counted steps to the
    inputs, because a step may reach a switch.
    """

    def __init__(self, modules: Sequence[Module], inputs: BoardInputs, *, at_edges: bool = False) -> None:
        """Create the drivers; for `at_edges` see `Driver`."""
        self._at_edges = at_edges
        self.drivers: list[Driver] = [Driver(module, at_edges=at_edges) for module in modules]
        self.pin_changes: list[PinChange] = []
        """Changes of the firmware's static pins that are not taken yet."""
        self._inputs = inputs
        self._waiting: list[list[LevelChange]] = [[] for _ in self.drivers]
        """By axis, level changes that have not been passed to the driver yet."""
        self._pins: list[list[TerminalEdges]] = [[_pins(PinEdges([], []), [], 0)] for _ in self.drivers]
        """By axis, all edges at the driver's terminals since `forget`."""
        self._wires: list[AxisWires | None] = [None] * len(self.drivers)
        """By axis, the wires to the driver; None if no wire has had a fault."""
        self._strapped: set[tuple[int, Pin]] = set()
        """Pins of the chips that are strapped to a level, independent of the firmware."""
        self._pin_levels: dict[tuple[int, Pin], int] = {}
        self._step_levels = [0] * len(self.drivers)
        self._dir_levels = [0] * len(self.drivers)
        self._slips: list[list[tuple[int, int]]] = [[] for _ in self.drivers]
        """By axis, slips of the rotor since `forget`: instant and full steps."""
        self.slipped_full_steps: list[int] = [0] * len(self.drivers)
        """By axis, sum of all slips of the rotor since power-up."""

    # --- in

    def set_pin(self, change: PinChange) -> None:
        """Set a pin of the firmware."""
        self._pin_levels[change.axis, change.pin] = change.level
        if (change.axis, change.pin) in self._strapped:
            return
        wires = self._wires[change.axis]
        if wires is not None and change.pin is Pin.ENABLE:
            wires.set_enable(change.counts, change.level)
            return
        self.pin_changes.append(change)
        if change.pin not in OUTPUT_PINS:
            self._waiting[change.axis].append(LevelChange(change.counts, change.pin, change.level))

    def level(self, axis: int, pin: Pin) -> int:
        """Return the level that the firmware has set at a pin."""
        return self._pin_levels.get((axis, pin), 0)

    def drop_pins(self, now_counts: int, kept: Collection[tuple[int, Pin]] = ()) -> None:
        """Let all high pins fall at power-down, except those of `kept`."""
        high = (place for place, level in self._pin_levels.items() if level and place not in kept)
        for axis, pin in sorted(high, key=lambda place: place[1] not in _FIRST_OFF):
            self.set_pin(PinChange(now_counts, axis, pin, 0))

    def release_pins(self, now_counts: int) -> None:
        """Let all pins float in a reset of the processor: they fall, and ENABLE is as at an open terminal."""
        pulled_up = [(axis, Pin.ENABLE) for axis, driver in enumerate(self.drivers) if driver.module.enable_open]
        self.drop_pins(now_counts, pulled_up)
        for axis, pin in pulled_up:
            if not self.level(axis, pin):
                self.set_pin(PinChange(now_counts, axis, pin, 1))

    def hold_pins(self, now_counts: int) -> None:
        """Set all floating pins low, as the firmware does first when it starts."""
        self.drop_pins(now_counts)

    def supply(self, supplies: Iterable[Rail], now_counts: int, level: int) -> None:
        """Switch supplies at every driver, one supply after the other."""
        for supply in supplies:
            for changes in self._waiting:
                changes.append(LevelChange(now_counts, supply, level))

    def begin_high(self, axis: int, counts: int) -> bool:
        """Set STEP high at the firmware's start, without an edge; return False if the driver would see an edge."""
        if self._wires[axis] is not None or self._step_levels[axis]:
            return False
        self._pins[axis].append(_pins(PinEdges([counts], []), [], counts))
        self._step_levels[axis] = 1
        self.drivers[axis].begin_high(counts)
        return True

    def show(self, all_edges: Sequence[PinEdges], until_counts: int) -> None:
        """Pass the new edges and levels up to an instant to all drivers."""
        for axis, edges in enumerate(all_edges):
            self.show_axis(axis, edges, until_counts)

    def show_axis(self, axis: int, edges: PinEdges, until_counts: int) -> None:
        """Pass the new edges and levels up to an instant to one driver."""
        moved, wires = len(edges.clk_counts) or len(edges.direction), self._wires[axis]
        wires_wait = wires is not None and wires.waiting
        if not (moved or self._waiting[axis] or self.drivers[axis].waiting or wires_wait):
            return
        pins = _pins(edges, self._waiting[axis], until_counts, self._step_levels[axis])
        self._waiting[axis] = []
        self._step_levels[axis] ^= len(edges.clk_counts) & 1
        if pins.dir_levels.size:
            self._dir_levels[axis] = int(pins.dir_levels[-1])
        if wires is not None:
            self._take(axis, wires.take(pins))
            return
        self._feed(axis, pins)
        if moved:
            self._pins[axis].append(pins)

    def _feed(self, axis: int, edges: TerminalEdges) -> None:
        driver, wires = self.drivers[axis], self._wires[axis]
        moves = driver.feed(edges)
        held_pulses = driver.held_pulses + (wires.held_pulses if wires is not None else 0)
        self._inputs.moved(axis, *moves, held_pulses=held_pulses, step_substeps=driver.step_substeps)

    def _take(self, axis: int, passed: TerminalEdges) -> None:
        """Pass the edges after the wires to one driver, and record them."""
        self._feed(axis, passed)
        self._pins[axis].append(passed)
        self.pin_changes += (
            PinChange(change.counts, axis, Pin.ENABLE, change.level)
            for change in passed.changes
            if change.terminal == Pin.ENABLE
        )

    # --- faults

    def set_wire(self, axis: int, wire: Wire, condition: Condition, counts: int) -> None:
        """Set the condition of a wire from an instant on; all edges before it must have been shown."""
        driver, wires = self.drivers[axis], self._wires[axis]
        if wires is None:
            wires = self._wires[axis] = AxisWires(
                driver.module.active_edge,
                enable_open=driver.module.enable_open,
                step_level=self._step_levels[axis],
                dir_level=self._dir_levels[axis],
                enable_level=self.level(axis, Pin.ENABLE),
                at_edges=self._at_edges,
            )
        self._take(axis, wires.change(wire, condition, counts))

    def set_mode(self, axis: int, microsteps: int | None, counts: int) -> None:
        """Set a driver's mode by its switches or straps; None removes this, and the firmware's pins act again."""
        driver = self.drivers[axis]
        if driver.module.switches is not None:
            driver.turn_switches(microsteps, counts)
            return
        levels = driver.module.chip.modes.value.levels(driver.microsteps if microsteps is None else microsteps)
        for name, level in levels.items():
            pin = Pin(name)
            self._strapped.discard((axis, pin))
            wanted = self.level(axis, pin)
            self.set_pin(PinChange(counts, axis, pin, wanted if microsteps is None else level))
            self._pin_levels[axis, pin] = wanted
            if microsteps is not None:
                self._strapped.add((axis, pin))

    def change_capacitor(self, axis: int, osc_pf: float) -> None:
        """Change the capacitor at a chip's OSC for the pulses that are shown from now on."""
        self.drivers[axis].change_capacitor(osc_pf)

    def short(self, axis: int, counts: int, *, shorted: bool) -> None:
        """Short-circuit a motor from an instant on, or remove the short; all edges before must have been shown."""
        self.drivers[axis].chip.short(counts, shorted=shorted)

    def supply_voltage(self, counts: int, volt: int) -> None:
        """Set the motor supply from an instant on."""
        for driver in self.drivers:
            driver.chip.supply_voltage(counts, volt)

    @property
    def noisy_axes(self) -> set[int]:
        """Axes whose drivers may receive edges that the firmware has not made."""
        return {axis for axis, wires in enumerate(self._wires) if wires is not None and wires.noisy}

    def slip(self, axis: int, full_steps: int, counts: int) -> None:
        """Move an axis' rotor by full steps that the driver has not made."""
        self._slips[axis].append((counts, full_steps))
        self.slipped_full_steps[axis] += full_steps

    def follow_outputs(self) -> list[OutputFollower]:
        """Return an output follower for each chip; call this before the power is up."""
        return [driver.chip.follow_outputs() for driver in self.drivers]

    def cut_off(self, all_edges: Sequence[PinEdges], counts: int) -> list[PinEdges]:
        """Return the edges that remain at power-down: begun pulses end; STEP and DIR fall if high."""
        befores = zip(all_edges, self._step_levels, self._dir_levels, strict=True)
        return [_cut_off(edges, step_level, dir_level, counts) for edges, step_level, dir_level in befores]

    def cut_short(self, all_edges: Sequence[PinEdges], counts: int) -> list[PinEdges]:
        """Return the edges that remain at a reset of the processor: a begun pulse ends at that instant."""
        return [_cut_short(edges, counts) for edges in self.cut_off(all_edges, counts)]

    # --- out

    @property
    def pulse_min_counts(self) -> int:
        """Time after its rise when a pulse may be passed to any driver although it has not ended."""
        return max(driver.pulse_min_counts for driver in self.drivers)

    def count(self, axis: int) -> DriverMonitor:
        """Return the counts of an axis' driver over all passed pulses, and its present mode."""
        driver, wires = self.drivers[axis], self._wires[axis]
        lost_steps = driver.lost_steps + (wires.lost_steps if wires is not None else 0)
        return DriverMonitor(driver.chip.position_steps, lost_steps, driver.violation_count, driver.microsteps)

    def rotor_substeps(self, axis: int) -> int:
        """Return the position of an axis' rotor since power-up, in substeps."""
        driver = self.drivers[axis]
        return driver.chip.position_substeps + self.slipped_full_steps[axis] * driver.module.chip.substeps

    def trace(self, axis: int, until_counts: int) -> AxisTrace:
        """Return the record of an axis' driver since `forget`, up to an instant."""
        driver = self.drivers[axis]
        nothing = _pins(PinEdges([], []), [], until_counts)  # advances time if there are no edges
        self._feed(axis, nothing)
        pins = self._pins[axis]
        rises, falls = _whole_pulses(pins, until_counts)
        step_counts, step_signs = driver.steps
        return AxisTrace(
            clk_rise_counts=rises,
            clk_fall_counts=falls,
            active_edge=driver.module.active_edge,
            dir_counts=np.concatenate([p.dir_counts for p in pins]),
            dir_levels=np.concatenate([p.dir_levels for p in pins]),
            step_counts=step_counts,
            step_signs=step_signs,
            violations=driver.violations,
            outputs=driver.chip.outputs,
            substeps=driver.module.chip.substeps,
            position_steps=driver.chip.position_steps,
            position_full_steps=self.rotor_substeps(axis) / driver.module.chip.substeps,
            slip_counts=np.array([counts for counts, _ in self._slips[axis]], dtype=np.int64),
            slip_full_steps=np.array([full_steps for _, full_steps in self._slips[axis]], dtype=np.int64),
        )

    def forget(self, axis: int) -> None:
        """Drop the record of an axis; the next trace begins where the last one has ended."""
        self._pins[axis] = [_pins(PinEdges([], []), [], 0)]
        self._slips[axis].clear()
        self.drivers[axis].forget()


def _whole_pulses(pins: Sequence[TerminalEdges], until_counts: int) -> tuple[Int64Array, Int64Array]:
    """Return rises and falls of the pulses that begin in these stretches; one without end ends now."""
    rises = np.concatenate([p.clk_rise_counts for p in pins])
    falls = np.concatenate([p.clk_fall_counts for p in pins])
    if falls.size and not (rises.size and rises[0] < falls[0]):
        falls = falls[1:]
    if falls.size < rises.size:
        falls = np.append(falls, max(until_counts, int(rises[-1]) + 1))
    return rises, falls


def _pins(edges: PinEdges, changes: list[LevelChange], until_counts: int, step_level: int = 0) -> TerminalEdges:
    """Return the firmware's edges as terminal edges: STEP, initially at `step_level`, and DIR."""
    clk = _array(edges.clk_counts)
    direction = _array(edges.direction)
    return TerminalEdges(
        clk_rise_counts=clk[step_level::2],
        clk_fall_counts=clk[1 - step_level :: 2],
        dir_counts=direction >> 1,
        dir_levels=(direction & 1).astype(np.int8),
        changes=tuple(changes),
        until_counts=until_counts,
    )


def _cut_off(edges: PinEdges, step_level: int, dir_level: int, counts: int) -> PinEdges:
    """Return the pulses that begin before an instant; STEP and DIR, initially at these levels, fall if still high."""
    clk, direction = _array(edges.clk_counts), _array(edges.direction)
    direction = direction[direction >> 1 < counts]
    if direction[-1] & 1 if direction.size else dir_level:
        direction = np.append(direction, counts << 1)
    clk = clk[: step_level + 2 * int(np.searchsorted(clk[step_level::2], counts))]
    if (step_level + clk.size) % 2:
        clk = np.append(clk, max(counts, int(clk[-1]) + 1) if clk.size else counts)
    return PinEdges(clk, direction)


def _cut_short(edges: PinEdges, counts: int) -> PinEdges:
    clk = _array(edges.clk_counts)
    if clk.size and clk[-1] > counts:
        clk = np.append(clk[:-1], max(counts, int(clk[-2]) + 1) if clk.size > 1 else counts)
    return PinEdges(clk, edges.direction)


def _array(values: list[int] | Int64Array) -> NDArray[np.int64]:
    return np.asarray(values, dtype=np.int64)
