"""The splines' slopes at their points, from the textbook equations written out here."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.sampled import akima_spline, c2_spline


@st.composite
def samples(draw: st.DrawFn) -> tuple[FloatArray, FloatArray]:
    """Draw 3 to 13 points of one joint; tenths make many equal slopes, a special case of Akima's formula."""
    gaps_ms = draw(st.lists(st.integers(10, 500), min_size=2, max_size=12))
    tenths = draw(st.lists(st.integers(-20, 20), min_size=len(gaps_ms) + 1, max_size=len(gaps_ms) + 1))
    return np.cumsum([0, *gaps_ms]) / 1000, np.array(tenths) / 10


def clamped_slopes(t_s: FloatArray, q: FloatArray) -> FloatArray:
    """Return the C2 spline's slopes m, 0 at both ends, by elimination in its tridiagonal equations.

    With the gaps h and the chords' slopes d:
    h[i] m[i-1] + 2 (h[i-1] + h[i]) m[i] + h[i-1] m[i+1] = 3 (h[i] d[i-1] + h[i-1] d[i]).
    """
    h, n = np.diff(t_s), len(t_s)
    d = np.diff(q) / h
    diagonal, above, right, m = np.ones(n), np.zeros(n), np.zeros(n), np.zeros(n)
    for i in range(1, n - 1):
        factor = h[i] / diagonal[i - 1]
        above[i] = h[i - 1]
        diagonal[i] = 2.0 * (h[i - 1] + h[i]) - factor * above[i - 1]
        right[i] = 3.0 * (h[i] * d[i - 1] + h[i - 1] * d[i]) - factor * right[i - 1]
    for i in range(n - 2, 0, -1):
        m[i] = (right[i] - above[i] * m[i + 1]) / diagonal[i]
    return m


def akima_slope(m: FloatArray) -> float:
    """Return the slope at the point between the second and the third of four chords with the slopes m."""
    before, after = abs(m[1] - m[0]), abs(m[3] - m[2])
    if max(before, after) < 1e-9:
        return float((m[1] + m[2]) / 2)
    return float((after * m[1] + before * m[2]) / (after + before))


def akima_slopes(t_s: FloatArray, q: FloatArray) -> FloatArray:
    """Return all slopes: two more chords on either side continue a parabola; 0 at both ends, where motions rest."""
    m = np.diff(q) / np.diff(t_s)
    m = np.array([3 * m[0] - 2 * m[1], 2 * m[0] - m[1], *m, 2 * m[-1] - m[-2], 3 * m[-1] - 2 * m[-2]])
    return np.array([0.0, *(akima_slope(m[i : i + 4]) for i in range(1, len(t_s) - 1)), 0.0])


def cubics(t_s: FloatArray, knots_s: FloatArray, q: FloatArray, m: FloatArray) -> FloatArray:
    """Return the cubics through positions and slopes at knots, in Hermite's basis."""
    i = np.clip(np.searchsorted(knots_s, t_s, side="right") - 1, 0, len(knots_s) - 2)
    h = knots_s[i + 1] - knots_s[i]
    u = (t_s - knots_s[i]) / h
    from_points = (1 + 2 * u) * (1 - u) ** 2 * q[i] + u**2 * (3 - 2 * u) * q[i + 1]
    return np.asarray(from_points + h * u * (1 - u) * ((1 - u) * m[i] - u * m[i + 1]))


Maker = Callable[[tuple[str, ...], FloatArray, FloatArray], Motion]
Slopes = Callable[[FloatArray, FloatArray], FloatArray]


@pytest.mark.slow
@pytest.mark.parametrize(("make", "slopes_of"), [(c2_spline, clamped_slopes), (akima_spline, akima_slopes)])
@given(sampled=samples())
def test_a_spline_solves_its_equations(make: Maker, slopes_of: Slopes, sampled: tuple[FloatArray, FloatArray]) -> None:
    times_s, q = sampled
    motion, slopes = make(("a",), times_s, q[:, np.newaxis]), slopes_of(times_s, q)
    t_s = np.linspace(0.0, times_s[-1], 301)
    assert motion.velocities(times_s)[:, 0] == pytest.approx(slopes, abs=1e-6)
    assert motion.positions(t_s)[:, 0] == pytest.approx(cubics(t_s, times_s, q, slopes), abs=1e-7)
