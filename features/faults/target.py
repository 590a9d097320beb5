"""The machine that faults harm: its boards on their bus, with axes numbered as the robot's joints, and what they do."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

from steptwin.emulator.board.board import Board
from steptwin.emulator.simulation import Simulation
from steptwin.features.faults.kinds.bus import FrameLoss
from steptwin.features.faults.kinds.drivers import DriverMode, DriverProtect, OscCapacitor
from steptwin.features.faults.kinds.harm import Harm, Operation, Surroundings
from steptwin.features.faults.kinds.machine import Payload
from steptwin.host.common.errors import InputError
from steptwin.host.robots.board_settings import Microsteps
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, State, Status
from steptwin.protocol.drivers import ChipSheet, one_of


@dataclass(frozen=True, slots=True)
class AxisMoment:
    """One axis at an instant.

    Attributes:
        state: state of its drive.
        energised: whether the driver's outputs are on.
        velocity: demanded velocity in 1/64 unit per ms; 0 at rest.
        deceleration: of a stop after a fault, in units/s^2.
        position_known: whether the firmware says that it knows the position.
        lag_full_steps: what the firmware has counted less what the driver has counted;
            only its change means anything. None if it was not read.
        board: number of the axis' board.
        boot: object that a board replaces when it restarts, as after a reset: then it counts from 0 again.
        fault_input: the input by which the board sees the driver's fault output; None: none.
    """

    state: State
    energised: bool
    velocity: int
    deceleration: int
    position_known: bool
    lag_full_steps: float | None
    board: int = 0
    boot: object = field(default=None, repr=False)
    fault_input: DigitalInput | None = None

    @property
    def moving(self) -> bool:
        """True while the axis is to move."""
        return self.velocity != 0


@dataclass(frozen=True, slots=True)
class Moment:
    """All axes of the machine at an instant, in counts since power-up, and the bit rate for which its bus was made."""

    counts: int
    axes: tuple[AxisMoment, ...]
    bitrate: int

    @property
    def boards(self) -> tuple[int, ...]:
        """The number of each axis' board."""
        return tuple(axis.board for axis in self.axes)

    @property
    def moving(self) -> bool:
        """True while any axis is to move."""
        return any(axis.moving for axis in self.axes)

    @property
    def several_boards(self) -> bool:
        """True if the axes are on more than one board."""
        return len(set(self.boards)) > 1


def _axis_moment(board: Board, axis: int, number: int, *, counted: bool) -> AxisMoment:
    node, motion = board.firmware.nodes[axis], board.firmware.motion
    return AxisMoment(
        state=node.drive.state,
        energised=node.drive.energised,
        velocity=motion.axes[axis].velocity,
        deceleration=node.dictionary.get(od.QUICK_STOP_DECELERATION),
        position_known=bool(node.statusword() & Status.POSITION_KNOWN),
        lag_full_steps=_lag_full_steps(board, axis) if counted else None,
        board=number,
        boot=board.running,
        fault_input=board.drivers.drivers[axis].fault_input,
    )


def _lag_full_steps(board: Board, axis: int) -> float:
    """Return what the firmware has counted less what the driver has; pulses that a module still holds back count."""
    motion = board.firmware.motion
    position = board.position_full_steps(axis)  # the driver processes its pulses before it is asked for the held ones
    driver = board.drivers.drivers[axis]
    position += driver.held_steps / driver.microsteps
    return motion.axes[axis].counter_steps / motion.axes[axis].config.microsteps - position


def _firmwares_microsteps(board: Board, axis: int) -> int:
    """Return the microsteps that the firmware counts by; of another firmware only its driver's are known."""
    return board.firmware.motion.axes[axis].config.microsteps if board.runs_own else board.driver_microsteps(axis)


class Places:
    """Where each axis of a machine is: the number of its board, and its own number there."""

    def __init__(self, axes_per_board: Sequence[int]) -> None:
        """Note the number of axes on each board, in the order of the joints."""
        self._boards = range(len(axes_per_board))
        self.axes: tuple[tuple[int, int], ...] = tuple(
            (board, axis) for board, axes in enumerate(axes_per_board) for axis in range(axes)
        )

    def on_boards(self, operation: Operation) -> list[tuple[int, Operation]]:
        """Return an operation on the machine as operations on boards, each with the number of its board.

        One that names an axis is done on the board of this axis, one on the bus or at the tool once, any other on every
        board.
        """
        if operation.place is not None:
            board, axis = self.axes[operation.place]
            return [(board, operation.at(axis))]
        if operation.once:
            return [(0, operation)]
        return [(board, operation) for board in self._boards]

    def on_machine(self, board: int, operation: Operation) -> Operation | None:
        """Return an operation on a board as one on the machine: the reverse of `on_boards`.

        None: it is the one on another board than the first of an operation that is done on every board.
        """
        if operation.place is not None:
            return operation.at(self.axes.index((board, operation.place)))
        return operation if board == 0 else None


def check_motors(harm: Harm, *, turning: bool) -> None:
    """Raise InputError for a harm that only motors feel, unless they turn with the boards."""
    if isinstance(harm, Payload) and not turning:
        raise InputError(
            f"payload_kg: {harm.payload_kg:g} kg: only motors that turn with the board feel it:"
            " run --motors=loop, serve --motors, or MotorOptions in a test"
        )


def _check_chip(harm: DriverProtect | DriverMode | OscCapacitor, chip: ChipSheet) -> None:
    """Raise InputError if a driver's chip lacks the part, the pin or the mode that a harm concerns."""
    if isinstance(harm, OscCapacitor):
        if chip.oscillator is None:
            raise InputError(f"{chip.name} has no capacitor at OSC; a TB6560 has")
    elif isinstance(harm, DriverProtect):
        if chip.fault_output is None:
            raise InputError(f"{chip.name} has no pin that tells of a fault; a TB6560, a DRV8825 and Trinamic's have")
    elif harm.microsteps is not None:
        try:
            one_of(harm.microsteps, chip.microsteps, f"{chip.name}'s")
        except ValueError as error:
            raise InputError(f"microsteps: {error}") from error


class Target:
    """A robot's emulated machine: its boards in a simulation, with axes numbered as the robot's joints.

    Attributes:
        robot: the machine.
        simulation: its boards and their bus.
        start_steps: where its motors stood at power-up, in steps of the robot's file from their axes' zeros.
        places: where each axis is.
        axes: the board of each joint's axis, and the number of the axis there.
        board_numbers: the number of each axis' board.
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

    def check(self, harm: Harm) -> None:
        """Raise InputError unless the machine has what a harm concerns: motors that turn, a receiver, a chip's part."""
        check_motors(harm, turning=self.simulation.rotor_watch is not None)
        boards = len(self.simulation.boards)
        if isinstance(harm, FrameLoss) and harm.receiver is not None and harm.receiver > boards:
            raise InputError(f"receiver: {harm.receiver} is not from 0 to {boards}, the number of boards")
        if isinstance(harm, DriverProtect | DriverMode | OscCapacitor):
            board, axis = self.axes[harm.axis]
            _check_chip(harm, board.drivers.drivers[axis].module.chip)

    def harm(self, harm: Harm) -> None:
        """Execute an operation now, or let a fault of the bus begin, or end all of them; raises as `check`."""
        self.check(harm)
        if isinstance(harm, Operation):
            self.operate(harm)
        else:
            harm.apply(self.simulation, 0)

    def operate(self, operation: Operation) -> None:
        """Execute an operation now: on the board of its axis, on the bus, at the tool, else on every board."""
        for number, each in self.places.on_boards(operation):
            self.simulation.operate(each, number)

    def moment(self, uncounted: Collection[int] = ()) -> Moment:
        """Return what all axes do now.

        The drivers of the axes in `uncounted` are not asked: to answer they process the pulses of the whole servo tick,
        which a reset within it must still be able to take back.
        """
        return Moment(
            self.simulation.now_counts,
            tuple(
                _axis_moment(board, axis, self.board_numbers[number], counted=number not in uncounted)
                for number, (board, axis) in enumerate(self.axes)
            ),
            self.simulation.bus.bitrate,
        )

    def steps(self) -> list[float]:
        """Return the position of each motor by the steps that its driver has made, from the joint's zero.

        It is in steps of the robot's file, a whole number of them unless the driver makes others.
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
    def surroundings(self) -> Surroundings:
        """What the machine is like now; what all axes of a board share is the same for all boards."""
        around = [board.surroundings for board in self.simulation.boards]
        axes, watch = tuple(axis for each in around for axis in each.axes), self.simulation.rotor_watch
        return replace(around[0], axes=axes, payload_kg=0.0 if watch is None else watch.payload_kg)
