"""The fastest laws: they keep their limits, a law 1 ms shorter would not, and senseless limits are refused."""

from collections.abc import Callable
from math import inf, nan, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.common.errors import InputError
from steptwin.host.planning.laws import Cubic, Law, Quintic, SCurve, Trapezoid
from tests.host.planning.laws.made import DISTANCES, instants_s, peak_speed
from tests.messages import refusing

KEPT = 1.0 + 1e-11
"""A limit may be exceeded by rounding only."""

LIMITS = st.floats(-1.0, 4.0).map(lambda exponent: 10.0**exponent)


def peak_acceleration(law: Law) -> float:
    return float(np.abs(law.acceleration(instants_s(law))).max())


def peak_jerk(law: SCurve) -> float:
    return peak_acceleration(law) / law.jerk_s


@given(DISTANCES, LIMITS, LIMITS)
def test_the_trapezoid_keeps_its_limits(distance: float, speed: float, acceleration: float) -> None:
    law = Trapezoid.fastest(distance, speed, acceleration)
    assert law.distance == distance
    assert peak_speed(law) <= speed * KEPT
    assert peak_acceleration(law) <= acceleration * KEPT


@pytest.mark.parametrize(
    ("kind", "speed_peak", "acceleration_peak"), [(Cubic, 1.5, 6.0), (Quintic, 15.0 / 8.0, 10.0 / sqrt(3.0))]
)
@given(distance=DISTANCES, speed=LIMITS, acceleration=LIMITS)
def test_polynomials_just_keep_their_limits(
    kind: type[Cubic | Quintic],
    speed_peak: float,
    acceleration_peak: float,
    distance: float,
    speed: float,
    acceleration: float,
) -> None:
    """The peaks are in S/T and S/T^2."""
    law = kind.fastest(distance, speed, acceleration)
    assert law.distance == distance
    assert speed_peak * abs(distance) / law.duration_s <= speed * KEPT
    assert acceleration_peak * abs(distance) / law.duration_s**2 <= acceleration * KEPT
    shorter_ms = round(1000 * law.duration_s) - 1
    assert (
        shorter_ms == 0
        or 1e3 * speed_peak * abs(distance) / shorter_ms > speed
        or 1e6 * acceleration_peak * abs(distance) / shorter_ms**2 > acceleration
    )


@pytest.mark.slow
@given(DISTANCES, LIMITS, LIMITS, LIMITS)
def test_the_s_curve_keeps_its_limits(distance: float, speed: float, acceleration: float, jerk: float) -> None:
    law = SCurve.fastest(distance, speed, acceleration, jerk)
    assert law.distance == distance
    assert peak_speed(law) <= speed * KEPT
    assert peak_acceleration(law) <= acceleration * KEPT
    assert peak_jerk(law) <= jerk * KEPT


# Limits of short motions: all shorter laws can be tried, and whole milliseconds are coarse.
SHORT = st.floats(-1.0, 1.0)
SPEEDS = st.floats(0.5, 2.0).map(lambda exponent: 10.0**exponent)
ACCELERATIONS = st.floats(2.0, 4.5).map(lambda exponent: 10.0**exponent)
JERKS = st.floats(4.0, 7.5).map(lambda exponent: 10.0**exponent)


@given(SHORT, SPEEDS, ACCELERATIONS)
def test_no_trapezoid_is_shorter(distance: float, speed: float, acceleration: float) -> None:
    """Every trapezoid that is 1 ms shorter exceeds a limit."""
    shorter_ms = round(1000 * Trapezoid.fastest(distance, speed, acceleration).duration_s) - 1
    ramps_ms = np.arange(1, shorter_ms // 2 + 1)
    speeds = 1e3 * abs(distance) / (shorter_ms - ramps_ms)
    assert np.all((speeds > speed) | (1e3 * speeds / ramps_ms > acceleration))


@pytest.mark.slow
@given(SHORT, SPEEDS, ACCELERATIONS, JERKS)
def test_no_s_curve_is_shorter(distance: float, speed: float, acceleration: float, jerk: float) -> None:
    """Every S-curve that is 1 ms shorter exceeds a limit."""
    shorter_ms = round(1000 * SCurve.fastest(distance, speed, acceleration, jerk).duration_s) - 1
    ramps_ms, jerks_ms = np.meshgrid(np.arange(2, shorter_ms // 2 + 1), np.arange(1, shorter_ms // 4 + 1))
    ramps_ms, jerks_ms = ramps_ms[2 * jerks_ms <= ramps_ms], jerks_ms[2 * jerks_ms <= ramps_ms]
    speeds = 1e3 * abs(distance) / (shorter_ms - ramps_ms)
    accelerations = 1e3 * speeds / (ramps_ms - jerks_ms)
    assert np.all((speeds > speed) | (accelerations > acceleration) | (1e3 * accelerations / jerks_ms > jerk))


def test_by_hand() -> None:
    assert Trapezoid.fastest(180.0, 22.5, 11.25) == Trapezoid(180.0, 10.0, 2.0)
    assert Trapezoid.fastest(-4.0, 1e3, 100.0) == Trapezoid(-4.0, 0.4, 0.2)  # too short for the speed
    assert Cubic.fastest(2.0, 1.5, 1e3) == Cubic(2.0, 2.0)
    assert Cubic.fastest(-6.0, 1e3, 4.0) == Cubic(-6.0, 3.0)
    assert Quintic.fastest(-8.0, 7.5, 1e3) == Quintic(-8.0, 2.0)
    assert Quintic.fastest(sqrt(3.0), 1e3, 2.5) == Quintic(sqrt(3.0), 2.0)
    assert SCurve.fastest(9.0, 3.0, 4.0, 16.0) == SCurve(9.0, 4.0, 1.0, 0.25)
    assert SCurve.fastest(-3.0, 1e3, 4.0, 16.0) == SCurve(-3.0, 2.0, 1.0, 0.25)  # too short for the speed
    assert SCurve.fastest(2.0, 1e3, 1e3, 1e3) == SCurve(2.0, 0.4, 0.2, 0.1)  # and for the acceleration


def test_a_shorter_ramp_may_make_a_shorter_motion() -> None:
    """Ramps of 1.2 ms would meet after 2.4 ms. Two of 2 ms take 4 ms, a slower motion with 1 ms takes 3 ms."""
    assert Trapezoid.fastest(1.44e-3, 1e3, 1e3) == Trapezoid(1.44e-3, 0.003, 0.001)


FASTEST: dict[str, Callable[[float, float, float, float], Law]] = {
    "trapezoid": lambda distance, speed, acceleration, _: Trapezoid.fastest(distance, speed, acceleration),
    "cubic": lambda distance, speed, acceleration, _: Cubic.fastest(distance, speed, acceleration),
    "quintic": lambda distance, speed, acceleration, _: Quintic.fastest(distance, speed, acceleration),
    "s-curve": SCurve.fastest,
}


@pytest.mark.parametrize(
    ("kind", "shortest_s"), [("trapezoid", 0.002), ("cubic", 0.001), ("quintic", 0.001), ("s-curve", 0.004)]
)
@pytest.mark.parametrize(("distance", "limit"), [(0.0, 1.0), (0.0, 1e-300), (1.0, 1e300)])
def test_no_distance_and_no_limits(kind: str, shortest_s: float, distance: float, limit: float) -> None:
    law = FASTEST[kind](distance, limit, limit, limit)
    assert law.duration_s == shortest_s
    assert law.position(np.array([0.0, law.duration_s])).tolist() == [0.0, distance]


@pytest.mark.parametrize("kind", FASTEST)
@pytest.mark.parametrize("limit", [0.0, -1.0, inf, nan])
@pytest.mark.parametrize("which", ["speed_max", "acceleration_max"])
def test_senseless_limits_are_refused(kind: str, which: str, limit: float) -> None:
    limits = {"speed_max": 1.0, "acceleration_max": 1.0} | {which: limit}
    with refusing(InputError):
        FASTEST[kind](1.0, limits["speed_max"], limits["acceleration_max"], 1.0)


@pytest.mark.parametrize("limit", [0.0, -1.0, inf, nan])
def test_senseless_jerks_are_refused(limit: float) -> None:
    with refusing(InputError):
        SCurve.fastest(1.0, 1.0, 1.0, limit)


def test_a_motion_of_many_days() -> None:
    assert Cubic.fastest(1e6, 1.5, 1.0).duration_s == 1e6
    assert Trapezoid.fastest(999_999.123, 1.0, 1e6) == Trapezoid(999_999.123, 999_999.124, 0.001)


@pytest.mark.parametrize("kind", FASTEST)
@pytest.mark.parametrize("limits", [(1.0, 1e6, 1e6), (1e9, 1e-9, 1e6), (1e-300, 1e-300, 1e-300)])
def test_a_motion_that_lasts_too_long(kind: str, limits: tuple[float, float, float]) -> None:
    with refusing(InputError):
        FASTEST[kind](1.1e6, *limits)


def test_a_jerk_so_low_that_it_lasts_too_long() -> None:
    with refusing(InputError):
        SCurve.fastest(1.0, 1e300, 1e300, 1e-300)


@pytest.mark.parametrize("kind", FASTEST)
@pytest.mark.parametrize("distance", [inf, -inf, nan])
def test_a_distance_must_be_finite(kind: str, distance: float) -> None:
    with refusing(InputError):
        FASTEST[kind](distance, 1.0, 1.0, 1.0)
