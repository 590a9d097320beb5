"""The jerk-limited law: hand-computed values, phases, peaks, and times that are refused."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given

from steptwin.host.planning.laws import SCurve, Trapezoid
from tests.host.complaints import complaint_of
from tests.host.planning.laws.made import s_curves

LAW = SCurve(9.0, 4.0, 1.0, 0.25)


def test_seven_phases_by_hand() -> None:
    """v = 3, a = 4 and j = 16; a quarter of a second of jerk covers 1/24."""
    t_s = np.array([0.0, 0.25, 0.5, 0.75, 1.0, 2.0, 3.0, 3.25, 3.5, 3.75, 4.0])
    covered = [0.0, 1 / 24, 7 / 24, 0.75 + 1 / 24, 1.5, 4.5]
    assert LAW.speed == 3.0
    assert LAW.breakpoints_s == (0.25, 0.75, 1.0, 3.0, 3.25, 3.75)
    assert LAW.position(t_s) == pytest.approx([*covered, *(9.0 - s for s in reversed(covered[:-1]))])
    assert LAW.velocity(t_s).tolist() == [0.0, 0.5, 1.5, 2.5, 3.0, 3.0, 3.0, 2.5, 1.5, 0.5, 0.0]
    assert LAW.acceleration(t_s).tolist() == [0.0, 4.0, 4.0, 4.0, 0.0, 0.0, 0.0, -4.0, -4.0, -4.0, 0.0]


def test_phases_that_vanish() -> None:
    """The ramps meet, and the acceleration falls as soon as it has risen: four phases."""
    law = SCurve(-2.0, 0.4, 0.2, 0.1)
    assert law.breakpoints_s == (0.1, 0.2, 0.3)
    t_s = np.array([0.05, 0.1, 0.2, 0.3, 0.4])
    assert law.velocity(t_s) == pytest.approx([-1.25, -5.0, -10.0, -5.0, 0.0])
    assert law.acceleration(t_s) == pytest.approx([-50.0, -100.0, 0.0, 100.0, 0.0], abs=1e-9)
    assert law.position(t_s) == pytest.approx([-0.125 / 6, -1 / 6, -1.0, -11 / 6, -2.0])


@pytest.mark.slow
@given(s_curves())
def test_the_jerk_is_constant_in_each_phase(law: SCurve) -> None:
    """The jerk is a / tj, 0, -a / tj, 0, and then the same backwards."""
    a = law.speed / (law.ramp_s - law.jerk_s)
    corners_s = [law.jerk_s, law.ramp_s - law.jerk_s, law.ramp_s]
    corners_s = [0.0, *corners_s, *(law.duration_s - t_s for t_s in reversed(corners_s)), law.duration_s]
    expected = np.interp(t_s := np.linspace(0.0, law.duration_s, 501), corners_s, [0.0, a, a, 0.0, 0.0, -a, -a, 0.0])
    assert law.acceleration(t_s) == pytest.approx(expected, abs=1e-9 * abs(a))


@pytest.mark.slow
@given(s_curves())
def test_each_phase_is_one_cubic(law: SCurve) -> None:
    """The cubic through four points of a phase passes the fifth in its middle: a PVT segment is the law itself."""
    u, weights = (
        np.array([0.0, 0.25, 0.75, 1.0, 0.5]),
        np.array([-1.0, 4.0, 4.0, -1.0]) / 6.0,
    )  # Lagrange's coefficients at 1/2
    for begin_s, end_s in pairwise([0.0, *law.breakpoints_s, law.duration_s]):
        *around, middle = law.position(begin_s + (end_s - begin_s) * u)
        assert middle == pytest.approx(around @ weights, abs=1e-11 * abs(law.distance))


@pytest.mark.slow
@given(s_curves())
def test_between_the_ramps_the_speed_is_constant(law: SCurve) -> None:
    t_s = np.linspace(law.ramp_s, law.duration_s - law.ramp_s, 11)[1:-1]
    assert law.velocity(t_s) == pytest.approx(np.full(t_s.shape, law.speed), rel=1e-12)
    assert np.abs(law.acceleration(t_s)) == pytest.approx(np.zeros(t_s.shape), abs=1e-9 * abs(law.speed))


@given(s_curves())
def test_it_cuts_the_corners_of_the_trapezoid(law: SCurve) -> None:
    """With equal ramps both laws have the same speed between them and cover the same distance in each phase."""
    trapezoid = Trapezoid(law.distance, law.duration_s, law.ramp_s)
    t_s = np.array([law.ramp_s, law.duration_s / 2, law.duration_s - law.ramp_s])
    assert law.speed == trapezoid.speed
    assert law.position(t_s) == pytest.approx(trapezoid.position(t_s), rel=1e-9, abs=1e-12 * abs(law.distance))


@pytest.mark.parametrize(
    ("times_s", "words"),
    [
        ((10.0, 5.001, 1.0), ["ramp_s", "5.001 s", "at most 5 s", "duration_s"]),
        ((10.0, 0.0, 0.0), ["ramp_s", "0 s", "above 0"]),
        ((10.0, -2.0, -1.0), ["ramp_s", "-2 s", "above 0"]),
        ((10.0, 2.0, 1.001), ["jerk_s", "1.001 s", "at most 1 s", "ramp_s"]),
        ((10.0, 2.0, 0.0), ["jerk_s", "0 s", "above 0"]),
        ((10.0, 2.0, -1.0), ["jerk_s", "-1 s", "above 0"]),
        ((0.0, 2.0, 1.0), ["duration_s", "0 s", "above 0"]),
        ((-1.0, 2.0, 1.0), ["duration_s", "-1 s", "above 0"]),
        ((10.0005, 2.0, 1.0), ["duration_s", "10.0005 s", "millisecond"]),
        ((10.0, 2.0005, 1.0), ["ramp_s", "2.0005 s", "millisecond"]),
        ((10.0, 2.0, 0.0005), ["jerk_s", "0.0005 s", "millisecond"]),
        ((10.0, 2.0, float("nan")), ["jerk_s", "nan"]),
    ],
)
def test_times_that_are_refused(times_s: tuple[float, float, float], words: list[str]) -> None:
    told = complaint_of(lambda: SCurve(1.0, *times_s))
    for word in words:
        assert word in told


def test_times_at_their_bounds() -> None:
    assert SCurve(1.0, 10.0, 5.0, 2.5).breakpoints_s == (2.5, 5.0, 7.5)
    assert SCurve(1.0, 0.004, 0.002, 0.001).breakpoints_s == (0.001, 0.002, 0.003)
    assert SCurve(1.0, 0.6, 0.1 + 0.2, 0.15).breakpoints_s == (0.15, 0.3, 0.45)  # 0.30000000000000004 s is 300 ms
