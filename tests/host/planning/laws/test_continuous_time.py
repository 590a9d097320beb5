"""The fastest laws against the optimum in continuous time, at any magnitude of distance and limits."""

from collections.abc import Callable
from math import cbrt, sqrt

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from steptwin.host.planning.laws import Cubic, Law, Quintic, SCurve, Trapezoid


def decades(lowest: float, highest: float) -> st.SearchStrategy[float]:
    return st.floats(lowest, highest).map(lambda exponent: 10.0**exponent)


def trapezoid_s(size: float, speed: float, acceleration: float) -> float:
    """Return the optimum duration: the speed reached is the limit or, over half of the distance, v^2 = S a."""
    reached = min(speed, sqrt(size * acceleration))
    return size / reached + reached / acceleration


def s_curve_s(size: float, speed: float, acceleration: float, jerk: float) -> float:
    """Return the optimum: the jerk ends at the highest acceleration, speed, j tj^2 = v, or half distance, 2 j tj^3 = S.

    Then T = S/v + v/a + tj with the speed reached: the limit, or that of ramps that meet, S = v (v/a + tj).
    """
    jerk_s = min(acceleration / jerk, sqrt(speed / jerk), cbrt(size / (2.0 * jerk)))
    a = jerk * jerk_s
    reached = min(speed, 2.0 * size / (jerk_s + sqrt(jerk_s**2 + 4.0 * size / a)))
    return size / reached + reached / a + jerk_s


KINDS: dict[str, tuple[Callable[..., Law], Callable[..., float], int]] = {
    "trapezoid": (Trapezoid.fastest, trapezoid_s, 2),
    "cubic": (Cubic.fastest, lambda s, v, a: max(1.5 * s / v, sqrt(6.0 * s / a)), 1),
    "quintic": (Quintic.fastest, lambda s, v, a: max(1.875 * s / v, sqrt(10.0 / sqrt(3.0) * s / a)), 1),
    "s-curve": (SCurve.fastest, s_curve_s, 4),
}
"""The law's choice, the optimum, and the number of phases whose durations are rounded up."""


@pytest.mark.parametrize("kind", KINDS)
@given(
    size=decades(-12.0, 9.0),
    sign=st.sampled_from([-1.0, 1.0]),
    limits=st.tuples(decades(-1.0, 6.0), decades(-1.0, 9.0), decades(-1.0, 12.0)),
)
def test_whole_milliseconds_cost_no_more_than_their_rounding(
    kind: str, size: float, sign: float, limits: tuple[float, float, float]
) -> None:
    fastest, optimum_s, phases = KINDS[kind]
    asked = limits if kind == "s-curve" else limits[:2]
    least_s = optimum_s(size, *asked)
    assume(least_s < 9e5)
    law = fastest(sign * size, *asked)
    assert law.distance == sign * size
    assert least_s * (1.0 - 1e-11) <= law.duration_s <= least_s * (1.0 + 1e-11) + phases / 1000
