"""Names of the outputs and inputs of a board to which external devices are wired."""

from typing import NamedTuple

from steptwin.controller.node.pins import Pin
from steptwin.protocol.cia402 import DigitalInput


class OutputWire(NamedTuple):
    """Output to which a device is wired: number of the board, axis, pin."""

    board: int
    axis: int
    pin: Pin


class InputWire(NamedTuple):
    """Input to which a sensor is wired: number of the board, axis, input."""

    board: int
    axis: int
    input: DigitalInput
