"""The emulated board: the firmware, its TB6560s, the wires between them and a record of what went over these."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.backend import Kernel
from controller.firmware import Firmware
from controller.kernel import TICK_COUNTS
from controller.motion import PinEdges
from controller.pins import OUTPUT_PINS, Pin, PinChange
from emulator.can_controller import CanController
from emulator.driver import Driver
from emulator.driver_module import Module
from emulator.edges import Int8Array, Int64Array
from emulator.tb6560 import Input, LevelChange, Outputs, Pins, Violations
from protocol.cia402 import ErrorCode
from protocol.dictionary import FlashPage
from protocol.frame import FIRST_NODE_ID, Frame

WIRING = {
    Pin.RESET: Input.RESET,
    Pin.ENABLE: Input.ENABLE,
    Pin.M1: Input.M1,
    Pin.M2: Input.M2,
    Pin.TQ1: Input.TQ1,
    Pin.TQ2: Input.TQ2,
    Pin.DCY1: Input.DCY1,
    Pin.DCY2: Input.DCY2,
}
"""From the firmware's pins to the driver's; besides, STEP goes to CLK and DIR to CW/CCW."""

SUPPLIES = (Input.VDD, Input.VM)
"""In the order in which the board switches them on."""


@dataclass(frozen=True, slots=True)
class BoardConfig:
    """What is soldered, plugged and set: how many axes, the capacitor at each driver's OSC pin, the node ids."""

    axis_count: int
    osc_pf: tuple[float, ...]
    first_node_id: int = FIRST_NODE_ID
    """The first axis' node id; the others count on from it."""
    read_latency_counts: int = 0
    """How long after its arrival the processor fetches a message from the CAN controller: by default at once."""
    modules: tuple[Module, ...] = ()
    """What is around each chip; none for chips on the board itself."""


@dataclass(frozen=True, slots=True)
class AxisTrace:
    """Everything that happened at one driver, times in counts since boot; DIR levels are those after each edge."""

    clk_rise_counts: Int64Array
    clk_fall_counts: Int64Array
    dir_counts: Int64Array
    dir_levels: Int8Array
    step_counts: Int64Array
    step_signs: Int8Array
    violations: Violations
    position_steps: int


class Board:
    """One board on the bus. Pulses are computed ahead in batches; the drivers look at them when somebody looks."""

    def __init__(self, config: BoardConfig, kernel: Kernel, flash: list[FlashPage] | None = None) -> None:
        """A board fresh from the factory, or with what another one had in its flash."""
        self.config = config
        self.flash: list[FlashPage] = [{} for _ in range(config.axis_count)] if flash is None else flash
        """What the firmware has stored, a page for each axis: all that outlives the power."""
        self._kernel = kernel
        self._power_up()
        modules = config.modules or (Module(),) * config.axis_count
        self._drivers = [Driver(osc_pf, module) for osc_pf, module in zip(config.osc_pf, modules, strict=True)]
        self._input_changes: list[list[LevelChange]] = [[] for _ in self._drivers]
        self._pins: list[list[Pins]] = [[] for _ in self._drivers]
        self.pin_changes: list[PinChange] = []
        """Every change of the pins that the firmware holds at a level."""

    def _power_up(self) -> None:
        """Firmware and CAN controller as they are with power."""
        self.firmware = Firmware(self._kernel, self.config.axis_count, self.flash, self.config.first_node_id)
        self.can = CanController(
            self._receive, self._on_can_error, self.firmware.hears, self.config.read_latency_counts
        )
        """The CAN controller; what it says to the bus it says in `poll`."""
        self._due_counts: int | None = None
        self._due_known = False

    def boot(self, now_counts: int) -> None:
        """Switch the board on: its nodes announce themselves."""
        self._supply(SUPPLIES, now_counts, 1)
        self.firmware.boot(now_counts)
        self.poll(now_counts)

    def power_cycle(self, now_counts: int) -> None:
        """Switch the supply off and on: all pins fall, the firmware begins anew. Motors and clock stay as they are.

        `can` is another one afterwards, which nobody has attached to the bus yet.
        """
        self._take_pins()
        self._supply(reversed(SUPPLIES), now_counts, 0)
        levels = {(change.axis, change.pin): change.level for change in self.pin_changes}
        for (axis, pin), level in levels.items():
            if level:
                self._note_pin(PinChange(now_counts, axis, pin, 0))
        self.drain()
        self._power_up()
        self.firmware.advance(now_counts)
        self.boot(now_counts)

    def _receive(self, frame: Frame, now_counts: int) -> None:
        self.firmware.receive(frame, now_counts)
        self._due_known = False

    def _on_can_error(self, code: ErrorCode, now_counts: int, *, active: bool) -> None:
        self.firmware.on_can_error(code, now_counts, active=active)
        self._due_known = False

    @property
    def moving(self) -> bool:
        """Whether a motion runs at any axis."""
        return any(self.firmware.motion.running(axis) for axis in range(self.config.axis_count))

    def advance(self, until_counts: int) -> int:
        """Let time pass; return the instant reached: earlier than asked for if there are frames to send."""
        motion = self.firmware.motion
        tick = motion.tick
        if until_counts <= tick * TICK_COUNTS and not motion.has_events:
            return until_counts  # within a tick that is computed already
        reached = self.firmware.advance(until_counts)
        while reached < until_counts and motion.room_ticks == 0:
            self.drain()
            reached = self.firmware.advance(until_counts)
        if motion.tick != tick:
            self._due_known = False
        return reached

    def poll(self, now_counts: int) -> None:
        """Let the processor do what is due: fetch messages, then send."""
        if self.can.next_due_counts is not None:
            self.can.poll(now_counts)
        due_counts = self._firmware_due_counts
        if due_counts is not None and due_counts <= now_counts:
            self.firmware.poll(now_counts)
            self._due_known = False
        for frame in self.firmware.take_frames():
            self.can.send(frame, now_counts)

    @property
    def next_due_counts(self) -> int | None:
        """When the board next does something by itself."""
        due_counts = self._firmware_due_counts
        read_counts = self.can.next_due_counts
        if read_counts is None or (due_counts is not None and due_counts < read_counts):
            return due_counts
        return read_counts

    @property
    def _firmware_due_counts(self) -> int | None:
        """Asked far more often than it changes."""
        if not self._due_known:
            self._due_counts = self.firmware.next_due_counts
            self._due_known = True
        return self._due_counts

    def drain(self) -> None:
        """Show the drivers all pulses placed so far."""
        self._take_pins()
        until_counts = self.firmware.motion.tick * TICK_COUNTS
        for axis, edges in enumerate(self.firmware.motion.take_edges()):
            pins = _pins(edges, self._input_changes[axis], until_counts)
            self._input_changes[axis] = []
            self._drivers[axis].feed(pins)
            self._pins[axis].append(pins)

    def _take_pins(self) -> None:
        for change in self.firmware.take_pins():
            self._note_pin(change)

    def _note_pin(self, change: PinChange) -> None:
        self.pin_changes.append(change)
        if change.pin in WIRING:
            self._input_changes[change.axis].append(LevelChange(change.counts, WIRING[change.pin], change.level))

    def _supply(self, supplies: Iterable[Input], now_counts: int, level: int) -> None:
        for supply in supplies:
            for changes in self._input_changes:
                changes.append(LevelChange(now_counts, supply, level))

    def output_changes(self) -> list[PinChange]:
        """Every change of a digital output so far, in order of time; all outputs are 0 before their first."""
        self.drain()
        return [change for change in self.pin_changes if change.pin in OUTPUT_PINS]

    def protect_level(self, axis: int, now_counts: int) -> int:
        """The Protect pin of an axis' driver, pulled up: low while thermal shutdown keeps its outputs off."""
        self.drain()
        return self._drivers[axis].protect_level(now_counts)

    def outputs(self, axis: int) -> Outputs:
        """Phase currents, electrical angle and MO of an axis' driver, at any instant so far."""
        self.drain()
        return self._drivers[axis].outputs

    def trace(self, axis: int) -> AxisTrace:
        """Everything that happened at an axis' driver so far."""
        self.drain()
        driver = self._drivers[axis]
        pins = self._pins[axis]
        step_counts, step_signs = driver.steps
        return AxisTrace(
            clk_rise_counts=np.concatenate([p.clk_rise_counts for p in pins]),
            clk_fall_counts=np.concatenate([p.clk_fall_counts for p in pins]),
            dir_counts=np.concatenate([p.dir_counts for p in pins]),
            dir_levels=np.concatenate([p.dir_levels for p in pins]),
            step_counts=step_counts,
            step_signs=step_signs,
            violations=driver.violations,
            position_steps=driver.position_steps,
        )


def _pins(edges: PinEdges, changes: list[LevelChange], until_counts: int) -> Pins:
    clk = _array(edges.clk_counts)
    direction = _array(edges.direction)
    return Pins(
        clk_rise_counts=clk[0::2],
        clk_fall_counts=clk[1::2],
        dir_counts=direction >> 1,
        dir_levels=(direction & 1).astype(np.int8),
        changes=tuple(changes),
        until_counts=until_counts,
    )


def _array(values: list[int] | Int64Array) -> NDArray[np.int64]:
    return np.asarray(values, dtype=np.int64)
