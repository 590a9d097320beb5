"""A box around the machine, such as a table or a drawer: pictures show it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from math import hypot
from typing import Annotated, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileTable
from steptwin.host.common.file_values import Values

TOUCH_MM: Final = 1.0
"""Distance from a box where the tool still touches it."""

Range = tuple[float, float]
_Ends = Annotated[Range, Values("a box has two ends: [from, to]")]
TipAt = Callable[[FloatArray], FloatArray]
"""Returns the tool's positions, shape (n, 3) in mm, at instants of shape (n,) in seconds."""


@dataclass(frozen=True, slots=True)
class Box(FileTable):
    """A box with its sides along the world's axes.

    Attributes:
        x_mm: its ends along x; likewise y_mm and z_mm.
        held_by: the output that holds it at the tool; empty for a box that stands still.

    Raises:
        InputError: an end is not above the other.
    """

    x_mm: _Ends
    y_mm: _Ends
    z_mm: _Ends
    held_by: str = ""

    def __post_init__(self) -> None:
        for key in ("x_mm", "y_mm", "z_mm"):
            low_mm, high_mm = getattr(self, key)
            if not low_mm < high_mm:
                raise InputError(f"{key}: {high_mm:g} mm is not above {low_mm:g} mm")

    @property
    def edges_mm(self) -> FloatArray:
        """Its twelve edges, shape (12, 2, 3)."""
        corners = list(product(self.x_mm, self.y_mm, self.z_mm))
        pairs = [(a, b) for n, a in enumerate(corners) for b in corners[n + 1 :]]
        return np.array([pair for pair in pairs if sum(x != y for x, y in zip(*pair, strict=True)) == 1])

    def touched_by(self, point_mm: FloatArray) -> bool:
        """Return whether a point, shape (3,), is in the box or at most TOUCH_MM from it along each axis."""
        ends_mm = np.array([self.x_mm, self.y_mm, self.z_mm])
        return bool((point_mm >= ends_mm[:, 0] - TOUCH_MM).all() and (point_mm <= ends_mm[:, 1] + TOUCH_MM).all())

    def nearest_on_line(self, first_mm: Sequence[float], second_mm: Sequence[float]) -> tuple[float, float]:
        """Return the distance of the box from the line between two points, and the place on the line nearest to it.

        The distance is 0 where the line meets the box. The place goes from 0 at the first point to 1 at the second.
        The square of the distance is convex along the line, and a parabola between the places where the line
        crosses the planes of the box's faces: so the zero of its slope is exact.
        """
        ends_mm = self.x_mm, self.y_mm, self.z_mm
        way_mm = [second - first for first, second in zip(first_mm, second_mm, strict=True)]

        def outside_mm(along: float) -> list[float]:
            at_mm = (first + along * way for first, way in zip(first_mm, way_mm, strict=True))
            return [min(at - low, 0.0) + max(at - high, 0.0) for at, (low, high) in zip(at_mm, ends_mm, strict=True)]

        def slope(along: float) -> float:
            return sum(way * out for way, out in zip(way_mm, outside_mm(along), strict=True))

        crossings = (
            (end - first) / way
            for first, way, pair in zip(first_mm, way_mm, ends_mm, strict=True)
            if way
            for end in pair
        )
        places = sorted({0.0, 1.0, *(along for along in crossings if 0.0 < along < 1.0)})
        after = next((i for i, along in enumerate(places) if slope(along) >= 0.0), len(places) - 1)
        nearest = places[after]
        if after and slope(nearest) > 0.0:
            low, high = places[after - 1], places[after]
            nearest = low + (high - low) * slope(low) / (slope(low) - slope(high))
        return hypot(*outside_mm(nearest)), nearest

    def shifts_mm(self, t_s: FloatArray, holds_s: Sequence[Range], tip_at: TipAt) -> FloatArray:
        """Return how far the tool has moved the box at instants of shape (n,), shape (n, 3).

        Args:
            t_s: the instants.
            holds_s: first and last instant of each time for which the output `held_by` was on, in order.
            tip_at: the tool's positions.
        """
        shifts_mm, shifted_mm = np.zeros((len(t_s), 3)), np.zeros(3)
        for from_s, to_s in holds_s:
            taken_mm, left_mm = tip_at(np.array([from_s, to_s]))
            if not self.touched_by(taken_mm - shifted_mm):
                continue
            since = t_s >= from_s
            shifts_mm[since] = shifted_mm + tip_at(np.minimum(t_s[since], to_s)) - taken_mm
            shifted_mm = shifted_mm + left_mm - taken_mm
        return shifts_mm
