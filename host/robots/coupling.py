"""The coupling of a robot's joints: axis positions = matrix x joint positions.

A motor on the base that drives a later joint by a belt turns with the earlier joints. An axis position is that of the
motor before the transmission's ratio, in the unit of the joint with the axis' name.

A joint may have a second motor, as the beam of a gantry has one at each end. Its axis has a row like that of the
joint's own axis; axes of second motors follow those of all joints. Then the matrix has more rows than columns, and a
joint is at the mean of its two motors, which is the least squares solution.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import add
from typing import Final, Self

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError

Matrix = tuple[tuple[float, ...], ...]

CONDITION_MAX: Final = 1000.0
"""Largest condition number of the matrix: the factor by which a rounding error of the axes may grow at the joints."""
_ROUNDING: Final = 1e-12
"""Fraction of the largest element below which an element of the inverse is a rounding error and set to 0."""


@dataclass(frozen=True, slots=True)
class Coupling:
    """Coupling of axes and joints; without matrices, each joint has a motor of its own.

    Attributes:
        matrix: rows by axis, columns by joint; an element is in the axis' unit per unit of the joint.
        inverse: rows by joint, columns by axis; the matrix' pseudo-inverse.
        seconds: joints with a second motor, in the order of these motors' axes.
    """

    matrix: Matrix = ()
    inverse: Matrix = ()
    seconds: tuple[int, ...] = ()

    @classmethod
    def of(cls, names: Sequence[str], rows: Mapping[str, Mapping[str, float]]) -> Self:
        """Return the coupling with these elements by axis and joint; others are 1 on the diagonal and 0 elsewhere.

        Raises:
            InputError: an unknown joint; the matrix is singular or nearly so; an axis does not move its joint forward.
        """
        cls.check_names(names, rows)
        matrix = np.eye(len(names))
        for axis, row in rows.items():
            for joint, element in row.items():
                matrix[names.index(axis), names.index(joint)] = element
        if np.array_equal(matrix, np.eye(len(names))):
            return cls()
        _check_condition(matrix)
        inverse = np.asarray(np.linalg.inv(matrix), np.float64)
        inverse[np.abs(inverse) < _ROUNDING * np.abs(inverse).max()] = 0.0
        for i, name in enumerate(names):
            if not (matrix[i, i] > 0 and inverse[i, i] > 0):
                raise InputError(
                    f"{name}: the joint alone moves its axis by {matrix[i, i]:g}, and the axis alone its joint by"
                    f" {inverse[i, i]:g}; limit switches and homing need both above 0: change the signs of the row and"
                    " turn the motor round, or exchange axes"
                )
        return cls(_rows(matrix), _rows(inverse))

    @staticmethod
    def check_names(names: Sequence[str], rows: Mapping[str, Iterable[str]]) -> None:
        """Raise InputError, with a message for each, if axes or the joints in their rows are unknown."""
        axes = [unknown("axis", axis, names) for axis in rows if axis not in names]
        joints = [
            unknown(f"{axis}: joint", joint, names) for axis, row in rows.items() for joint in row if joint not in names
        ]
        if strange := axes + joints:
            raise InputError(*map(str, strange))

    def with_second_motors(self, joints: int, seconds: Sequence[int]) -> Self:
        """Return this coupling of a number of joints with second motors of some of them added."""
        if not seconds:
            return self
        matrix, inverse = (np.array(own) if own else np.eye(joints) for own in (self.matrix, self.inverse))
        rows = [*range(joints), *seconds]
        shares = np.eye(joints)[:, rows] / np.bincount(rows)[rows]
        return replace(self, matrix=_rows(matrix[rows]), inverse=_rows(inverse @ shares), seconds=tuple(seconds))

    @property
    def joint_count(self) -> int:
        """Number of joints; 0 if each joint has a motor of its own and nothing is coupled."""
        return len(self.inverse)

    def joint_of(self, axis: int) -> int:
        """Return the joint of an axis' motor: the one with its name, or the one that it helps to drive."""
        second = axis - self.joint_count
        return self.seconds[second] if self.seconds and second >= 0 else axis

    def motors_of(self, joint: int) -> tuple[int, ...]:
        """Return the axes of a joint's motors: its own, and that of its second motor if it has one."""
        return (joint, *(self.joint_count + at for at, driven in enumerate(self.seconds) if driven == joint))

    def skews(self, axes: FloatArray) -> FloatArray:
        """Return the lead of each second motor's end of its joint, from axis positions of shape (..., axes).

        The result has the shape (..., second motors), in the joints' units.
        """
        if not self.seconds:
            return axes[..., :0]
        halves = [self.inverse[joint][self.joint_count + at] for at, joint in enumerate(self.seconds)]
        return 2 * np.array(halves) * (axes[..., self.joint_count :] - axes[..., list(self.seconds)])

    def to_axes(self, joints: FloatArray) -> FloatArray:
        """Return the positions, speeds or distances of the axes from those of the joints, shape (..., joints)."""
        return _times(self.matrix, joints) if self.matrix else joints

    def to_joints(self, axes: FloatArray) -> FloatArray:
        """Return the positions, speeds or distances of the joints from those of the axes, shape (..., axes)."""
        return _times(self.inverse, axes) if self.inverse else axes

    def axes_moved_by(self, joint: int) -> dict[int, float]:
        """Return the axes that move with one joint while the others are still, each with its distance per unit."""
        if not self.matrix:
            return {joint: 1.0}
        return {axis: row[joint] for axis, row in enumerate(self.matrix) if row[joint]}

    def own_element(self, axis: int) -> float:
        """Return the distance of an axis for one unit of its own joint alone."""
        return self.joints_of(axis)[self.joint_of(axis)]

    def joints_of(self, axis: int) -> dict[int, float]:
        """Return the joints that determine an axis' position, each with its element."""
        return _elements(self.matrix, axis)

    def axes_of(self, joint: int) -> dict[int, float]:
        """Return the axes that determine a joint's position, each with its element of the inverse."""
        return _elements(self.inverse, joint)

    def travel_of(self, axis: int) -> dict[int, float]:
        """Return the axes that determine an axis' joint at this motor's end: as `axes_of`, without its second motor."""
        elements = self.axes_of(self.joint_of(axis))
        motors = self.motors_of(self.joint_of(axis))
        own = {axis: sum(elements[motor] for motor in motors)}
        return dict(sorted((own | {other: each for other, each in elements.items() if other not in motors}).items()))

    def couples(self, axis: int) -> bool:
        """Return whether an axis' position differs from its joint's."""
        return bool(self.matrix) and self.joints_of(axis) != {self.joint_of(axis): 1.0}

    def homing_levels(self, joints: int) -> list[list[int]]:
        """Return groups of joints that can be homed together, in order; `joints` is their number.

        The home of an axis depends on the other joints of its row, so these are homed before. Joints that depend on
        each other, as in a CoreXY, are groups of their own, in their order.
        """
        levels: list[list[int]] = []
        waiting = set(range(joints))
        while waiting:
            level = [joint for joint in sorted(waiting) if waiting & self.joints_of(joint).keys() == {joint}]
            free = (
                self.mutual(joint) for joint in sorted(waiting) if waiting & self._reach(joint) <= self.mutual(joint)
            )
            levels += [level] if level else [[joint] for joint in sorted(next(free))]
            waiting -= {joint for level in levels for joint in level}
        return levels

    def _reach(self, joint: int) -> set[int]:
        """Return the joints that determine the position of a joint's axis, also through the axes of others."""
        found, ahead = set[int](), [joint]
        while ahead:
            found.add(here := ahead.pop())
            ahead += self.joints_of(here).keys() - found
        return found

    def mutual(self, joint: int) -> set[int]:
        """Return the joints that depend on a joint as it depends on them, with itself."""
        return {other for other in self._reach(joint) if joint in self._reach(other)}

    def homing_axes(self, joint: int) -> dict[int, float]:
        """Return the axes that move when a joint is homed, each with its distance per unit of the joint.

        These are its motors, and those of mutually dependent joints, which are kept still. Joints that depend on it,
        but it not on them, turn along.
        """
        mutual = self.mutual(joint)
        return {axis: way for axis, way in self.axes_moved_by(joint).items() if self.joint_of(axis) in mutual}


def _check_condition(matrix: FloatArray) -> None:
    condition = float(np.linalg.cond(matrix))
    if not condition <= CONDITION_MAX:
        singular = not condition < 1 / np.finfo(float).eps
        fault = "is singular" if singular else f"has the condition number {condition:.4g}"
        raise InputError(
            f"the matrix {fault}, so the axes hardly say where the joints are; up to {CONDITION_MAX:g} is right"
        )


def _rows(matrix: FloatArray) -> Matrix:
    return tuple(tuple(row) for row in matrix.tolist())


def _elements(matrix: Matrix, row: int) -> dict[int, float]:
    return {column: element for column, element in enumerate(matrix[row]) if element} if matrix else {row: 1.0}


def _times(matrix: Matrix, positions: FloatArray) -> FloatArray:
    """Multiply the last dimension by a matrix, term by term: the rounding of a row is independent of the others."""
    columns = [
        reduce(add, (element * positions[..., column] for column, element in _elements(matrix, row).items()))
        for row in range(len(matrix))
    ]
    return np.stack(columns, axis=-1)
