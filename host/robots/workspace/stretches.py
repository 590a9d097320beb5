"""Find the boundaries of a plane region that can only be tested point by point.

On a line of constant first coordinate the second one is tested on a grid. Every change between outside and inside is
refined by bisection, on all lines at once. A stretch or gap that is narrower than the grid may be missed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import BoolArray, FloatArray

Region = Callable[[FloatArray, FloatArray], BoolArray]
"""A function that returns whether points, given by their coordinates of shape (n,), are inside."""

_HALVINGS: Final = 40
"""Number of bisections that shrink a cell of the grid to rounding error."""

_ZOOM: Final = 8
"""Number of parts into which a zoom divides each of the two cells beside the best line."""

_ZOOMS: Final = 12
"""Number of zooms after which any cell has shrunk to rounding error."""

_LEVEL: Final = 1e-9
"""An extreme is found if three neighbouring lines are this close to it; two lines may be on its two sides."""


@dataclass(frozen=True, slots=True, eq=False)
class Stretches:
    """The parts of lines that are inside, in the order of the lines and along each; all arrays of shape (n,).

    Attributes:
        line: index of the line.
        begin: second coordinate of the part's beginning.
        end: second coordinate of its end.
    """

    line: NDArray[np.intp]
    begin: FloatArray
    end: FloatArray


def swapped(region: Region) -> Region:
    """Return the same region with its coordinates exchanged."""
    return lambda first, second: region(second, first)


def stretches(region: Region, lines: FloatArray, grid: FloatArray) -> Stretches:
    """Return the parts inside of lines, given by their first coordinates, between the ends of the grid."""
    inside = region(np.repeat(lines, len(grid)), np.tile(grid, len(lines))).reshape(len(lines), len(grid))
    changes = np.diff(np.pad(inside.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    begins, ends = np.nonzero(changes == 1), np.nonzero(changes == -1)
    outside = np.concatenate([np.maximum(begins[1] - 1, 0), np.minimum(ends[1], len(grid) - 1)])
    inner = np.concatenate([begins[1], ends[1] - 1])
    line = np.concatenate([begins[0], ends[0]])
    begin, end = np.split(_bisected(region, lines[line], grid[outside], grid[inner]), 2)
    return Stretches(begins[0], begin, end)


def widths(found: Stretches, lines: int) -> FloatArray:
    """Return, of shape (lines,), the length of each line that is inside."""
    total: FloatArray = np.bincount(found.line, found.end - found.begin, minlength=lines).astype(np.float64)
    return total


def edges(found: Stretches, lines: FloatArray, grid: FloatArray) -> FloatArray:
    """Return, of shape (m, 2), the points where lines enter or leave the region; not those where the grid ends."""
    first = lines[np.concatenate([found.line, found.line])]
    second = np.concatenate([found.begin, found.end])
    kept = (second > grid[0]) & (second < grid[-1])
    return np.column_stack([first[kept], second[kept]])


def extent(region: Region, lines: FloatArray, grid: FloatArray, found: Stretches) -> tuple[float, float] | None:
    """Return the least and the greatest second coordinate inside, also between the lines; None if nothing was found."""
    if not len(found.line):
        return None
    return (
        _least(region, lines, grid, found, lambda stretch: stretch.begin),
        -_least(region, lines, grid, found, lambda stretch: -stretch.end),
    )


def _least(
    region: Region, lines: FloatArray, grid: FloatArray, found: Stretches, value: Callable[[Stretches], FloatArray]
) -> float:
    """Return the least value of all stretches: zoom in around the line that has it, until neighbouring lines agree."""
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
    """Return closer lines between a line's two neighbours, rising and with the line itself."""
    below, above = lines[max(line - 1, 0)], lines[min(line + 1, len(lines) - 1)]
    return np.unique([np.linspace(below, lines[line], _ZOOM + 1), np.linspace(lines[line], above, _ZOOM + 1)])


def _bisected(region: Region, first: FloatArray, outside: FloatArray, inside: FloatArray) -> FloatArray:
    """Return the last second coordinates inside, by bisection from one outside and one inside; all of shape (n,)."""
    for _ in range(_HALVINGS):
        middle = (outside + inside) / 2.0
        is_inside = region(first, middle)
        outside, inside = np.where(is_inside, outside, middle), np.where(is_inside, middle, inside)
    return inside
