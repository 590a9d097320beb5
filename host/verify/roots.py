"""Find the roots of many functions at once, each inside its own bracket, without derivatives.

Chandrupatla's method interpolates inversely quadratically if three points promise convergence, and bisects otherwise. A
smooth function costs about five evaluations, any continuous function hardly more than bisection.

Source: T. R. Chandrupatla, "A new hybrid quadratic/bisection algorithm for finding the zero of a nonlinear function
without using derivatives", Advances in Engineering Software 28 (1997) 145-149.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import FloatArray

IndexArray = NDArray[np.intp]

Functions = Callable[[FloatArray, IndexArray], FloatArray]
"""Return values at abscissae of shape (m,); the second argument holds the index of the function for each abscissa."""

MAX_EVALUATIONS = 200


def bracketed_roots(
    functions: Functions,
    low: FloatArray,
    high: FloatArray,
    f_low: FloatArray,
    f_high: FloatArray,
    tolerance: float,
) -> FloatArray:
    """Return the root of each of n functions, shape (n,), to within twice the tolerance.

    All arrays have shape (n,). The signs of f_low and f_high differ, or one of them is 0. An empty bracket
    (low == high) is its own root.
    """
    roots = np.where(f_low == 0.0, low, high)
    which = np.flatnonzero((f_low != 0.0) & (f_high != 0.0) & (low < high))
    a, b, f_a, f_b = low[which], high[which], f_low[which], f_high[which]
    fraction = f_a / (f_a - f_b)
    for _ in range(MAX_EVALUATIONS):
        if which.size == 0:
            break
        margin = tolerance / np.abs(b - a)
        x = a + np.clip(fraction, margin, 1.0 - margin) * (b - a)
        f_x = functions(x, which)
        same = np.sign(f_x) == np.sign(f_a)
        c, f_c = np.where(same, a, b), np.where(same, f_a, f_b)
        b, f_b = np.where(same, b, a), np.where(same, f_b, f_a)
        a, f_a = x, f_x
        roots[which] = np.where(np.abs(f_a) < np.abs(f_b), a, b)
        open_ = (f_a != 0.0) & (np.abs(b - a) > 2.0 * tolerance)
        which, a, b, c, f_a, f_b, f_c = (v[open_] for v in (which, a, b, c, f_a, f_b, f_c))
        fraction = _next_fraction(a, b, c, f_a, f_b, f_c)
    return roots


def _next_fraction(
    a: FloatArray, b: FloatArray, c: FloatArray, f_a: FloatArray, f_b: FloatArray, f_c: FloatArray
) -> FloatArray:
    """Return the next abscissa as a fraction of the way from a to b: interpolated if that is safe, else the middle."""
    xi = (a - b) / (c - b)
    phi = (f_a - f_b) / (f_c - f_b)
    safe = (phi**2 < xi) & ((1.0 - phi) ** 2 < 1.0 - xi)
    fraction = np.full(a.shape, 0.5)
    a, b, c, f_a, f_b, f_c = (v[safe] for v in (a, b, c, f_a, f_b, f_c))
    fraction[safe] = f_a / (f_b - f_a) * f_c / (f_b - f_c) + (c - a) / (b - a) * f_a / (f_c - f_a) * f_b / (f_c - f_b)
    return fraction
