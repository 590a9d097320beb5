"""Describe what the machine around a board is like: what its inputs and its sensors are given."""

from dataclasses import dataclass
from typing import Final

from steptwin.protocol.cia402 import DigitalInput

PER_V: Final = 100
PER_DEGC: Final = 10
"""The board measures in these parts of a volt and of a degree."""


@dataclass(frozen=True, slots=True)
class AxisEnvironment:
    """What one axis' connector is like.

    Attributes:
        levels: inputs that are active; for a closed switch its bit is set.
        stuck: switches that are held at their level wherever the axis stands.
        protect_held: True while the driver's Protect pin is held low from outside.
        shorted: True while the motor is short-circuited.
    """

    levels: DigitalInput
    stuck: DigitalInput
    protect_held: bool
    shorted: bool = False


@dataclass(frozen=True, slots=True)
class BoardEnvironment:
    """What is the same for all axes of a board, and each axis.

    Attributes:
        bitrate: of the board's CAN controller, in bit/s; None for a board without bus.
        payload_kg: mass of the payload; 0 if no motors turn with the boards.
    """

    emergency_stop: bool
    supply_10mv: int
    temperature_decidegc: int
    axes: tuple[AxisEnvironment, ...]
    bitrate: int | None
    payload_kg: float = 0.0
