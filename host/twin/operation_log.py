"""Note what is done to a machine beside its bus, as requests of the control port with their instants."""

from dataclasses import replace
from typing import Any

from steptwin.emulator.operations import AxisOperation, Operation, Scheduled
from steptwin.emulator.simulation import Simulation
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.boards import axes_of
from steptwin.host.twin.control.operations import request_of
from steptwin.protocol.timer import COUNTS_PER_SECOND


class OperationLog:
    """Every operation on the machine of a simulation from now on; it takes the place of an older one."""

    def __init__(self, robot: Robot, simulation: Simulation) -> None:
        self._robot = robot
        self._boards = simulation.boards
        self._axes = axes_of(simulation.boards)
        self._done: list[Scheduled] = []
        simulation.on_operation = self._done.append

    def requests(self) -> list[dict[str, Any]]:
        """Return the operations under the keys of docs/control-port.md, with `at_s` in seconds since power-up."""
        return [
            {"at_s": counts / COUNTS_PER_SECOND} | request_of(self._robot, self._on_machine(operation, number))
            for counts, operation, number in self._done
            if isinstance(operation, AxisOperation) or number == 0  # any other is done at every board
        ]

    def _on_machine(self, operation: Operation, number: int) -> Operation:
        """Return an operation with its axis numbered among all boards'."""
        if isinstance(operation, AxisOperation):
            return replace(operation, axis=self._axes.index((self._boards[number], operation.axis)))
        return operation
