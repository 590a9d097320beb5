"""A robot's boards on their bus: places of axes, positions of motors, and operations on the machine."""

from collections.abc import Sequence
from dataclasses import replace

from steptwin.emulator.board.board import Board
from steptwin.emulator.board.environment import BoardEnvironment
from steptwin.emulator.operations import Operation
from steptwin.emulator.simulation import Simulation
from steptwin.host.robots.board_settings import Microsteps
from steptwin.host.robots.robot import Robot


def _firmwares_microsteps(board: Board, axis: int) -> int:
    """Return the microsteps of the firmware's counts; for another firmware, those of its driver."""
    return board.firmware.motion.axes[axis].config.microsteps if board.runs_own else board.driver_microsteps(axis)


class Places:
    """Place of each axis of a machine: the number of its board, and its own number there."""

    def __init__(self, axes_per_board: Sequence[int]) -> None:
        """Note the number of axes on each board, in the order of the joints."""
        self._boards = range(len(axes_per_board))
        self.axes: tuple[tuple[int, int], ...] = tuple(
            (board, axis) for board, axes in enumerate(axes_per_board) for axis in range(axes)
        )

    def on_boards(self, operation: Operation) -> list[tuple[int, Operation]]:
        """Convert an operation on the machine to operations on boards, each with the number of its board.

        An operation on an axis is executed on its board, one on the bus or at the tool once, any other on every board.
        """
        if operation.place is not None:
            board, axis = self.axes[operation.place]
            return [(board, operation.at(axis))]
        if operation.once:
            return [(0, operation)]
        return [(board, operation) for board in self._boards]

    def on_machine(self, board: int, operation: Operation) -> Operation | None:
        """Convert an operation on a board to one on the machine: the reverse of `on_boards`.

        None for copies, on further boards, of an operation that is executed on every board.
        """
        if operation.place is not None:
            return operation.at(self.axes.index((board, operation.place)))
        return operation if board == 0 else None


class RobotBoards:
    """A robot's boards in a simulation, with axes numbered as the robot's joints.

    Attributes:
        robot: the machine.
        simulation: its boards and their bus.
        start_steps: motor positions at power-up, in steps of the robot's file from their axes' zeros.
        places: place of each axis.
        axes: board of each joint's axis, and the number of the axis there.
        board_numbers: number of each axis' board.
    """

    def __init__(self, robot: Robot, simulation: Simulation, start_steps: Sequence[int]) -> None:
        self.robot = robot
        self.simulation = simulation
        self.start_steps = start_steps
        self.places: Places = Places([board.config.axis_count for board in simulation.boards])
        self.axes: tuple[tuple[Board, int], ...] = tuple(
            (simulation.boards[number], axis) for number, axis in self.places.axes
        )
        self.board_numbers: list[int] = [number for number, _ in self.places.axes]

    def check(self, operation: Operation) -> None:
        """Raise InputError if the machine lacks the target of an operation."""
        for number, each in self.places.on_boards(operation):
            each.check(self.simulation, number)

    def operate(self, operation: Operation) -> None:
        """Execute an operation now: on the board of its axis, on the bus, at the tool, or on every board.

        Raises:
            InputError: the machine lacks its target.
        """
        self.check(operation)
        for number, each in self.places.on_boards(operation):
            self.simulation.operate(each, number)

    def steps(self) -> list[float]:
        """Return the position of each motor by the steps of its driver, from the joint's zero.

        It is in steps of the robot's file, a whole number of them if the driver makes the same steps.
        """
        return [
            start + board.position_full_steps(axis) * joint.transmission.microsteps
            for start, joint, (board, axis) in zip(self.start_steps, self.robot.axes, self.axes, strict=True)
        ]

    def microsteps(self) -> list[Microsteps]:
        """Return the microsteps per full step of each axis: its driver's, its board's and its robot file's."""
        return [
            Microsteps(
                joint.name,
                board.driver_microsteps(axis),
                _firmwares_microsteps(board, axis),
                joint.transmission.microsteps,
            )
            for joint, (board, axis) in zip(self.robot.axes, self.axes, strict=True)
        ]

    @property
    def moving(self) -> bool:
        """True while a motor moves or may still reach a switch."""
        return any(board.moving for board in self.simulation.boards)

    @property
    def interpolating(self) -> bool:
        """True while an axis executes a motion."""
        return any(board.motion.axes[axis].running for board, axis in self.axes)

    @property
    def environment(self) -> BoardEnvironment:
        """Present environment of the machine; values common to all axes of a board are those of all boards."""
        around = [board.environment for board in self.simulation.boards]
        axes, watch = tuple(axis for each in around for axis in each.axes), self.simulation.rotor_watch
        return replace(around[0], axes=axes, payload_kg=0.0 if watch is None else watch.payload_kg)
