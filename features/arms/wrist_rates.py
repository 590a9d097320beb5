"""Joint speeds of an arm with a spherical wrist, in closed form.

Axes 4, 5 and 6 pass through the wrist's point w and do not move it. So its velocity comes from axes 1 to 3 alone, and
the wrist turns the rest of the tool's rotation. Seen from link 1, where k2 and k3 are parallel:

    v . k2 = q1' (k1 x (w - r1)) . k2                              axes 2 and 3 move w across k2 only
    v - q1' k1 x (w - r1) = q2' k2 x (w - r2) + q3' k3 x (w - r3)  two equations in the plane across k2

and seen from link 4, with the remaining rotation u, k5 in the plane of k4 and f4, and n = Rot(k5, q5) k6:

    u = q4' k4 + q5' k5 + q6' n                                    first along g4, then along f4, then along k4

Source: D. L. Pieper, "The kinematics of manipulators under computer control", Stanford 1968: arm and wrist, and their
velocities, are solved one after the other.

Vectors are three columns of numbers. The axes of most arms lie along those of their base, so products with constant
vectors skip zeros and take a third of the time of arrays of shape (n, 3).
"""

from collections.abc import Sequence
from functools import reduce
from operator import add
from typing import NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.serial.chain_geometry import ArmAxes

Column = FloatArray
"""A component of n vectors, of shape (n,)."""


class Vectors(NamedTuple):
    """The components of n vectors, each of shape (n,)."""

    x: Column
    y: Column
    z: Column


def constant(vector: FloatArray) -> tuple[float, ...]:
    """Return a constant vector without rounding errors: 6e-17 in place of 0 would cost time."""
    return tuple((np.round(vector, 15) + 0.0).tolist())


def weighted(weights: Sequence[float], values: Sequence[Column]) -> Column:
    """Return the weighted sum of columns; zero weights are skipped."""
    terms = [
        value if weight == 1.0 else -value if weight == -1.0 else weight * value
        for weight, value in zip(weights, values, strict=True)
        if weight
    ]
    return reduce(add, terms) if terms else np.zeros(1)


def mapped(rows: Sequence[Sequence[float]], vectors: Sequence[Column]) -> Vectors:
    """Return the products of a constant matrix of shape (3, k) with k columns."""
    return Vectors(*(weighted(row, vectors) for row in rows))


class ConstantAxis:
    """Rotations about a constant axis k: Rot v = v_k + c (v - v_k) + s (k x v); v_k is the part of v along k.

    Source: O. Rodrigues' formula, K. M. Lynch, F. C. Park, "Modern Robotics", equation 3.51.
    """

    def __init__(self, axis: FloatArray) -> None:
        x, y, z = axis.tolist()
        along = np.outer(axis, axis)
        self._along = [constant(row) for row in along]
        self._across = [constant(row) for row in np.eye(3) - along]
        self._beside = [constant(row) for row in np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])]

    def turned(self, vectors: Vectors, cosine: Column, sine: Column) -> Vectors:
        """Return vectors after rotations by angles with these cosines and sines, each of shape (n,)."""
        parts = ((mapped(rows, vectors), factor) for rows, factor in ((self._across, cosine), (self._beside, sine)))
        (across, c), (beside, s) = parts
        along = mapped(self._along, vectors)
        return Vectors(*(c * a + s * b + v for a, b, v in zip(across, beside, along, strict=True)))


class WristRates:
    """Joint speeds of one arm; made by `wrist_rates`.

    Args:
        axes: the arm's axes at zero; `why_not` of the closed form must be empty for them.
        wrist_mm: shape (3,), the point through which axes 4, 5 and 6 pass, at zero.
    """

    def __init__(self, axes: ArmAxes, wrist_mm: FloatArray) -> None:
        k, r = axes.directions, axes.points_mm
        self._turns = [ConstantAxis(axis) for axis in k]
        self._back = ConstantAxis(-k[0])
        self._k1, self._k2 = _fixed(k[0]), _fixed(k[1])
        self._k3 = 1.0 if k[1] @ k[2] > 0.0 else -1.0
        self._shoulder, self._upper, self._fore, self._hand = (
            _fixed(vector) for vector in (r[1] - r[0], r[2] - r[1], wrist_mm - r[2], axes.home_mm - wrist_mm)
        )
        ahead = np.cross(k[1], k[0])
        f = ahead / np.linalg.norm(ahead)
        self._plane = [constant(v) for v in (f, np.cross(k[1], f), k[1])]
        beside = k[4] - (k[3] @ k[4]) * k[3]
        f4 = beside / np.linalg.norm(beside)
        self._wrist = [constant(v) for v in (k[3], f4, np.cross(k[3], f4))]
        self._five_along, self._five_across = float(k[3] @ k[4]), float(f4 @ k[4])
        self._six = _fixed(k[5])

    def of(self, joints: FloatArray, moves_mm: FloatArray, turns: FloatArray) -> tuple[FloatArray, Column]:
        """Return joint speeds of shape (n, 6), in rad/s, and the Jacobian's determinant in mm^3, of shape (n,).

        Speeds are not finite where the determinant is 0. Arguments are in the base's frame, of shape (n, columns):

        Args:
            joints: the six joints in rad.
            moves_mm: the tool's velocity in mm/s.
            turns: the tool's angular velocity in rad/s.
        """
        cosine, sine = np.cos(joints.T), np.sin(joints.T)
        both = joints[:, 1] + self._k3 * joints[:, 2]
        arm = np.cos(both), np.sin(both)
        hand = self._hand
        for i in (5, 4, 3):
            hand = self._turns[i].turned(hand, cosine[i], sine[i])
        hand, fore = (self._turns[1].turned(vector, *arm) for vector in (hand, self._fore))
        out = _sum(self._turns[1].turned(self._upper, cosine[1], sine[1]), fore)
        velocity, turning = (
            self._back.turned(Vectors(*np.ascontiguousarray(each.T)), cosine[0], sine[0]) for each in (moves_mm, turns)
        )
        velocity = _sum(velocity, _cross(hand, turning))  # the wrist is at -hand from the tool
        around = _cross(self._k1, _sum(self._shoulder, out))
        with np.errstate(divide="ignore", invalid="ignore"):
            q1, q2, q3, arm_det = self._arm_rates(*(self._in_plane(v) for v in (velocity, around, out, fore)))
            left = _sum(turning, _times(-q1, self._k1), _times(-(q2 + self._k3 * q3), self._k2))
            left = self._turns[1].turned(left, arm[0], -arm[1])
            n = self._turns[4].turned(self._six, cosine[4], sine[4])
            q4, q5, q6, wrist_det = self._wrist_rates(left, n, cosine[3], sine[3])
        return np.stack(np.broadcast_arrays(q1, q2, q3, q4, q5, q6), axis=1), arm_det * wrist_det

    def _in_plane(self, vectors: Vectors) -> Vectors:
        """Return the components of vectors along f, g and k2."""
        return Vectors(*(weighted(row, vectors) for row in self._plane))

    def _arm_rates(
        self, velocity: Vectors, around: Vectors, out: Vectors, fore: Vectors
    ) -> tuple[Column, Column, Column, Column]:
        """Return the speeds of axes 1 to 3, and the determinant of their Jacobian."""
        q1 = velocity.z / around.z
        u_f, u_g = velocity.x - q1 * around.x, velocity.y - q1 * around.y
        det = self._k3 * (fore.y * out.x - fore.x * out.y)
        q2 = self._k3 * (u_f * fore.x + u_g * fore.y) / det
        return q1, q2, -(u_f * out.x + u_g * out.y) / det, around.z * det

    def _wrist_rates(self, left: Vectors, n: Vectors, c4: Column, s4: Column) -> tuple[Column, Column, Column, Column]:
        """Return the speeds of axes 4 to 6 for the remaining rotation, and the determinant of their axes."""
        along, across, beside = (weighted(row, left) for row in self._wrist)
        n_along, n_across, n_beside = (weighted(row, n) for row in self._wrist)
        q6 = (c4 * beside - s4 * across) / n_beside
        q5 = (c4 * across + s4 * beside - q6 * n_across) / self._five_across
        return along - q5 * self._five_along - q6 * n_along, q5, q6, n_beside * self._five_across


def _fixed(vector: FloatArray) -> Vectors:
    """Return a constant vector as columns of one row."""
    return Vectors(*(np.array([component]) for component in constant(vector)))


def _sum(*vectors: Vectors) -> Vectors:
    return Vectors(*(sum(parts[1:], parts[0]) for parts in zip(*vectors, strict=True)))


def _times(factor: Column, vector: Vectors) -> Vectors:
    return Vectors(*(factor * component for component in vector))


def _cross(first: Sequence[Column], second: Sequence[Column]) -> Vectors:
    (a, b, c), (x, y, z) = first, second
    return Vectors(b * z - c * y, c * x - a * z, a * y - b * x)
