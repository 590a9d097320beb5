"""Pins that the firmware sets to a level. (`motion` makes the edges of CLK and DIR.)"""

from enum import StrEnum
from typing import NamedTuple

from steptwin.protocol.cia402 import DigitalOutput


class Pin(StrEnum):
    """A pin of one axis: an input of its TB6560, or a digital output at its connector."""

    RESET = "RESET"
    ENABLE = "ENABLE"
    M1 = "M1"
    M2 = "M2"
    TQ1 = "TQ1"
    TQ2 = "TQ2"
    DCY1 = "DCY1"
    DCY2 = "DCY2"
    OUT1 = "OUT1"
    OUT2 = "OUT2"


class PinChange(NamedTuple):
    """A change of one pin's level, at an instant in timer counts since boot."""

    counts: int
    axis: int
    pin: Pin
    level: int


OUTPUT_PINS = {Pin.OUT1: DigitalOutput.OUT1, Pin.OUT2: DigitalOutput.OUT2}
"""Digital output pins, and their bits in the digital outputs object (60FEh)."""

MODE_LEVELS = {1: (0, 0), 2: (0, 1), 8: (1, 1), 16: (1, 0)}
"""Levels of M2 and M1 by microsteps per full step (TB6560AHQ datasheet of 2014-10-01, page 9)."""
TORQUE_LEVELS = {100: (0, 0), 75: (0, 1), 50: (1, 0), 20: (1, 1)}
"""Levels of TQ2 and TQ1 by percent of the full current (page 10)."""
DECAY_LEVELS = {0: (0, 0), 25: (0, 1), 50: (1, 0), 100: (1, 1)}
"""Levels of DCY2 and DCY1 by percent of fast decay (page 10)."""


class AxisPins:
    """Levels of one axis' pins, and the changes that the firmware has not fetched yet."""

    def __init__(self) -> None:
        self._levels = dict.fromkeys(Pin, 0)
        self.changes: list[tuple[Pin, int]] = []

    def level(self, pin: Pin) -> int:
        """Return the level of a pin."""
        return self._levels[pin]

    def set(self, pin: Pin, level: int) -> None:
        """Set a pin to a level."""
        if self._levels[pin] != level:
            self._levels[pin] = level
            self.changes.append((pin, level))

    def switch_outputs(self, outputs: int) -> None:
        """Set the digital outputs (60FEh) in any drive state. Faults do not reset them: a gripper keeps its load."""
        for pin, bit in OUTPUT_PINS.items():
            self.set(pin, int(bool(outputs & bit)))
