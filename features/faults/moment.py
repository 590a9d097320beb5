"""State of all axes of a machine at an instant, by its boards: when a fault begins, and at the end of a run."""

from collections.abc import Collection
from dataclasses import dataclass, field

from steptwin.emulator.board.board import Board
from steptwin.host.twin.machine.robot_boards import RobotBoards
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, State, Status


@dataclass(frozen=True, slots=True)
class AxisMoment:
    """One axis at an instant.

    Attributes:
        state: state of its drive.
        energised: True if the driver's outputs are on.
        velocity: demanded velocity in 1/64 unit per ms; 0 at rest.
        deceleration: of a stop after a fault, in units/s^2.
        position_known: True if the firmware reports that it knows the position.
        lag_full_steps: firmware's count minus driver's count; only its change is meaningful. None if it was not read.
        board: number of the axis' board.
        boot: object that a board replaces when it restarts, as after a reset: then it counts from 0 again.
        fault_input: the board's input for the driver's fault output; None: none.
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


@dataclass(frozen=True, slots=True)
class Moment:
    """All axes of the machine at an instant, in counts since power-up, and the nominal bit rate of its bus."""

    counts: int
    axes: tuple[AxisMoment, ...]
    bitrate: int

    @property
    def boards(self) -> tuple[int, ...]:
        """Number of each axis' board."""
        return tuple(axis.board for axis in self.axes)

    @property
    def several_boards(self) -> bool:
        """True if the axes are on more than one board."""
        return len(set(self.boards)) > 1


def _axis_moment(board: Board, axis: int, number: int, *, counted: bool) -> AxisMoment:
    node, motion, driver = board.firmware.nodes[axis], board.firmware.motion.axes[axis], board.drivers.drivers[axis]
    lag_full_steps = None
    if counted:  # the driver processes its pulses before its module reports those that it still holds back
        position_full_steps = board.position_full_steps(axis) + driver.held_steps / driver.microsteps
        lag_full_steps = motion.counter_steps / motion.config.microsteps - position_full_steps
    return AxisMoment(
        state=node.drive.state,
        energised=node.drive.energised,
        velocity=motion.velocity,
        deceleration=node.dictionary.get(od.QUICK_STOP_DECELERATION),
        position_known=bool(node.statusword() & Status.POSITION_KNOWN),
        lag_full_steps=lag_full_steps,
        board=number,
        boot=board.running,
        fault_input=driver.fault_input,
    )


def moment_of(machine: RobotBoards, uncounted: Collection[int] = ()) -> Moment:
    """Return the present state of all axes; of boards with another firmware there is none to be read.

    Drivers of the axes in `uncounted` are not read: reading processes the pulses of the whole servo tick, and a reset
    within the tick must still be able to cancel them.
    """
    return Moment(
        machine.simulation.now_counts,
        tuple(
            _axis_moment(board, axis, machine.board_numbers[number], counted=number not in uncounted)
            for number, (board, axis) in enumerate(machine.axes)
            if board.runs_own
        ),
        machine.simulation.bus.bitrate,
    )
