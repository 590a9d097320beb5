"""Vectors as three columns of numbers, combined with constant vectors whose zeros cost nothing.

Arms' axes mostly lie along the axes of their base. So a product with a constant leaves out its zeros, and takes a third
of the time of a product of arrays of shape (n, 3).
"""

from collections.abc import Sequence
from functools import reduce
from operator import add
from typing import NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray

Column = FloatArray
"""A component of vectors, of shape (n,)."""


class Vectors(NamedTuple):
    """The components of n vectors, each of shape (n,)."""

    x: Column
    y: Column
    z: Column


def constant(vector: FloatArray) -> tuple[float, ...]:
    """Return a constant vector without the dust of its computation: 6e-17 in place of 0 would cost time."""
    return tuple((np.round(vector, 15) + 0.0).tolist())


def weighted(weights: Sequence[float], values: Sequence[Column]) -> Column:
    """Return the sum of columns times numbers, without those that are 0."""
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
    """Rotations about a constant axis k: Rot v = v_k + c (v - v_k) + s (k x v), v_k being the part of v along k.

    Source: O. Rodrigues' formula, K. M. Lynch, F. C. Park, "Modern Robotics", equation 3.51.
    """

    def __init__(self, axis: FloatArray) -> None:
        x, y, z = axis.tolist()
        along = np.outer(axis, axis)
        self._along = [constant(row) for row in along]
        self._across = [constant(row) for row in np.eye(3) - along]
        self._beside = [constant(row) for row in np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])]

    def turned(self, vectors: Vectors, cosine: Column, sine: Column) -> Vectors:
        """Return vectors after rotations by angles of these cosines and sines, each of shape (n,)."""
        parts = ((mapped(rows, vectors), factor) for rows, factor in ((self._across, cosine), (self._beside, sine)))
        (across, c), (beside, s) = parts
        along = mapped(self._along, vectors)
        return Vectors(*(c * a + s * b + v for a, b, v in zip(across, beside, along, strict=True)))
