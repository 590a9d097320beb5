"""The fastest motion along a path from rest to rest within rows of limits: time-optimal path parametrisation.

The controllable speeds are found backward from the end, then the path is driven forward with the highest acceleration
that keeps to them. The acceleration u is constant between two places, and the rows of both hold for it.

The loops are plain functions of numbers, which give the same bits compiled by numba (extra `fast`), as long paths want.

Source: Q.-C. Pham, H. Pham, "A New Approach to Time-Optimal Path Parameterization Based on Reachability Analysis",
IEEE Transactions on Robotics 34(3), 2018, sections III and IV.
"""

import sys
from collections.abc import Callable, Sequence
from functools import cache
from importlib.util import find_spec
from typing import Any, Final, NamedTuple

import numpy as np

from steptwin.features.fastest.rows import Rows
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.planning_time import check_planning_time

_FLAT: Final = 1e-12
"""Size up to which a row's coefficient of the acceleration counts as 0, as a part of the largest of its place."""
_LONG: Final = 1500
"""Number of places from which on to load numba takes less time than it saves."""
_BLOCK: Final = 2048
"""Intervals whose rows become Python's numbers at a time, which bounds the memory."""


def fastest_squares(s: FloatArray, rows: Rows) -> FloatArray:
    """Return the squares of the highest speeds at places of shape (n,), not falling: 0 at the first and the last.

    The rows belong to the places. Where a place stands twice, the motion keeps the limits before and after it.
    """
    solver = Solver.of(s, rows)
    return solver.squares(solver.bounds(rows.c), rows.x_max)


class Solver(NamedTuple):
    """A path's rows on the intervals between its places, for limits that are lowered again and again.

    Attributes:
        steps: shape (intervals,), their lengths.
        a: shape (intervals, rows), the rows' coefficients of the acceleration: those of its begin, then of its end.
        b: shape (intervals, rows), those of the square.
        slopes: shape (intervals, rows), b / a: u <= height - slope x where a is above 0, u >= it where a is below.
    """

    steps: FloatArray
    a: FloatArray
    b: FloatArray
    slopes: FloatArray

    @classmethod
    def of(cls, s: FloatArray, rows: Rows) -> "Solver":
        """Return the solver of a path; of its limits nothing is taken."""
        steps = np.diff(s)
        a = np.concatenate([rows.a[:-1], rows.a[1:] + 2.0 * steps[:, np.newaxis] * rows.b[1:]], axis=1)
        a[np.abs(a) <= _FLAT * np.abs(a).max(axis=1, keepdims=True)] = 0.0
        b = np.concatenate([rows.b[:-1], rows.b[1:]], axis=1)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return cls(steps, a, b, b / a)

    def bounds(self, limits: FloatArray) -> "Bounds":
        """Return what limits of shape (n, rows) mean for each interval by itself."""
        c = np.concatenate([limits[:-1], limits[1:]], axis=1)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            heights = c / self.a
        loops = _loops(len(limits))
        return Bounds(heights, np.append(loops.alone(self.a, self.slopes, heights, self.b, c), np.inf))

    def squares(self, bounds: "Bounds", x_max: FloatArray) -> FloatArray:
        """Return the squares for the bounds of limits, and for the highest squares of shape (n,)."""
        loops, heights = _loops(len(x_max)), bounds.heights
        most = np.minimum(x_max, bounds.most)
        most[-1] = 0.0
        loops.controllable(self.steps, self.a, self.slopes, heights, most)
        squares = np.zeros(len(x_max))
        loops.driven(self.steps, self.a, self.slopes, heights, most, squares)
        return squares


class Bounds(NamedTuple):
    """Limits of a path's intervals.

    Attributes:
        heights: shape (intervals, rows), c / a.
        most: shape (intervals + 1,), the highest x for which the rows of an interval leave an acceleration.
    """

    heights: FloatArray
    most: FloatArray


# --- the highest x of an interval for which its own rows leave an acceleration


def _alone(a: FloatArray, slopes: FloatArray, heights: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return it for each interval, by arrays."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        most = np.where((a == 0) & (b > 0), c / b, np.inf).min(axis=1)
        for k in range(a.shape[1]):  # each lower row against all upper ones
            closing = slopes - slopes[:, k : k + 1]
            meets = (heights - heights[:, k : k + 1]) / closing
            counts = (a > 0) & (a[:, k : k + 1] < 0) & (closing > 0)
            np.minimum(most, np.where(counts, meets, np.inf).min(axis=1), out=most)
    return np.asarray(most)


def alone(a: Any, slopes: Any, heights: Any, b: Any, c: Any, most: Any) -> None:
    """Write it to `most` for each interval, number by number."""
    for i in range(len(a)):
        best = np.inf
        for k in range(len(a[i])):
            if a[i][k] == 0.0:
                if b[i][k] > 0.0:
                    best = min(best, c[i][k] / b[i][k])
            elif a[i][k] < 0.0:
                for j in range(len(a[i])):
                    closing = slopes[i][j] - slopes[i][k]
                    if a[i][j] > 0.0 and closing > 0.0:
                        best = min(best, (heights[i][j] - heights[i][k]) / closing)
        most[i] = best


# --- the two passes


def controllable(steps: Any, a: Any, slopes: Any, heights: Any, most: Any) -> None:
    """Lower `most`, one longer, to the x from which the next place can be passed at a square from 0 to its own."""
    for i in range(len(steps) - 1, -1, -1):
        after, best = most[i + 1], most[i]
        if steps[i] == 0.0:
            most[i] = min(best, after)
            continue
        steep = 0.5 / steps[i]  # u <= (after - x) steep, u >= -x steep
        signs, slope, height = a[i], slopes[i], heights[i]
        for k in range(len(signs)):
            if signs[k] < 0.0:
                if steep > slope[k]:
                    best = min(best, (after * steep - height[k]) / (steep - slope[k]))
            elif signs[k] > 0.0 and slope[k] > steep:
                best = min(best, height[k] / (slope[k] - steep))
        most[i] = best


def driven(steps: Any, a: Any, slopes: Any, heights: Any, most: Any, squares: Any) -> None:
    """Write the squares behind the first one: driven with the highest acceleration, and never above `most`."""
    for i in range(len(steps)):
        x, u = squares[i], np.inf
        if steps[i] == 0.0:
            squares[i + 1] = x
            continue
        signs, slope, height = a[i], slopes[i], heights[i]
        for k in range(len(signs)):
            if signs[k] > 0.0:
                u = min(u, height[k] - slope[k] * x)
        squares[i + 1] = min(max(x + 2.0 * steps[i] * u, 0.0), most[i + 1])


# --- how they run


class Loops(NamedTuple):
    """The loops, plain or compiled; arguments as theirs, all of them arrays."""

    alone: Callable[..., FloatArray]
    controllable: Callable[..., None]
    driven: Callable[..., None]


def _in_blocks(loop: Callable[..., None]) -> Callable[..., None]:
    """Return a loop over arrays that hands Python's own numbers to a plain loop, block by block."""

    def over(steps: FloatArray, *arrays: FloatArray) -> None:
        count = len(steps)
        begins = range(0, count, _BLOCK)
        for begin in reversed(begins) if loop is controllable else begins:
            check_planning_time()
            end = min(begin + _BLOCK, count)
            lists = [_listed(array, begin, end, count) for array in arrays]
            loop(steps[begin:end].tolist(), *lists)
            for array, own in zip(arrays[3:], lists[3:], strict=True):
                array[begin : end + 1] = own

    return over


def _listed(array: FloatArray, begin: int, end: int, count: int) -> Sequence[Any]:
    """Return a block of an array as lists; one that belongs to the places has one more."""
    return list(array[begin : end + (len(array) > count)].tolist())


_PLAIN: Final = Loops(_alone, _in_blocks(controllable), _in_blocks(driven))


def _loops(places: int) -> Loops:
    """Return the loops for so many places."""
    is_long = places >= _LONG or "numba" in sys.modules
    return _compiled() if is_long and find_spec("numba") else _PLAIN


@cache
def _compiled() -> Loops:
    import numba

    one, table = numba.float64[::1], numba.float64[:, ::1]

    def compiled(function: Callable[..., None], *arguments: Any) -> Any:
        return numba.njit(numba.void(*arguments), cache=True, error_model="numpy")(function)

    by_numbers = compiled(alone, table, table, table, table, table, one)

    def alone_of(a: FloatArray, *others: FloatArray) -> FloatArray:
        most = np.empty(len(a))
        by_numbers(a, *others, most)
        return most

    return Loops(
        alone_of,
        compiled(controllable, one, table, table, table, one),
        compiled(driven, one, table, table, table, one, one),
    )
