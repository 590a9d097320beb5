"""Boundaries of a plane region that can only be asked, point by point, whether it contains it.

The plane has two coordinates. A line holds the first one; along it the second one is tried on a grid, and every change
from outside to inside or back is refined by bisection, on all lines at once. What is narrower than the grid can escape.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.base import BoolArray

Region = Callable[[FloatArray, FloatArray], BoolArray]
"""Whether points, given by their coordinates of shape (n,), are inside."""

_HALVINGS: Final = 40
"""From a cell of the grid to its rounding."""

_ZOOM: Final = 8
"""Into how many parts each zoom divides the two cells between the best line and its neighbours."""

_ZOOMS: Final = 12
"""Enough for any cell to shrink to its rounding."""

_LEVEL: Final = 1e-9
"""An extreme has been found where three lines in a row come as close to it; two may only stand on either side."""


@dataclass(frozen=True, slots=True, eq=False)
class Stretches:
    """The parts of lines that are inside, line by line and along each; all arrays of shape (n,).

    Attributes:
        line: the index of the line.
        begin: the second coordinate where the part begins.
        end: where it ends.
    """

    line: NDArray[np.intp]
    begin: FloatArray
    end: FloatArray


def swapped(region: Region) -> Region:
    """The same region with its coordinates exchanged."""
    return lambda first, second: region(second, first)


def stretches(region: Region, lines: FloatArray, grid: FloatArray) -> Stretches:
    """What is inside on the lines, whose first coordinates are given, between the first and the last of the grid."""
    inside = region(np.repeat(lines, len(grid)), np.tile(grid, len(lines))).reshape(len(lines), len(grid))
    changes = np.diff(np.pad(inside.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    begins, ends = np.nonzero(changes == 1), np.nonzero(changes == -1)
    outside = np.concatenate([np.maximum(begins[1] - 1, 0), np.minimum(ends[1], len(grid) - 1)])
    inner = np.concatenate([begins[1], ends[1] - 1])
    line = np.concatenate([begins[0], ends[0]])
    begin, end = np.split(_bisected(region, lines[line], grid[outside], grid[inner]), 2)
    return Stretches(begins[0], begin, end)


def widths(found: Stretches, lines: int) -> FloatArray:
    """Shape (lines,): how much of each line is inside."""
    total: FloatArray = np.bincount(found.line, found.end - found.begin, minlength=lines).astype(np.float64)
    return total


def edges(found: Stretches, lines: FloatArray, grid: FloatArray) -> FloatArray:
    """Shape (m, 2): the points where lines enter or leave the region, not those where the grid ends."""
    first = lines[np.concatenate([found.line, found.line])]
    second = np.concatenate([found.begin, found.end])
    kept = (second > grid[0]) & (second < grid[-1])
    return np.column_stack([first[kept], second[kept]])


def extent(region: Region, lines: FloatArray, grid: FloatArray, found: Stretches) -> tuple[float, float] | None:
    """The least and the greatest second coordinate inside, also between the lines; None if nothing was found."""
    if not len(found.line):
        return None
    return (
        _least(region, lines, grid, found, lambda stretch: stretch.begin),
        -_least(region, lines, grid, found, lambda stretch: -stretch.end),
    )


def _least(
    region: Region, lines: FloatArray, grid: FloatArray, found: Stretches, value: Callable[[Stretches], FloatArray]
) -> float:
    """The least value of all stretches, searched ever closer around the line that has it, until it is level there."""
    least = np.inf
    for _ in range(_ZOOMS):
        on_line = np.full(len(lines), np.inf)
        np.minimum.at(on_line, found.line, value(found))
        least = min(least, float(on_line.min()))
        level = on_line < least + _LEVEL
        if np.any(level[:-2] & level[1:-1] & level[2:]):
            break
        lines = _around(lines, int(on_line.argmin()))
        found = stretches(region, lines, grid)
    return least


def _around(lines: FloatArray, line: int) -> FloatArray:
    """Closer lines up to a line's neighbours, rising, the line itself among them."""
    below, above = lines[max(line - 1, 0)], lines[min(line + 1, len(lines) - 1)]
    return np.unique([np.linspace(below, lines[line], _ZOOM + 1), np.linspace(lines[line], above, _ZOOM + 1)])


def _bisected(region: Region, first: FloatArray, outside: FloatArray, inside: FloatArray) -> FloatArray:
    """The last second coordinates inside, between one outside and one inside; all of shape (n,)."""
    for _ in range(_HALVINGS):
        middle = (outside + inside) / 2.0
        is_inside = region(first, middle)
        outside, inside = np.where(is_inside, outside, middle), np.where(is_inside, middle, inside)
    return inside
