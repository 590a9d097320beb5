"""What the machine is doing at an instant: each axis' drive, its speed, and what firmware and driver have counted."""

from collections.abc import Sequence
from dataclasses import dataclass

from steptwin.emulator.board import Board
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
            only its change means anything.
    """

    state: State
    energised: bool
    velocity: int
    deceleration: int
    position_known: bool
    lag_sixteenths: int

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
    def moving(self) -> bool:
        """True while any axis is to move."""
        return any(axis.moving for axis in self.axes)


def moment_of(axes: Sequence[tuple[Board, int]], now_counts: int) -> Moment:
    """Look at axes, each given by its board and its number there."""
    return Moment(now_counts, tuple(_axis_moment(board, axis) for board, axis in axes))


def _axis_moment(board: Board, axis: int) -> AxisMoment:
    node, motion = board.firmware.nodes[axis], board.firmware.motion
    driver_sixteenths = board.position_sixteenths(axis)
    step_sixteenths = 16 // motion.config(axis).microsteps
    return AxisMoment(
        state=node.drive.state,
        energised=node.drive.energised,
        velocity=motion.velocity(axis),
        deceleration=node.dictionary.get(od.QUICK_STOP_DECELERATION),
        position_known=bool(node.statusword() & Status.POSITION_KNOWN),
        lag_sixteenths=motion.counter_steps(axis) * step_sixteenths - driver_sixteenths,
    )
