"""Changes of a robot's digital inputs, by their names in its file, as operations on an emulated board."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from steptwin.controller.node.pins import Pin
from steptwin.emulator.faults.operations import BusOperation, Operation, Payload, PlacedOperation, SetInput
from steptwin.emulator.world.shelf_watch import InputWire, OutputWire
from steptwin.host.common.bad_input import unknown
from steptwin.host.operate.input_waiting import wired_inputs
from steptwin.host.robots.robot import Robot
from steptwin.protocol.cia402 import DigitalInput

_OUT_PINS = Pin.OUT1, Pin.OUT2
"""The pins of an axis' outputs, in the order of their numbers."""


class Wires:
    """Finds the board and the axis on it of an output or input."""

    def __init__(self, robot: Robot, axes_per_board: Sequence[int]) -> None:
        self._robot = robot
        self._places = [(board, axis) for board, count in enumerate(axes_per_board) for axis in range(count)]

    def output(self, name: str) -> OutputWire:
        output = self._robot.outputs[name]
        return OutputWire(*self._places[self._robot.index_of(output.joint)], _OUT_PINS[output.out - 1])

    def input(self, axis: int, which: DigitalInput) -> InputWire:
        return InputWire(*self._places[axis], which)


class Places:
    """Where each axis of a machine is: the number of its board, and its own number there."""

    def __init__(self, axes_per_board: Sequence[int]) -> None:
        """Note the number of axes on each board, in the order of the joints."""
        self._boards = range(len(axes_per_board))
        self._places = [(board, axis) for board, axes in enumerate(axes_per_board) for axis in range(axes)]

    def on_boards(self, operation: Operation) -> list[tuple[int, Operation]]:
        """Return an operation on the machine as operations on boards, each with the number of its board.

        One that names an axis is done on the board of this axis, one on the bus or at the tool once, any other on every
        board.
        """
        if isinstance(operation, PlacedOperation) and operation.axis is not None:
            board, axis = self._places[operation.axis]
            return [(board, replace(operation, axis=axis))]
        if isinstance(operation, BusOperation | Payload):
            return [(0, operation)]
        return [(board, operation) for board in self._boards]

    def on_machine(self, board: int, operation: Operation) -> Operation | None:
        """Return an operation on a board as one on the machine: the reverse of `on_boards`.

        None: it is the one on another board than the first of an operation that is done on every board.
        """
        if isinstance(operation, PlacedOperation) and operation.axis is not None:
            return replace(operation, axis=self._places.index((board, operation.axis)))
        return operation if board == 0 else None


class InputChange(NamedTuple):
    """An input changes its level `at_s` seconds of simulated time after the motion's start; at 0 it has it before."""

    name: str
    on: bool
    at_s: float


def set_input(robot: Robot, name: str, *, on: bool) -> SetInput:
    """Return the operation that sets a robot's input on its one board; raise InputError for an unknown name."""
    wired = wired_inputs(robot)
    if name not in wired:
        raise unknown(f"input of {robot.name}", name, wired)
    axis, which = wired[name]
    return SetInput(axis, which, on)
