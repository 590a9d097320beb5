"""An image of an STM32F103 as what an emulated board runs: its pins' edges go to the drivers, switches to its pins."""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

from steptwin.controller.node.axis_context import BoardReadings
from steptwin.controller.node.pins import Pin, PinChange
from steptwin.emulator.board.board_firmware import FirmwareError
from steptwin.features.firmware.native_firmware import NativeFrames, NativeMotion
from steptwin.features.stm32.can_node import ImageStation
from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.engine import ChipSnapshot, Stm32Chip
from steptwin.features.stm32.image import FlashImage
from steptwin.features.stm32.kept_flash import KeptFlash
from steptwin.features.stm32.options import WiredAxis
from steptwin.features.stm32.outcome import fault_sentence
from steptwin.features.stm32.pin_log import PinLog
from steptwin.features.stm32.section import INPUTS, ChipPin, Stm32, analog_channel
from steptwin.features.stm32.serial_devices import SerialDevices
from steptwin.protocol.cia402 import DigitalInput, ErrorCode
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

if TYPE_CHECKING:
    from steptwin.emulator.board.board import Board
    from steptwin.emulator.board.local_clock import LocalClock

_AHEAD_COUNTS: Final = COUNTS_PER_MS // 40
"""Time by which the image runs ahead at once until a pulse is long enough for its driver."""
_SLICE_COUNTS: Final = 100 * COUNTS_PER_MS
"""Longest time that the compiled chip runs at once: Ctrl-C waits for its end."""
_DIR, _ENABLE = 1, 2
PINS: Final = 80
"""PA0 to PE15: 16 * port + number."""
_MODE_COUNTS, _RESET_COUNTS, _ENABLE_COUNTS = 1000, 3000, 4000
"""When the pins that no wire of the chip sets get their levels after power-up."""


class Debugger(Protocol):
    """A debugger of one chip."""

    def attend(self) -> None:
        """Do what the debugger's user asks, after each stretch of time; return when the processor may run on."""


class ImageFirmware:
    """An image from one power-up to the next."""

    def __init__(
        self,
        image: FlashImage,
        table: Stm32,
        axes: Sequence[WiredAxis],
        board: "Board",
        compiled: bool | None,
        flash: KeptFlash,
        devices: SerialDevices,
    ) -> None:
        """Wire a chip for a board; it begins with `boot`. For `compiled` see `Stm32Chip`."""
        self.image, self._table, self._drivers, self._compiled = image, table, board.drivers, compiled
        self._flash, self._devices, self._readings = flash, devices, board.measurements
        self.chip: Stm32Chip | None = None
        self.debugger: Debugger | None = None
        self.edges: PinLog = PinLog()
        self.motion: NativeMotion = NativeMotion(len(axes))
        self.transmit: NativeFrames = NativeFrames()
        self.can: ImageStation = ImageStation(self)
        self.clock: LocalClock | None = board.own_clock
        self.pins: list[PinChange] = []
        self.due_counts: int | None = None
        self._inputs: tuple[DigitalInput, ...] = (DigitalInput(0),) * len(axes)
        self._joints = [axis.pins for axis in axes]
        self._wires: dict[int, list[tuple[int, int, int]]] = {}
        """By number of a pin, what hangs there: axis, what it is, and whether it is inverted."""
        for axis, joint in enumerate(self._joints):
            for what, key in enumerate(("step", "dir", "enable")):
                if (pin := joint.pin(key)) is not None:
                    self._wires.setdefault(pin.number, []).append((axis, what, int(pin.inverted)))
        self._is_wired = np.zeros(PINS, np.bool_)
        self._is_wired[list(self._wires)] = True
        self._straps = self._strapped([axis.microsteps for axis in axes])

    def _strapped(self, microsteps: Sequence[int]) -> list[PinChange]:
        """Return the levels of the drivers' pins that no wire of the chip sets, in order of time after power-up."""
        straps: list[PinChange] = []
        for axis, (joint, driver) in enumerate(zip(self._joints, self._drivers.drivers, strict=True)):
            if driver.module.switches is None:
                levels = driver.module.chip.modes.value.levels(microsteps[axis])
                straps += (PinChange(_MODE_COUNTS, axis, Pin(name), level) for name, level in levels.items() if level)
                straps.append(PinChange(_RESET_COUNTS, axis, Pin.RESET, 1))
            if joint.pin("enable") is None:
                straps.append(PinChange(_ENABLE_COUNTS, axis, Pin.ENABLE, 1))
        return sorted(straps, key=lambda change: change.counts)

    @property
    def wired_pins(self) -> Collection[int]:
        """Pins to which drivers are wired: 16 * port + number."""
        return self._wires

    @property
    def next_due_counts(self) -> int | None:
        """Nothing is ever due: the chip's devices act while time passes."""
        return None

    def end(self) -> None:
        """Free the chip."""
        if self.chip is not None:
            self._flash.keep(self.chip)
            self.chip.close()

    def boot(self, now_counts: int) -> None:
        """Power up."""
        table = self._table
        self.chip = Stm32Chip(
            self._flash.power_up() + self.image.segments,
            self.image.vectors,
            flash_kb=table.flash_kb,
            ram_kb=table.ram_kb,
            crystal_hz=table.crystal_hz,
            main=self.image.address_of("main"),
            data_end=self.image.data_end,
            compiled=self._compiled,
        )
        for number in range(PINS):
            axis, what, inverted = self._wires.get(number, [(0, 0, 0)])[0]
            released = what == _ENABLE and self._drivers.drivers[axis].module.enable_open
            self.chip.watch(number, released=released != bool(inverted))
        self._straps = [change._replace(counts=now_counts + change.counts) for change in self._straps]
        self.motion.reached_counts = now_counts
        self._devices.connect(self.chip)
        self.chip.begin(now_counts)
        self.measure(self._readings.supply_10mv, self._readings.temperature_decidegc, now_counts)
        self._pass_inputs()
        for number in self._wires:
            self._take_level(now_counts, number, self.chip.level(number))

    # --- in

    def receive(self, frame: Frame, now_counts: int) -> None:
        """Frames come by `can`."""

    def hears(self, cob_id: int) -> bool:  # noqa: ARG002
        """Return False: frames come by `can`."""
        return False

    def on_can_error(self, code: ErrorCode, now_counts: int, *, active: bool) -> None:
        """Errors of the bus come by `can`."""

    def on_bus_off(self, now_counts: int) -> None:
        """So does bus-off."""

    def set_inputs(self, inputs: Sequence[DigitalInput], now_counts: int) -> None:  # noqa: ARG002
        """Set the levels of all inputs at the instant that the chip has reached."""
        self._inputs = tuple(inputs)
        self._pass_inputs()

    def _pass_inputs(self) -> None:
        if self.chip is None:
            return
        for joint, active in zip(self._joints, self._inputs, strict=True):
            for key, which in INPUTS.items():
                if (pin := joint.pin(key)) is not None:
                    self.chip.drive(pin.number, level=bool(active & which) != pin.inverted)

    def measure(self, supply_10mv: int, temperature_decidegc: int, now_counts: int) -> None:  # noqa: ARG002
        """Set what the ADC measures: the supply at its pin, and the chip's temperature, which is the board's."""
        self._readings = BoardReadings(supply_10mv, temperature_decidegc)
        if self.chip is None:
            return
        self.chip.set_temperature(temperature_decidegc / 10)
        table = self._table
        if table.supply and (channel := analog_channel(ChipPin.of(table.supply))) is not None:
            self.chip.set_voltage(channel, supply_10mv / 100 / table.supply_divider)

    # --- time forward

    def advance(self, until_counts: int) -> int:
        """Let time pass until then, or until an axis begins to move; return the instant reached."""
        motion = self.motion
        if self.chip is None:
            motion.reached_counts = max(motion.reached_counts, until_counts)
        while (chip := self.chip) is not None and motion.reached_counts < until_counts:
            starts = motion.starts
            slice_counts = _SLICE_COUNTS if self.debugger is None else COUNTS_PER_MS
            self._run(min(until_counts, motion.reached_counts + slice_counts))
            if motion.starts != starts or chip.cells[c.CAN_CHANGED]:
                break
        pulse_counts = self._drivers.pulse_min_counts
        while self.chip is not None and motion.begins_pulse(pulse_counts):
            self._run(motion.reached_counts + _AHEAD_COUNTS)
        return min(motion.reached_counts, until_counts)

    def poll(self, now_counts: int) -> None:
        """Let the bus know what the firmware has told its CAN controller."""
        self.can.follow(now_counts)

    def _run(self, until_counts: int) -> None:
        assert self.chip is not None
        self.chip.run(until_counts)
        if self.debugger is not None:
            self.debugger.attend()
        self._devices.raise_failure()
        counts, pins = self.chip.take_edges()
        self.edges.add(counts, pins)
        wired = self._is_wired[pins >> 1]
        for at, pin in zip(counts[wired].tolist(), pins[wired].tolist(), strict=True):
            self._take_level(at, pin >> 1, pin & 1)
        self.motion.reached_counts = max(self.chip.now_counts, self.motion.reached_counts)
        while self._straps and self._straps[0].counts <= self.motion.reached_counts:
            self.pins.append(self._straps.pop(0))
        self.motion.let_rest()
        self._flash.keep_if_locked(self.chip)
        if sentence := fault_sentence(self.chip, self.image):
            raise FirmwareError(f"{sentence}, at {self.chip.now_counts / COUNTS_PER_SECOND:.9f} s")

    def _take_level(self, counts: int, number: int, chip_level: int) -> None:
        for axis, what, inverted in self._wires[number]:
            level, pulses = chip_level ^ inverted, self.motion.axes[axis]
            if pulses.levels[what] == level:
                continue
            pulses.levels[what] = level
            if what == _ENABLE:
                self.pins.append(PinChange(counts, axis, Pin.ENABLE, level))
                continue
            self.motion.note(axis)
            pulses.moved_counts = counts
            if what == _DIR:
                pulses.direction.append(2 * counts + level)
            else:
                pulses.undrained_pulses += 1
                pulses.stepped_counts = max(counts, pulses.stepped_counts + 1)  # two edges within a count
                pulses.clk.append(pulses.stepped_counts)

    def snapshot(self) -> ChipSnapshot:
        """Return the chip's present state."""
        assert self.chip is not None
        return self.chip.snapshot()

    def restore(self, snapshot: ChipSnapshot) -> None:
        """Return the chip to a state, now: the machine stays as it is, and its inputs are read at once."""
        assert self.chip is not None
        before = [self.chip.level(pin) for pin in range(PINS)]
        self.chip.restore(snapshot)
        self._pass_inputs()
        now_counts = self.chip.now_counts
        changed = [pin for pin in range(PINS) if self.chip.level(pin) != before[pin]]
        levels = [2 * pin + self.chip.level(pin) for pin in changed]
        self.edges.add(np.full(len(changed), now_counts), np.array(levels, np.int64))
        for pin in changed:
            if pin in self._wires:
                self._take_level(now_counts, pin, self.chip.level(pin))

    def take_pins(self) -> list[PinChange]:
        """Return the pin changes since the last call."""
        pins, self.pins = self.pins, []
        return pins


class ImageProgram:
    """An image as the program of a board."""

    def __init__(
        self,
        image: FlashImage,
        table: Stm32,
        axes: Sequence[WiredAxis],
        compiled: bool | None = None,
        flash: Path | None = None,
        devices: SerialDevices | None = None,
    ) -> None:
        """Take an image for these axes; for `compiled` see `Stm32Chip`.

        The content of the flash is kept from one power-up to the next, and in the file `flash` if that is given.
        """
        self._image, self._table, self._axes, self._compiled = image, table, tuple(axes), compiled
        self._flash, self._devices = KeptFlash(flash), devices or SerialDevices()
        self._running: ImageFirmware | None = None

    def start(self, board: "Board") -> ImageFirmware:
        """Return the firmware that begins; the one before it ends."""
        if self._running is not None:
            self._running.end()
        self._running = ImageFirmware(
            self._image, self._table, self._axes, board, self._compiled, self._flash, self._devices
        )
        return self._running

    def connect(self, board: "Board") -> None:
        """Let the chip's CAN controller be the board's."""
        assert self._running is not None
        board.can = self._running.can
