"""Properties of every time law: rest at both ends, consistent derivatives, no reversal, breakpoints on the grid."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.planning.laws import Cubic, Law, Quintic, SCurve, Trapezoid
from tests.host.planning.laws.made import DISTANCES, durations_s, instants_s, laws, peak_speed, s_curves

# Gauss-Legendre with 3 points: exact for velocities up to degree 5, and without nodes at breakpoints.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(3)


@given(laws())
def test_it_goes_from_rest_to_rest_over_the_whole_distance(law: Law) -> None:
    ends_s = np.array([0.0, law.duration_s])
    assert law.position(ends_s).tolist() == [0.0, law.distance]
    assert np.abs(law.velocity(ends_s)).tolist() == [0.0, 0.0]


@pytest.mark.slow
@given(laws())
def test_velocity_and_acceleration_are_the_derivatives(law: Law) -> None:
    """Their integrals between instants without a breakpoint in between equal the differences, up to rounding."""
    t_s = instants_s(law)
    dt_s = np.diff(t_s)
    inside_s = (t_s[:-1] + dt_s / 2)[:, np.newaxis] + dt_s[:, np.newaxis] / 2 * NODES
    velocity = law.velocity(inside_s.ravel()).reshape(inside_s.shape)
    acceleration = law.acceleration(inside_s.ravel()).reshape(inside_s.shape)
    assert np.diff(law.position(t_s)) == pytest.approx(velocity @ WEIGHTS / 2 * dt_s, abs=1e-11 * abs(law.distance))
    assert np.diff(law.velocity(t_s)) == pytest.approx(acceleration @ WEIGHTS / 2 * dt_s, abs=1e-9 * peak_speed(law))


@given(laws())
def test_it_never_turns_back(law: Law) -> None:
    t_s = np.linspace(0.0, law.duration_s, 1001)
    assert np.all(law.velocity(t_s) * np.sign(law.distance) >= 0.0)
    assert np.all(np.diff(law.position(t_s) * np.sign(law.distance)) >= -1e-12 * abs(law.distance))


@given(st.one_of(s_curves(), st.builds(Quintic, DISTANCES, durations_s())))
def test_the_soft_laws_acceleration_never_jumps(law: SCurve | Quintic) -> None:
    """Within a microsecond, also at a breakpoint, it changes at most by the highest jerk; it is 0 at both ends."""
    before_s = np.clip(instants_s(law) - 0.5e-6, 0.0, law.duration_s - 1e-6)
    changes = law.acceleration(before_s + 1e-6) - law.acceleration(before_s)
    if isinstance(law, SCurve):
        jerk = abs(law.speed) / (law.ramp_s - law.jerk_s) / law.jerk_s
    else:
        jerk = 60.0 * abs(law.distance) / law.duration_s**3
    assert np.abs(changes).max() <= 1.001e-6 * jerk
    assert np.abs(law.acceleration(np.array([0.0, law.duration_s]))).tolist() == [0.0, 0.0]


@pytest.mark.slow
@given(laws())
def test_it_is_symmetric(law: Law) -> None:
    t_s = instants_s(law)
    back_s = law.duration_s - t_s
    near = 1e-11 * abs(law.distance)
    assert law.position(t_s) + law.position(back_s) == pytest.approx(np.full(t_s.shape, law.distance), abs=near)
    assert law.velocity(t_s) == pytest.approx(law.velocity(back_s), abs=1e-9 * peak_speed(law))


@given(laws())
def test_breakpoints_are_whole_milliseconds_inside(law: Law) -> None:
    breakpoints_ms = [round(1000 * t_s) for t_s in law.breakpoints_s]
    assert law.breakpoints_s == tuple(ms / 1000 for ms in breakpoints_ms)
    assert breakpoints_ms == sorted(set(breakpoints_ms))
    assert all(0 < ms < round(1000 * law.duration_s) for ms in breakpoints_ms)


@pytest.mark.parametrize(
    "law", [Trapezoid(-3.0, 2.0, 0.5), Cubic(-3.0, 2.0), Quintic(-3.0, 2.0), SCurve(-3.0, 2.0, 0.5, 0.25)]
)
def test_a_negative_distance_mirrors(law: Trapezoid | Cubic | Quintic | SCurve) -> None:
    forth, t_s = replace(law, distance=3.0), instants_s(law)
    assert law.position(t_s).tolist() == (-forth.position(t_s)).tolist()
    assert law.velocity(t_s).tolist() == (-forth.velocity(t_s)).tolist()
    assert law.acceleration(t_s).tolist() == (-forth.acceleration(t_s)).tolist()
