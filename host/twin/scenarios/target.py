"""The machine that a scenario harms: its boards on their bus, with the axes numbered as the robot's joints."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

from steptwin.emulator.board.board import Board
from steptwin.emulator.faults.bus_faults import BusFault
from steptwin.emulator.faults.operations import Operation
from steptwin.emulator.simulation import Simulation
from steptwin.emulator.world.surroundings import Surroundings
from steptwin.host.common.errors import InputError
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.boards import axes_of, counted_steps
from steptwin.host.twin.machine.input_changes import Places
from steptwin.host.twin.scenarios.harms import BusRepair, Harm, check_motors
from steptwin.host.twin.scenarios.moment import Moment, moment_of


@dataclass(frozen=True, slots=True)
class Target:
    """A robot's boards in a simulation.

    Attributes:
        robot: the machine.
        simulation: its boards and their bus.
        start_steps: where its motors stood at power-up, in steps of the robot's file from their axes' zeros.
        axes: board of each joint, and the number of its axis there.
        places: the same by the boards' numbers.
    """

    robot: Robot
    simulation: Simulation
    start_steps: Sequence[int]
    axes: tuple[tuple[Board, int], ...]
    places: Places = field(repr=False)

    @classmethod
    def of(cls, robot: Robot, simulation: Simulation, start_steps: Sequence[int]) -> "Target":
        """Return the target with the axes of all boards in order."""
        boards = simulation.boards
        places = Places([board.config.axis_count for board in boards])
        return cls(robot, simulation, start_steps, tuple(axes_of(boards)), places)

    def check(self, harm: Harm) -> None:
        """Raise InputError unless the machine has what a harm concerns: motors that turn with it, a receiver."""
        check_motors(harm, turning=self.simulation.rotor_watch is not None)
        boards = len(self.simulation.boards)
        if isinstance(harm, BusFault) and harm.receiver is not None and harm.receiver > boards:
            raise InputError(f"receiver: {harm.receiver} is not from 0 to {boards}, the number of boards")

    def harm(self, harm: Operation | BusFault | BusRepair) -> None:
        """Execute an operation now, or let a fault of the bus begin, or end all of them; raises as `check`."""
        self.check(harm)
        match harm:
            case BusFault():
                self.simulation.bus.faults.begin(harm)
            case BusRepair():
                self.simulation.repair_bus()
            case _:
                self.operate(harm)

    def operate(self, operation: Operation) -> None:
        """Execute an operation now: on the board of its axis, on the bus, at the tool, else on every board."""
        for number, each in self.places.on_boards(operation):
            self.simulation.operate(each, number)

    def moment(self, now_counts: int, uncounted: Collection[int] = ()) -> Moment:
        """Return what all axes do now, as `moment_of`."""
        return moment_of(self.axes, now_counts, uncounted)

    def steps(self) -> list[float]:
        """Return where the motors are by their drivers' counts, in steps of the robot's file from their axes' zeros."""
        return counted_steps(self.robot, self.start_steps, self.axes)

    @property
    def boards(self) -> list[int]:
        """The number of each axis' board."""
        return [self.simulation.boards.index(board) for board, _ in self.axes]

    @property
    def moving(self) -> bool:
        """True while a motor moves or may still reach a switch."""
        return any(board.moving for board in self.simulation.boards)

    @property
    def interpolating(self) -> bool:
        """True while an axis executes a motion."""
        return any(board.firmware.motion.running(axis) for board, axis in self.axes)

    @property
    def surroundings(self) -> Surroundings:
        """What the machine is like now; what all axes of a board share is the same for all boards."""
        around = [board.surroundings for board in self.simulation.boards]
        axes, watch = tuple(axis for each in around for axis in each.axes), self.simulation.rotor_watch
        return replace(around[0], axes=axes, payload_kg=0.0 if watch is None else watch.payload_kg)
