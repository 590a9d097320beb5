"""The environment of a board: the signals at its inputs and sensors."""

from dataclasses import dataclass
from typing import Final

from steptwin.protocol.cia402 import DigitalInput

PER_V: Final = 100
PER_DEGC: Final = 10
"""Units per V and per degC in which the board measures."""


@dataclass(frozen=True, slots=True)
class AxisEnvironment:
    """Signals at one axis' connector.

    Attributes:
        levels: active inputs; a closed switch sets its bit.
        stuck: switches held at a level, regardless of the position.
        protect_held: True while the driver's Protect pin is held low externally.
        shorted: True while the motor has a short circuit.
    """

    levels: DigitalInput
    stuck: DigitalInput
    protect_held: bool
    shorted: bool = False


@dataclass(frozen=True, slots=True)
class BoardEnvironment:
    """The environment of one board.

    Attributes:
        emergency_stop: True while the e-stop input is active.
        supply_10mv: motor supply.
        temperature_decidegc: board temperature.
        axes: signals at each axis' connector.
        bitrate: bit rate of the board's CAN controller, in bit/s; None for a board without bus.
        payload_kg: mass of the payload; 0 without motors in the loop.
        torque_off: True while safe torque off (STO) is requested.
    """

    emergency_stop: bool
    supply_10mv: int
    temperature_decidegc: int
    axes: tuple[AxisEnvironment, ...]
    bitrate: int | None
    payload_kg: float = 0.0
    torque_off: bool = False
