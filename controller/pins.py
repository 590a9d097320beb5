"""The pins that the firmware holds at a level; CLK and DIR come as edges (see `motion`)."""

from enum import Enum
from typing import NamedTuple

from steptwin.protocol.cia402 import DigitalOutput


class Pin(Enum):
    """One pin of an axis: inputs of its TB6560, or a digital output at its connector."""

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
    """A pin of one axis takes a level."""

    counts: int
    axis: int
    pin: Pin
    level: int


OUTPUT_PINS = {Pin.OUT1: DigitalOutput.OUT1, Pin.OUT2: DigitalOutput.OUT2}
"""The pins that follow object 0x60FE, with their bits in it."""

MODE_LEVELS = {1: (0, 0), 2: (0, 1), 8: (1, 1), 16: (1, 0)}
"""Levels of M2 and M1 by microsteps per full step (TB6560AHQ datasheet of 2014-10-01, page 9)."""
TORQUE_LEVELS = {100: (0, 0), 75: (0, 1), 50: (1, 0), 20: (1, 1)}
"""Levels of TQ2 and TQ1 by percent of the full current (page 10)."""
DECAY_LEVELS = {0: (0, 0), 25: (0, 1), 50: (1, 0), 100: (1, 1)}
"""Levels of DCY2 and DCY1 by percent of fast decay (page 10)."""
