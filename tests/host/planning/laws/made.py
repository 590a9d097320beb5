"""Random laws of every kind, and measures of a law."""

import numpy as np
from hypothesis import strategies as st

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.laws import Cubic, Law, Quintic, SCurve, Trapezoid

DISTANCES = st.one_of(st.just(0.0), st.floats(1e-6, 1e4), st.floats(-1e4, -1e-6))


@st.composite
def trapezoids(draw: st.DrawFn) -> Trapezoid:
    ramp_ms = draw(st.integers(1, 5_000))
    duration_ms = 2 * ramp_ms + draw(st.integers(0, 20_000))
    return Trapezoid(draw(DISTANCES), duration_ms / 1000, ramp_ms / 1000)


@st.composite
def s_curves(draw: st.DrawFn) -> SCurve:
    jerk_ms = draw(st.integers(1, 2_000))
    ramp_ms = 2 * jerk_ms + draw(st.integers(0, 4_000))
    duration_ms = 2 * ramp_ms + draw(st.integers(0, 20_000))
    return SCurve(draw(DISTANCES), duration_ms / 1000, ramp_ms / 1000, jerk_ms / 1000)


def durations_s() -> st.SearchStrategy[float]:
    return st.integers(1, 40_000).map(lambda ms: ms / 1000)


def laws() -> st.SearchStrategy[Law]:
    """Draw a law of any kind."""
    cubics = st.builds(Cubic, DISTANCES, durations_s())
    quintics = st.builds(Quintic, DISTANCES, durations_s())
    return st.one_of(trapezoids(), cubics, quintics, s_curves())


def instants_s(law: Law) -> FloatArray:
    """Return a grid over the whole law with start, breakpoints and end."""
    grid_s = np.linspace(0.0, law.duration_s, 101)
    return np.unique(np.concatenate([grid_s, law.breakpoints_s, [law.duration_s]]))


def peak_speed(law: Law) -> float:
    """Return the highest speed on the grid, which contains the middle."""
    return float(np.abs(law.velocity(instants_s(law))).max())
