"""The space that a run takes: what a picture of it must hold."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.path_error import PathError
from steptwin.host.record.recorded_machine import RecordedMachine
from steptwin.host.robots.kinematics import Link, Role


@dataclass(frozen=True, slots=True, eq=False)
class ShownBox:
    """A box at some instants: its edges, shape (12, 2, 3), and how far it has moved, shape (instants, 3)."""

    name: str
    edges_mm: FloatArray
    shifts_mm: FloatArray

    @property
    def moves(self) -> bool:
        """True if the tool moves it."""
        return bool(self.shifts_mm.any())


def shown_boxes(machine: RecordedMachine, times_s: FloatArray) -> tuple[ShownBox, ...]:
    """Return the boxes around a machine at times of its motion, shape (instants,)."""
    return tuple(
        ShownBox(name, machine.robot.boxes[name].edges_mm, shifts_mm)
        for name, shifts_mm in machine.box_shifts_mm(times_s).items()
    )


def extent_mm(parts: Iterable[Link], boxes: Iterable[ShownBox], path: PathError, gain: float) -> FloatArray:
    """Return the points that pictures must hold, shape (n, 3), all of them finite.

    A mechanism that its counts pull apart has no place. Guides that are longer than all that moves, such as a rail,
    are left out, and boxes unless one of them moves.

    Args:
        parts: the machine's parts at some instants.
        boxes: the boxes around it at the same instants.
        path: the tool's path, and its error.
        gain: factor by which the error is magnified.
    """
    parts, boxes = tuple(parts), tuple(boxes)
    moving = [part.points_mm.reshape(-1, 3) for part in parts if part.role is not Role.GUIDE]
    shown = _finite(np.concatenate([*moving, path.planned_mm, path.counted_mm(gain)]))
    size_mm = np.linalg.norm(np.ptp(shown, axis=0))
    guides = [part.points_mm for part in parts if part.role is Role.GUIDE]
    short = [points.reshape(-1, 3) for points in guides if _length_mm(points) <= size_mm]
    drawn = boxes if any(box.moves for box in boxes) else ()
    corners = [(box.edges_mm + shift).reshape(-1, 3) for box in drawn for shift in _extremes(box.shifts_mm)]
    return _finite(np.concatenate([shown, *short, *corners]))


def _finite(points_mm: FloatArray) -> FloatArray:
    return points_mm[np.isfinite(points_mm).all(axis=1)]


def _length_mm(points_mm: FloatArray) -> float:
    """Return the distance between the ends of a part, the greatest of all instants."""
    return float(np.linalg.norm(points_mm[:, -1] - points_mm[:, 0], axis=1).max())


def _extremes(shifts_mm: FloatArray) -> FloatArray:
    return np.array([shifts_mm.min(axis=0), shifts_mm.max(axis=0)])
