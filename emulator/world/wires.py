"""Name the output or input of a board to which a device beside the boards is wired."""

from typing import NamedTuple

from steptwin.controller.node.pins import Pin
from steptwin.protocol.cia402 import DigitalInput


class OutputWire(NamedTuple):
    """Output to which a device is wired: number of the board, axis on it, pin."""

    board: int
    axis: int
    pin: Pin


class InputWire(NamedTuple):
    """Input to which a sensor is wired: number of the board, axis on it, input."""

    board: int
    axis: int
    input: DigitalInput
