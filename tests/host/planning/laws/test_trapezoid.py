"""The trapezoidal time law, the law as the paper prints it, and times that are refused."""

import numpy as np
import pytest
from hypothesis import given

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.laws import Trapezoid
from tests.host.complaints import complaint_of
from tests.host.planning.laws.made import trapezoids

PULL = Trapezoid(180.0, 10.0, 2.0)


def test_the_drawer_by_hand() -> None:
    """22.5 mm/s reached with 11.25 mm/s^2 in 2 s."""
    t_s = np.array([0.0, 1.0, 2.0, 5.0, 8.0, 9.0, 10.0])
    assert PULL.speed == 22.5
    assert PULL.position(t_s).tolist() == [0.0, 5.625, 22.5, 90.0, 157.5, 174.375, 180.0]
    assert PULL.velocity(t_s).tolist() == [0.0, 11.25, 22.5, 22.5, 22.5, 11.25, 0.0]
    assert PULL.acceleration(t_s).tolist() == [11.25, 11.25, 0.0, 0.0, -11.25, -11.25, -11.25]
    assert PULL.breakpoints_s == (2.0, 8.0)


def test_ramps_that_meet_have_one_breakpoint() -> None:
    triangle = Trapezoid(-4.0, 0.4, 0.2)
    assert triangle.breakpoints_s == (0.2,)
    assert triangle.position(np.array([0.2])) == pytest.approx([-2.0])
    assert triangle.acceleration(np.array([0.1, 0.2, 0.3])) == pytest.approx([-100.0, 100.0, 100.0])


@given(trapezoids())
def test_at_a_jump_the_acceleration_is_the_value_after_it(law: Trapezoid) -> None:
    jumps_s = np.array(law.breakpoints_s)
    assert law.acceleration(jumps_s).tolist() == law.acceleration(jumps_s + 1e-7).tolist()


def as_printed(t_s: FloatArray, distance: float, duration_s: float, ramp_s: float) -> FloatArray:
    """Return the paper's formula: its first branch lacks the half, its third branch repeats the second."""
    v = distance / (duration_s - ramp_s)
    return np.where(t_s <= ramp_s, v * t_s**2 / ramp_s, v * (t_s - ramp_s / 2.0))


def test_the_printed_law_misses_the_180_mm() -> None:
    t_s = np.array([2.0, 2.0 + 1e-9, 10.0])
    printed = as_printed(t_s, 180.0, 10.0, 2.0)
    assert printed == pytest.approx([45.0, 22.5, 202.5])  # it jumps at the end of the ramp and then goes too far
    assert PULL.position(t_s) == pytest.approx([22.5, 22.5, 180.0])


@pytest.mark.parametrize(
    ("duration_s", "ramp_s", "words"),
    [
        (10.0, 5.001, ["ramp_s", "5.001", "at most 5 s"]),
        (10.0, 0.0, ["ramp_s", "0 s", "above 0"]),
        (10.0, -1.0, ["ramp_s", "-1 s"]),
        (0.0, 0.2, ["duration_s", "0 s", "above 0"]),
        (-1.0, 0.2, ["duration_s", "-1 s", "above 0"]),
        (1.0005, 0.2, ["duration_s", "1.0005", "millisecond"]),
        (1.0, 0.0015, ["ramp_s", "0.0015", "millisecond"]),
        (float("nan"), 0.2, ["duration_s", "nan"]),
        (float("inf"), 0.2, ["duration_s", "inf"]),
    ],
)
def test_times_that_are_refused(duration_s: float, ramp_s: float, words: list[str]) -> None:
    told = complaint_of(lambda: Trapezoid(1.0, duration_s, ramp_s))
    for word in words:
        assert word in told


def test_times_at_their_bounds() -> None:
    assert Trapezoid(1.0, 10.0, 5.0).speed == 0.2
    assert Trapezoid(1.0, 0.002, 0.001).breakpoints_s == (0.001,)
    assert Trapezoid(1.0, 0.1 + 0.2, 0.1).breakpoints_s == (0.1, 0.2)  # 0.30000000000000004 s is 300 ms
