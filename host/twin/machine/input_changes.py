"""Changes of a robot's digital inputs, by name, as operations; and operations as requests."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, NamedTuple, cast

from steptwin.controller.node.pins import Pin
from steptwin.emulator.operations import InputOperation, Operation
from steptwin.emulator.world.wires import InputWire, OutputWire
from steptwin.host.common.features import giving
from steptwin.host.operate.inputs_outputs import wired_input, wired_inputs
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.robot_boards import Places
from steptwin.protocol.cia402 import DigitalInput

_OUT_PINS = Pin.OUT1, Pin.OUT2
"""Pins of an axis' outputs, by number."""


class Wires:
    """Finds the board and the axis on it of an output or input."""

    def __init__(self, robot: Robot, axes_per_board: Sequence[int]) -> None:
        self._robot = robot
        self._places = Places(axes_per_board).axes

    def output(self, name: str) -> OutputWire:
        output = self._robot.outputs[name]
        return OutputWire(*self._places[self._robot.axis_index(output.joint)], _OUT_PINS[output.out - 1])

    def input(self, axis: int, which: DigitalInput) -> InputWire:
        return InputWire(*self._places[axis], which)


class InputChange(NamedTuple):
    """A change of an input `at_s` seconds of simulated time after the motion's start; at 0, before it."""

    name: str
    on: bool
    at_s: float


def set_input(robot: Robot, name: str, *, on: bool) -> InputOperation:
    """Return the operation that sets a robot's input; raise InputError for an unknown name."""
    return InputOperation(*wired_input(robot, name), on)


def request_of(robot: Robot, operation: Operation) -> dict[str, Any]:
    """Return an operation as its control port request, or as its fields if there is none."""
    if isinstance(operation, InputOperation):
        for name, wired in wired_inputs(robot).items():
            if wired == (operation.axis, operation.input):
                return {"do": "input", "input": name, "on": operation.on}
    for _, requests in giving("requests"):
        if (request := requests().written(robot, operation)) is not None:
            return dict(request)
    return {"do": type(operation).__name__, **asdict(cast("Any", operation))}
