"""What the machine is doing at an instant: each axis' drive, its speed, and what firmware and driver have counted."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from steptwin.emulator.board.board import Board
from steptwin.protocol import od
from steptwin.protocol.cia402 import State, Status


@dataclass(frozen=True, slots=True)
class AxisMoment:
    """One axis at an instant.

    Attributes:
        state: state of its drive.
        energised: whether the driver's outputs are on.
        velocity: demanded velocity in 1/64 unit per ms; 0 at rest.
        deceleration: of a stop after a fault, in units/s^2.
        position_known: whether the firmware says that it knows the position.
        lag_sixteenths: what the firmware has counted less what the driver has counted, in sixteenths of a full step;
            only its change means anything. None if it was not read.
        board: number of the axis' board.
        boot: object that a board replaces when it restarts, as after a reset: then it counts from 0 again.
    """

    state: State
    energised: bool
    velocity: int
    deceleration: int
    position_known: bool
    lag_sixteenths: int | None
    board: int = 0
    boot: object = field(default=None, repr=False)

    @property
    def moving(self) -> bool:
        """True while the axis is to move."""
        return self.velocity != 0


@dataclass(frozen=True, slots=True)
class Moment:
    """All axes of the machine at an instant, in counts since power-up."""

    counts: int
    axes: tuple[AxisMoment, ...]

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


def moment_of(axes: Sequence[tuple[Board, int]], now_counts: int, uncounted: Collection[int] = ()) -> Moment:
    """Look at axes, each given by its board and its number there.

    The drivers of the axes in `uncounted` are not asked: to answer they process the pulses of the whole servo tick,
    which a reset within it must still be able to take back.
    """
    boards = list(dict.fromkeys(board for board, _ in axes))
    return Moment(
        now_counts,
        tuple(
            _axis_moment(board, axis, boards.index(board), counted=number not in uncounted)
            for number, (board, axis) in enumerate(axes)
        ),
    )


def _axis_moment(board: Board, axis: int, number: int, *, counted: bool) -> AxisMoment:
    node, motion = board.firmware.nodes[axis], board.firmware.motion
    return AxisMoment(
        state=node.drive.state,
        energised=node.drive.energised,
        velocity=motion.velocity(axis),
        deceleration=node.dictionary.get(od.QUICK_STOP_DECELERATION),
        position_known=bool(node.statusword() & Status.POSITION_KNOWN),
        lag_sixteenths=_lag_sixteenths(board, axis) if counted else None,
        board=number,
        boot=board.firmware,
    )


def _lag_sixteenths(board: Board, axis: int) -> int:
    motion, driver_sixteenths = board.firmware.motion, board.position_sixteenths(axis)
    return motion.counter_steps(axis) * 16 // motion.config(axis).microsteps - driver_sixteenths
