"""Cubic and quintic: hand-computed values, published numbers, peaks, and durations that are refused."""

from math import degrees, sqrt

import numpy as np
import pytest
from hypothesis import given

from steptwin.host.planning.laws import Cubic, Quintic
from tests.host.complaints import complaint_of
from tests.host.planning.laws.made import DISTANCES, durations_s


def test_the_cubic_by_hand() -> None:
    """s = 12 u^2 - 8 u^3 over 4 with u = t / 2."""
    law, t_s = Cubic(4.0, 2.0), np.array([0.0, 0.5, 1.0, 1.5, 2.0])
    assert law.position(t_s).tolist() == [0.0, 0.625, 2.0, 3.375, 4.0]
    assert law.velocity(t_s).tolist() == [0.0, 2.25, 3.0, 2.25, 0.0]
    assert law.acceleration(t_s).tolist() == [6.0, 3.0, 0.0, -3.0, -6.0]
    assert law.breakpoints_s == ()


def test_the_quintic_by_hand() -> None:
    """s = 320 u^3 - 480 u^4 + 192 u^5 over 32 with u = t / 2."""
    law, t_s = Quintic(32.0, 2.0), np.array([0.0, 0.5, 1.0, 1.5, 2.0])
    assert law.position(t_s).tolist() == [0.0, 3.3125, 16.0, 28.6875, 32.0]
    assert law.velocity(t_s).tolist() == [0.0, 16.875, 30.0, 16.875, 0.0]
    assert law.acceleration(t_s).tolist() == [0.0, 45.0, 0.0, -45.0, 0.0]
    assert law.breakpoints_s == ()


def cubic_coefficients(law: Cubic) -> tuple[float, float]:
    """Return a2 and a3 of s = a2 t^2 + a3 t^3, from the acceleration 2 a2 + 6 a3 t."""
    at_start, at_end = law.acceleration(np.array([0.0, law.duration_s])).tolist()
    return at_start / 2.0, (at_end - at_start) / (6.0 * law.duration_s)


@pytest.mark.slow
@given(durations_s())
def test_the_cubic_of_distance_1_has_the_textbook_coefficients(duration_s: float) -> None:
    expected = 3.0 / duration_s**2, -2.0 / duration_s**3
    assert cubic_coefficients(Cubic(1.0, duration_s)) == pytest.approx(expected)


def test_the_cubic_of_the_teaching_arm() -> None:
    """From -0.000062 rad to -0.522315 rad in 1 s."""
    assert cubic_coefficients(Cubic(-0.522315 + 0.000062, 1.0)) == pytest.approx((-1.566759, 1.044506), abs=1e-12)


def test_the_quintic_of_the_teaching_arm() -> None:
    """From 0.000178 rad to 1.504080 rad in 66 intervals of 15 ms, in degrees."""
    law = Quintic(1.504080 - 0.000178, 0.99)
    at_deg = [degrees(0.000178 + s) for s in law.position(np.array([10, 33, 50]) * 0.015)]
    assert at_deg == pytest.approx([2.367471477, 43.093817349, 77.932308340], abs=5e-10)


@given(DISTANCES, durations_s())
def test_the_peaks_of_the_cubic(distance: float, duration_s: float) -> None:
    law = Cubic(distance, duration_s)
    t_s = np.linspace(0.0, duration_s, 1001)
    speed, acceleration = 1.5 * abs(distance) / duration_s, 6.0 * abs(distance) / duration_s**2
    assert np.abs(law.velocity(t_s)).max() == pytest.approx(speed)
    assert np.abs(law.acceleration(t_s)).max() == pytest.approx(acceleration)


@given(DISTANCES, durations_s())
def test_the_peaks_of_the_quintic(distance: float, duration_s: float) -> None:
    law = Quintic(distance, duration_s)
    t_s = np.append(np.linspace(0.0, duration_s, 1001), duration_s * (3.0 - sqrt(3.0)) / 6.0)
    speed, acceleration = 15.0 / 8.0 * abs(distance) / duration_s, 10.0 / sqrt(3.0) * abs(distance) / duration_s**2
    assert np.abs(law.velocity(t_s)).max() == pytest.approx(speed)
    assert np.abs(law.acceleration(t_s)).max() == pytest.approx(acceleration)


@pytest.mark.parametrize("law", [Cubic, Quintic])
@pytest.mark.parametrize(
    ("duration_s", "words"),
    [
        (0.0, "0 s is not above 0"),
        (-0.001, "-0.001 s is not above 0"),
        (0.0005, "0.0005 s is not a whole number of milliseconds"),
        (float("nan"), "nan s is not a whole number of milliseconds"),
        (float("inf"), "inf s is not a whole number of milliseconds"),
    ],
)
def test_durations_that_are_refused(law: type[Cubic | Quintic], duration_s: float, words: str) -> None:
    told = complaint_of(lambda: law(1.0, duration_s))
    assert told.startswith(f"duration_s: {words}")


@pytest.mark.parametrize("law", [Cubic, Quintic])
def test_the_shortest_duration(law: type[Cubic | Quintic]) -> None:
    assert law(1.0, 0.001).position(np.array([0.0, 0.0005, 0.001])) == pytest.approx([0.0, 0.5, 1.0])
