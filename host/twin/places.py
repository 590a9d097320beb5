"""Place operations on the boards of a machine, whose axes are numbered as the robot's joints: on each board from 0."""

from collections.abc import Sequence
from dataclasses import replace

from steptwin.emulator.operations import BusOperation, Operation, Payload, PlacedOperation


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
