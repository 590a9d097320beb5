"""The fastest motion along a path, against toppra, which solves the same problem by other code."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import toppra
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from toppra.algorithm import TOPPRA
from toppra.constraint import DiscretizationType, JointAccelerationConstraint, JointVelocityConstraint

from steptwin.features.fastest.corners import flowing
from steptwin.features.fastest.flow_path import FlowPath
from steptwin.features.fastest.pieces import PiecewisePath
from steptwin.features.fastest.rows import Rows
from steptwin.features.fastest.solve import fastest_squares
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import load_robot
from tests.features.fastest.paths import joint_legs

toppra.setup_logging("ERROR")
ROBOT = load_robot("teaching-scara")


class _Geometry(toppra.interpolator.AbstractGeometricPath):  # type: ignore[misc]
    """One of our paths as toppra asks for it."""

    def __init__(self, path: FlowPath | PiecewisePath) -> None:
        self._path = path

    def __call__(self, s: Any, order: int = 0) -> FloatArray:
        at = np.atleast_1d(np.asarray(s, np.float64))
        which = np.clip(np.searchsorted(self._path.starts, at, side="right") - 1, 0, len(self._path.pieces) - 1)
        rows = [
            self._path.pieces[i].joints(np.array([a - self._path.starts[i]]), order)[0]
            for i, a in zip(which, at, strict=True)
        ]
        return np.array(rows) if np.ndim(s) else rows[0]

    @property
    def dof(self) -> int:
        return 4

    @property
    def path_interval(self) -> FloatArray:
        return np.array([0.0, self._path.starts[-1]])


def duration_s(s: FloatArray, squares: FloatArray) -> float:
    roots, steps = np.sqrt(squares), np.diff(s)
    moved = steps > 0
    return float((2.0 * steps[moved] / (roots[:-1] + roots[1:])[moved]).sum())


def _by_toppra(path: FlowPath | PiecewisePath, s: FloatArray) -> float:
    speeds = np.array([joint.speed_max for joint in ROBOT.joints])
    accelerations = np.array([joint.acceleration_max for joint in ROBOT.joints])
    limits = [
        JointVelocityConstraint(np.column_stack([-speeds, speeds])),
        JointAccelerationConstraint(
            np.column_stack([-accelerations, accelerations]), discretization_scheme=DiscretizationType.Interpolation
        ),
    ]
    solver = TOPPRA(limits, _Geometry(path), gridpoints=s, solver_wrapper="seidel")
    _, speed, _ = solver.compute_parameterization(0, 0)
    assume(speed is not None and np.isfinite(speed).all())  # its solver gives up on some paths
    return duration_s(s, speed**2)


corners = st.lists(
    st.tuples(st.floats(-80, 80), st.floats(20, 110), st.floats(2, 58), st.floats(-150, 150)), min_size=3, max_size=4
).filter(lambda rows: min(np.abs(np.diff(rows, axis=0)).max(axis=1)) > 5.0)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(corners, st.floats(0.05, 0.45))
def test_takes_as_long_as_toppra_says(rows: list[tuple[float, ...]], part: float) -> None:
    legs = joint_legs(ROBOT, np.array(rows))
    lengths = [leg.length for leg in legs]
    path = flowing(ROBOT, legs, [part * min(pair) for pair in pairwise(lengths)]).path
    rates = path.rates()
    once = np.concatenate([[True], np.diff(rates.s) > 1e-9])  # toppra takes no place twice
    limits = path.limits()
    limits = type(limits)(limits.speeds[:, :4], limits.accelerations[:, :4], limits.tool)  # no step rate there
    rows_of = Rows(
        np.concatenate([rates.first, -rates.first], axis=1),
        np.concatenate([rates.second, -rates.second], axis=1),
        np.concatenate([limits.accelerations, limits.accelerations], axis=1),
        (limits.speeds / np.maximum(np.abs(rates.first), 1e-12)).min(axis=1) ** 2,
    )
    ours = duration_s(rates.s, fastest_squares(rates.s, rows_of))
    assert ours == pytest.approx(_by_toppra(path, rates.s[once]), rel=1e-4)


def test_keeps_every_row_at_both_ends_of_each_interval() -> None:
    """Random rows: what comes out is within all of them, and a little more speed anywhere is not."""
    random = np.random.default_rng(1)
    s = np.linspace(0.0, 1.0, 60)
    wave = np.cumsum(random.normal(size=(60, 3)), axis=0)
    first, second = np.sin(wave), np.cos(2.0 * wave)
    rows = Rows(
        np.concatenate([first, -first], axis=1),
        np.concatenate([second, -second], axis=1),
        np.full((60, 6), 2.0),
        np.full(60, 9.0),
    )
    squares = fastest_squares(s, rows)
    u = np.diff(squares) / (2.0 * np.diff(s))
    assert squares[0] == squares[-1] == 0.0
    for at in (slice(None, -1), slice(1, None)):
        assert (rows.a[at] * u[:, np.newaxis] + rows.b[at] * squares[at][:, np.newaxis] <= rows.c[at] + 1e-9).all()
    assert (squares <= 9.0 + 1e-9).all()
    use = np.maximum.reduce(
        [
            ((rows.a[at] * u[:, np.newaxis] + rows.b[at] * squares[at][:, np.newaxis]) / rows.c[at]).max(axis=1)
            for at in (slice(None, -1), slice(1, None))
        ]
    )
    assert (np.maximum(use, squares[1:] / 9.0) > 0.999).mean() > 0.9  # bang-bang: a limit is used nearly everywhere


def test_a_place_twice_has_the_limits_of_both_sides() -> None:
    s = np.array([0.0, 0.5, 0.5, 1.0])
    ones = np.ones((4, 1))
    rows = Rows(
        np.concatenate([ones, -ones], axis=1), np.zeros((4, 2)), np.full((4, 2), 10.0), np.array([9.0, 9.0, 4.0, 9.0])
    )
    assert fastest_squares(s, rows).tolist() == [0.0, 4.0, 4.0, 0.0]


@settings(max_examples=40, deadline=None)
@given(st.integers(2, 60), st.sampled_from([2, 8, 16]), st.integers(0, 2**31))
def test_the_loops_give_the_same_bits_plain_and_compiled(places: int, count: int, seed: int) -> None:
    pytest.importorskip("numba")
    random = np.random.default_rng(seed)
    s = np.cumsum(np.where(random.random(places) < 0.1, 0.0, random.random(places)))
    a, b = (np.hstack([half, -half]) for half in random.normal(size=(2, places, count // 2)))
    a[random.random(a.shape) < 0.05] = 0.0
    rows = Rows(a, b, 0.1 + np.abs(random.normal(size=a.shape)), 10.0 * random.random(places))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("steptwin.features.fastest.solve.find_spec", lambda _: None)
        plain = fastest_squares(s, rows)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("steptwin.features.fastest.solve._LONG", 0)
        assert fastest_squares(s, rows).tobytes() == plain.tobytes()
