"""What the machine around a board is like: the state that operations change, as data."""

from dataclasses import dataclass

from steptwin.protocol.cia402 import DigitalInput


@dataclass(frozen=True, slots=True)
class AxisSurroundings:
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
class Surroundings:
    """What is the same for all axes of a board, and each axis.

    Attributes:
        payload_kg: mass of the payload; 0 if no motors turn with the boards.
    """

    emergency_stop: bool
    supply_10mv: int
    temperature_decidegc: int
    axes: tuple[AxisSurroundings, ...]
    payload_kg: float = 0.0
