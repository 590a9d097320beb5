"""Motions through points: against exact arithmetic, against scipy, and the error for each kind of wrong time."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import Akima1DInterpolator

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.sampled import (
    AKIMA_POINTS_MIN,
    Spline,
    akima_spline,
    c2_spline,
    check_times,
    hermite_spline,
)
from tests.host.complaints import complaint_of
from tests.laws import law_of
from tests.messages import refusing

NAMES = ("a", "b")
FACTORIES = ("c2_spline", "akima")


def made(factory: str, times_s: FloatArray, positions: FloatArray) -> Motion:
    makers = {"c2_spline": c2_spline, "akima": akima_spline, "hermite": at_rest_everywhere}
    return makers[factory](NAMES[: positions.shape[1]], times_s, positions)


def at_rest_everywhere(names: tuple[str, ...], times_s: FloatArray, positions: FloatArray) -> Motion:
    return hermite_spline(names, times_s, positions, np.zeros_like(positions))


@st.composite
def samples(draw: st.DrawFn) -> tuple[FloatArray, FloatArray]:
    """Draw 3 to 12 points of two joints, 20 to 500 ms apart, as for a machine."""
    gaps_ms = draw(st.lists(st.integers(20, 500), min_size=2, max_size=11))
    position = st.floats(-180.0, 180.0)
    rows = draw(st.lists(st.tuples(position, position), min_size=len(gaps_ms) + 1, max_size=len(gaps_ms) + 1))
    return np.cumsum([0, *gaps_ms]) / 1000, np.array(rows)


def complaint(factory: str, times_s: list[float]) -> str:
    return complaint_of(lambda: made(factory, np.array(times_s), np.zeros((len(times_s), 1))))


class TestEveryKind:
    @pytest.mark.slow
    @pytest.mark.parametrize("factory", [*FACTORIES, "hermite"])
    @given(points=samples())
    def test_goes_through_all_points_from_rest_to_rest(
        self, factory: str, points: tuple[FloatArray, FloatArray]
    ) -> None:
        times_s, positions = points
        motion: Motion = made(factory, times_s, positions)
        assert motion.joint_names == NAMES
        assert motion.duration_s == times_s[-1]
        assert motion.output_changes == ()
        assert motion.positions(times_s) == pytest.approx(positions, abs=1e-9)
        assert motion.velocities(times_s[[0, -1]]) == pytest.approx(0.0, abs=1e-9)  # the planner's tolerance

    @pytest.mark.slow
    @pytest.mark.parametrize("factory", [*FACTORIES, "hermite"])
    @given(points=samples(), part=st.floats(0.1, 0.9))
    def test_velocity_and_acceleration_are_the_derivatives(
        self, factory: str, points: tuple[FloatArray, FloatArray], part: float
    ) -> None:
        """Compared with differences inside each piece, where the position is a cubic and the velocity a quadratic."""
        times_s, positions = points
        motion = made(factory, times_s, positions)
        gaps_s = np.diff(times_s)
        t_s, h_s = times_s[:-1] + part * gaps_s, 0.05 * gaps_s
        wide, narrow = (
            (motion.positions(t_s + h) - motion.positions(t_s - h)) / (2 * h[:, np.newaxis]) for h in (2 * h_s, h_s)
        )
        size = np.abs(positions).max() / gaps_s.min()
        assert motion.velocities(t_s) == pytest.approx((4 * narrow - wide) / 3, abs=1e-10 * size + 1e-12)
        slope = (motion.velocities(t_s + h_s) - motion.velocities(t_s - h_s)) / (2 * h_s[:, np.newaxis])
        assert law_of(motion, Spline).accelerations(t_s) == pytest.approx(
            slope, abs=1e-10 * size / gaps_s.min() + 1e-12
        )

    @pytest.mark.slow
    @pytest.mark.parametrize("factory", [*FACTORIES, "hermite"])
    @given(points=samples())
    def test_acceleration_is_largest_at_the_points(self, factory: str, points: tuple[FloatArray, FloatArray]) -> None:
        times_s, positions = points
        motion = made(factory, times_s, positions)
        near = np.concatenate([times_s[:-1], np.nextafter(times_s[1:], 0.0)])  # each point from both sides
        at_points = np.abs(law_of(motion, Spline).accelerations(near)).max(axis=0)
        between = np.abs(law_of(motion, Spline).accelerations(np.linspace(0.0, times_s[-1], 301))).max(axis=0)
        assert np.all(between <= at_points * (1 + 1e-9) + 1e-9)

    @pytest.mark.parametrize("factory", [*FACTORIES, "hermite"])
    def test_shapes(self, factory: str) -> None:
        motion = made(factory, np.array([0.0, 0.5, 1.0]), np.ones((3, 2)))
        for function in (motion.positions, motion.velocities, law_of(motion, Spline).accelerations):
            assert function(np.linspace(0.0, 1.0, 7)).shape == (7, 2)
            assert function(np.zeros(0)).shape == (0, 2)

    @pytest.mark.parametrize("factory", [*FACTORIES, "hermite"])
    def test_joints_are_independent(self, factory: str) -> None:
        times_s, positions = np.array([0.0, 0.2, 0.7, 1.0]), np.array([[0.0, 9.0], [1.0, -5.0], [4.0, 2.0], [2.0, 0.0]])
        t_s = np.linspace(0.0, 1.0, 50)
        both = made(factory, times_s, positions).positions(t_s)
        for i in range(2):
            assert made(factory, times_s, positions[:, [i]]).positions(t_s)[:, 0] == pytest.approx(both[:, i])


class TestC2Spline:
    @pytest.mark.slow
    @given(points=samples())
    def test_acceleration_does_not_jump(self, points: tuple[FloatArray, FloatArray]) -> None:
        """Its value from the left is extrapolated from the piece before, in which it is a straight line."""
        times_s, positions = points
        motion = c2_spline(NAMES, times_s, positions)
        before, middle = times_s[:-2], (times_s[:-2] + times_s[1:-1]) / 2
        from_the_left = 2 * law_of(motion, Spline).accelerations(middle) - law_of(motion, Spline).accelerations(before)
        size = np.abs(positions).max() / np.diff(times_s).min() ** 2
        assert law_of(motion, Spline).accelerations(times_s[1:-1]) == pytest.approx(
            from_the_left, abs=1e-10 * size + 1e-12
        )
        assert motion.breakpoints_s == ()

    def test_two_points_are_one_cubic(self) -> None:
        motion = c2_spline(("a",), np.array([0.0, 2.0]), np.array([[1.0], [5.0]]))
        u = np.linspace(0.0, 1.0, 9)
        assert motion.positions(2 * u)[:, 0] == pytest.approx(1 + 4 * (3 * u**2 - 2 * u**3))
        assert motion.velocities(np.array([1.0]))[0, 0] == pytest.approx(3.0)
        assert law_of(motion, Spline).accelerations(np.array([0.0, 2.0]))[:, 0] == pytest.approx([6.0, -6.0])

    def test_four_points_solved_by_hand(self) -> None:
        """Two equations, h1 m0 + 2 (h0 + h1) m1 + h0 m2 = 3 (h1 d0 + h0 d1) and the next, with Cramer's rule."""
        t = [Fraction(0), Fraction(1, 2), Fraction(5, 4), Fraction(2)]
        y = [Fraction(10), Fraction(-3), Fraction(7), Fraction(8)]
        h = [t[i + 1] - t[i] for i in range(3)]
        d = [(y[i + 1] - y[i]) / h[i] for i in range(3)]
        diagonal = 2 * (h[0] + h[1]), 2 * (h[1] + h[2])
        right = 3 * (h[1] * d[0] + h[0] * d[1]), 3 * (h[2] * d[1] + h[1] * d[2])
        determinant = diagonal[0] * diagonal[1] - h[0] * h[2]
        slopes = [
            Fraction(0),
            (right[0] * diagonal[1] - h[0] * right[1]) / determinant,
            (diagonal[0] * right[1] - h[2] * right[0]) / determinant,
            Fraction(0),
        ]
        motion = c2_spline(("a",), np.array(t, dtype=float), np.array(y, dtype=float)[:, np.newaxis])
        assert motion.velocities(np.array(t, dtype=float))[:, 0] == pytest.approx(np.array(slopes, dtype=float))
        for i in range(3):
            for u in (Fraction(1, 7), Fraction(1, 2), Fraction(9, 10)):
                exact = (
                    y[i] * (1 + 2 * u) * (1 - u) ** 2
                    + y[i + 1] * u**2 * (3 - 2 * u)
                    + h[i] * (slopes[i] * u * (1 - u) ** 2 - slopes[i + 1] * u**2 * (1 - u))
                )
                at_s = np.array([float(t[i] + u * h[i])])
                assert motion.positions(at_s)[0, 0] == pytest.approx(float(exact), rel=1e-12)

    def test_inner_times_may_be_anything(self) -> None:
        times_s = np.array([0.0, 1 / 3, 0.77777, 1.0])
        motion = c2_spline(("a",), times_s, np.array([[0.0], [1.0], [2.0], [3.0]]))
        assert motion.positions(times_s)[:, 0] == pytest.approx([0.0, 1.0, 2.0, 3.0])
        assert motion.breakpoints_s == ()


class TestAkima:
    @pytest.mark.slow
    @given(points=samples())
    def test_is_scipys_away_from_the_ends(self, points: tuple[FloatArray, FloatArray]) -> None:
        times_s, positions = points
        inside_s = np.linspace(times_s[1], times_s[-2], 101)
        expected = Akima1DInterpolator(times_s, positions)(inside_s)
        assert akima_spline(NAMES, times_s, positions).positions(inside_s) == pytest.approx(expected, abs=1e-9)

    def test_does_not_overshoot_beside_a_step(self) -> None:
        """A C2 spline overshoots there; Akima's slopes avoid it."""
        times_s = np.arange(9.0)
        step = np.where(times_s < 4.5, 0.0, 10.0)[:, np.newaxis]
        rest_s = np.linspace(0.0, 3.0, 100)
        assert akima_spline(("a",), times_s, step).positions(rest_s) == pytest.approx(0.0, abs=1e-12)
        assert np.abs(c2_spline(("a",), times_s, step).positions(rest_s)).max() > 0.1

    def test_inner_points_are_breakpoints(self) -> None:
        motion = akima_spline(("a",), np.array([0.0, 0.1, 0.3, 0.7, 1.0]), np.zeros((5, 1)))
        assert motion.breakpoints_s == (0.1, 0.3, 0.7)

    def test_takes_three_points(self) -> None:
        assert AKIMA_POINTS_MIN == 3
        assert complaint("akima", [0.0, 1.0]) == "2 points: Akima's spline takes at least 3"
        assert complaint("akima", []) == "0 points: Akima's spline takes at least 3"


class TestHermite:
    def test_is_exact_on_a_cubic(self) -> None:
        """Each joint has its own cubic; the times are uneven."""
        cubics = [np.polynomial.Polynomial([3.0, -2.0, 5.0, -1.5]), np.polynomial.Polynomial([-1.0, 0.0, 0.0, 4.0])]
        times_s = np.array([0.0, 0.125, 0.7, 0.701, 2.0])
        positions, velocities = (np.column_stack([cubic.deriv(order)(times_s) for cubic in cubics]) for order in (0, 1))
        motion = hermite_spline(NAMES, times_s, positions, velocities)
        t_s = np.linspace(0.0, 2.0, 101)
        for order, function in enumerate([motion.positions, motion.velocities, law_of(motion, Spline).accelerations]):
            expected = np.column_stack([cubic.deriv(order)(t_s) for cubic in cubics])
            assert function(t_s) == pytest.approx(expected, abs=1e-6 if order == 2 else 1e-9)
        assert motion.breakpoints_s == (0.125, 0.7, 0.701)

    def test_breakpoints_are_whole_milliseconds_to_the_last_bit(self) -> None:
        """The float sum 0.1 + 0.1 + 0.1 is not 0.3, but the planner's time is."""
        times_s = np.cumsum([0.0, 0.1, 0.1, 0.1, 0.1])
        assert times_s[3] != 0.3
        assert hermite_spline(("a",), times_s, *np.zeros((2, 5, 1))).breakpoints_s == (0.1, 0.2, 0.3)


class TestBadTimes:
    @pytest.mark.parametrize("factory", [*FACTORIES, "hermite"])
    @pytest.mark.parametrize(
        "times_s",
        [
            pytest.param([0.1, 0.5, 1.0], id="late"),
            pytest.param([-0.1, 0.5, 1.0], id="early"),
            pytest.param(
                [0.0, 0.5, 0.5, 1.0],
                id="twice",
            ),
            pytest.param(
                [0.0, 0.5, 0.4, 1.0],
                id="backwards",
            ),
            pytest.param(
                [0.0, 1e-300, 1.0],
                id="too near",
            ),
            pytest.param([0.0, np.nan, 1.0], id="nan"),
            pytest.param([np.nan, 0.5, 1.0], id="nan first"),
            pytest.param([0.0, np.inf, np.inf], id="inf"),
            pytest.param(
                [0.0, 0.5, 1.0004],
                id="end",
            ),
        ],
        ids=str,
    )
    def test_wrong_times_are_refused(self, factory: str, times_s: list[float]) -> None:
        complaint(factory, times_s)

    @pytest.mark.parametrize("factory", [*FACTORIES, "hermite"])
    def test_the_nearest_millisecond_is_never_0(self, factory: str) -> None:
        """At 0 the motion begins."""
        assert complaint(factory, [0.0, 0.0001, 0.0002]).endswith("milliseconds: the nearest is 0.001 s")

    @pytest.mark.parametrize("factory", ["akima", "hermite"])
    def test_breakpoints_between_milliseconds(self, factory: str) -> None:
        assert complaint(factory, [0.0, 0.2, 0.5003, 1.0]) == (
            "the time of point 3: 0.5003 s is not a whole number of milliseconds: the nearest is 0.5 s"
        )

    @pytest.mark.parametrize("factory", ["c2_spline", "hermite"])
    @pytest.mark.parametrize("times_s", [[], [0.0]])
    def test_too_few_points(self, factory: str, times_s: list[float]) -> None:
        assert complaint(factory, times_s) == f"{len(times_s)} points: a motion takes at least 2"

    def test_errors_name_the_place(self) -> None:
        with refusing(InputError):
            check_times(np.array([0.5, 1.0]), ["row 7", "row 8"])

    @pytest.mark.parametrize("factory", [*FACTORIES, "hermite"])
    def test_arrays_of_different_lengths_are_a_mistake_in_the_program(self, factory: str) -> None:
        with refusing(ValueError):
            made(factory, np.array([0.0, 0.5, 1.0]), np.zeros((4, 1)))
