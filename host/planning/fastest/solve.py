"""The fastest motion along a path from rest to rest within rows of limits: time-optimal path parametrisation.

The controllable speeds are found backward from the end, then the path is driven forward with the highest acceleration
that keeps to them. The acceleration u is constant between two places, and the rows of both hold for it.

Source: Q.-C. Pham, H. Pham, "A New Approach to Time-Optimal Path Parameterization Based on Reachability Analysis",
IEEE Transactions on Robotics 34(3), 2018, sections III and IV.
"""

from typing import Final

import numpy as np

from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.planning.fastest.rows import Rows

_FLAT: Final = 1e-12
"""Size up to which a row's coefficient of the acceleration counts as 0, as a part of the largest of its place."""


def fastest_squares(s: FloatArray, rows: Rows) -> FloatArray:
    """Return the squares of the highest speeds at places of shape (n,), not falling: 0 at the first and the last.

    The rows belong to the places. Where a place stands twice, the motion keeps the limits before and after it.
    """
    steps = np.diff(s)
    a, b, c = _on_intervals(rows, steps)
    upper = a > 0
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        slopes, heights = b / a, c / a
    # u <= height - slope x in the upper rows, u >= it in the lower ones
    most = np.minimum(rows.x_max, np.append(_alone(a, b, c, upper, slopes, heights), np.inf))
    above = [(slopes[i][rows_], heights[i][rows_]) for i, rows_ in enumerate(upper)]
    below = [(slopes[i][rows_], heights[i][rows_]) for i, rows_ in enumerate(a < 0)]
    most[-1] = 0.0
    for i in range(len(steps) - 1, -1, -1):
        most[i] = min(most[i], _controllable(float(steps[i]), float(most[i + 1]), above[i], below[i]))
    squares = np.zeros(len(s))
    for i, step in enumerate(steps.tolist()):
        x = float(squares[i])
        if step == 0.0:
            squares[i + 1] = x
            continue
        slope, height = above[i]
        u = float((height - slope * x).min()) if len(slope) else np.inf
        squares[i + 1] = min(max(x + 2.0 * step * u, 0.0), most[i + 1])
    return squares


def _on_intervals(rows: Rows, steps: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the rows of each interval between two places: those of its begin, and of its end with x + 2 step u."""
    a = np.concatenate([rows.a[:-1], rows.a[1:] + 2.0 * steps[:, np.newaxis] * rows.b[1:]], axis=1)
    a[np.abs(a) <= _FLAT * np.abs(a).max(axis=1, keepdims=True)] = 0.0
    return a, np.concatenate([rows.b[:-1], rows.b[1:]], axis=1), np.concatenate([rows.c[:-1], rows.c[1:]], axis=1)


def _alone(
    a: FloatArray, b: FloatArray, c: FloatArray, upper: BoolArray, slopes: FloatArray, heights: FloatArray
) -> FloatArray:
    """Return the highest x of each interval for which its own rows leave an acceleration."""
    most = np.full(len(a), np.inf)
    flat = (a == 0) & (b > 0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        np.minimum(most, np.where(flat, c / b, np.inf).min(axis=1), out=most)
        for k in range(a.shape[1]):  # each lower row against all upper ones
            closing = slopes - slopes[:, k : k + 1]
            meets = (heights - heights[:, k : k + 1]) / closing
            counts = upper & (a[:, k : k + 1] < 0) & (closing > 0)
            np.minimum(most, np.where(counts, meets, np.inf).min(axis=1), out=most)
    return most


_Lines = tuple[FloatArray, FloatArray]
"""Slopes and heights of rows, both of shape (rows,): the bound of u is height - slope x."""


def _controllable(step: float, after: float, above: _Lines, below: _Lines) -> float:
    """Return the highest x from which the next place can be passed at a square of the speed from 0 to `after`."""
    if step == 0.0:
        return after
    most, steep = np.inf, 0.5 / step  # u <= (after - x) steep, u >= -x steep
    slopes, heights = below
    if len(slopes):
        closing = steep - slopes
        with np.errstate(divide="ignore"):
            meets = np.where(closing > 0, (after * steep - heights) / np.where(closing > 0, closing, 1.0), np.inf)
        most = float(meets.min())
    slopes, heights = above
    steeper = slopes > steep
    if steeper.any():
        most = min(most, float((heights[steeper] / (slopes[steeper] - steep)).min()))
    return most
