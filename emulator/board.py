"""The emulated board: the firmware, its TB6560s, the wires between them and a record of what went over these."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.backend import Kernel
from controller.firmware import Firmware
from controller.motion import PinEdges
from controller.pins import OUTPUT_PINS, Pin, PinChange
from emulator.tb6560 import Int8Array, Int64Array, Pins, Tb6560, Violations
from protocol.dictionary import FlashPage
from protocol.frame import Frame


@dataclass(frozen=True, slots=True)
class BoardConfig:
    """What is soldered and plugged: how many axes, and the capacitor at each driver's OSC pin."""

    axis_count: int
    osc_pf: tuple[float, ...]


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
        self.firmware = Firmware(kernel, config.axis_count, self.flash)
        self._drivers = [Tb6560(osc_pf) for osc_pf in config.osc_pf]
        self._reset_pins: list[list[PinChange]] = [[] for _ in self._drivers]
        self._pins: list[list[Pins]] = [[] for _ in self._drivers]
        self.pin_changes: list[PinChange] = []
        """Every change of the pins that the firmware holds at a level."""

    def boot(self, now_counts: int) -> None:
        """Switch the board on."""
        self.firmware.boot(now_counts)

    def power_cycle(self, now_counts: int) -> None:
        """Switch the supply off and on: all pins fall, the firmware begins anew. Motors and clock stay as they are."""
        self._take_pins()
        levels = {(change.axis, change.pin): change.level for change in self.pin_changes}
        for (axis, pin), level in levels.items():
            if level:
                self._note_pin(PinChange(now_counts, axis, pin, 0))
        self.drain()
        self.firmware = Firmware(self._kernel, self.config.axis_count, self.flash)
        self.firmware.advance(now_counts)
        self.boot(now_counts)

    def receive(self, frame: Frame, now_counts: int) -> None:
        """A frame has arrived at the board's CAN controller."""
        self.firmware.receive(frame, now_counts)

    def advance(self, until_counts: int) -> int:
        """Let time pass; return the instant reached: earlier than asked for if there are frames to send."""
        reached = self.firmware.advance(until_counts)
        while reached < until_counts and self.firmware.motion.room_ticks == 0:
            self.drain()
            reached = self.firmware.advance(until_counts)
        return reached

    def poll(self, now_counts: int) -> None:
        """Let the firmware send what is due."""
        self.firmware.poll(now_counts)

    @property
    def next_due_counts(self) -> int | None:
        """When the firmware next does something by itself."""
        return self.firmware.next_due_counts

    def take_frames(self) -> list[Frame]:
        """Fetch the frames that the board wants to send now."""
        return self.firmware.take_frames()

    def drain(self) -> None:
        """Show the drivers all pulses placed so far."""
        self._take_pins()
        for axis, edges in enumerate(self.firmware.motion.take_edges()):
            pins = _pins(edges, self._reset_pins[axis])
            self._reset_pins[axis] = []
            self._drivers[axis].feed(pins)
            self._pins[axis].append(pins)

    def _take_pins(self) -> None:
        for change in self.firmware.take_pins():
            self._note_pin(change)

    def _note_pin(self, change: PinChange) -> None:
        self.pin_changes.append(change)
        if change.pin is Pin.RESET:
            self._reset_pins[change.axis].append(change)

    def output_changes(self) -> list[PinChange]:
        """Every change of a digital output so far, in order of time; all outputs are 0 before their first."""
        self.drain()
        return [change for change in self.pin_changes if change.pin in OUTPUT_PINS]

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


def _pins(edges: PinEdges, resets: list[PinChange]) -> Pins:
    """The wiring: the firmware's STEP goes to CLK, DIR to CW/CCW, RESET to RESET."""
    clk = _array(edges.clk_counts)
    direction = _array(edges.direction)
    return Pins(
        clk_rise_counts=clk[0::2],
        clk_fall_counts=clk[1::2],
        dir_counts=direction >> 1,
        dir_levels=(direction & 1).astype(np.int8),
        reset_counts=_array([change.counts for change in resets]),
        reset_levels=_array([change.level for change in resets]).astype(np.int8),
    )


def _array(values: list[int] | Int64Array) -> NDArray[np.int64]:
    return np.asarray(values, dtype=np.int64)
