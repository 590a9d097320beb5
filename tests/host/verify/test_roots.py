"""Solve functions whose roots are known with the vectorised root finder."""

from collections.abc import Callable

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.verify.oracle import IndexArray, bracketed_roots

TOLERANCE = 1e-12

FUNCTIONS: dict[str, tuple[Callable[[FloatArray], FloatArray], float, float, float]] = {
    "line": (lambda x: 3.0 - 4.0 * x, 0.0, 2.0, 0.75),
    "cube": (lambda x: x**3 - 2.0, 0.0, 5.0, 2.0 ** (1.0 / 3.0)),
    "cosine": (lambda x: np.cos(x) - x, 0.0, 1.5, 0.7390851332151607),
    "flat": (lambda x: (x - 0.3) ** 5, 0.0, 1.0, 0.3),
    "jump": (lambda x: np.where(x < 1.0 / 3.0, -1.0, 5.0), 0.0, 1.0, 1.0 / 3.0),
    "exponential": (lambda x: np.exp(20.0 * x) - 2.0, 0.0, 1.0, np.log(2.0) / 20.0),
}


def roots_of(names: list[str], tolerance: float = TOLERANCE) -> FloatArray:
    """Solve several functions at once, each in its own bracket."""

    def functions(x: FloatArray, which: IndexArray) -> FloatArray:
        return np.array([FUNCTIONS[names[i]][0](np.array(v)) for v, i in zip(x, which, strict=True)])

    index = np.arange(len(names))
    low, high = (np.array([FUNCTIONS[name][side] for name in names]) for side in (1, 2))
    return bracketed_roots(functions, low, high, functions(low, index), functions(high, index), tolerance)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_each_function_alone(name: str) -> None:
    accuracy = 1e-3 if name == "flat" else 2.0 * TOLERANCE  # a fifth power rounds to zero far from its root
    assert abs(roots_of([name])[0] - FUNCTIONS[name][3]) <= accuracy


def test_all_functions_together_give_the_same_roots() -> None:
    together = roots_of(list(FUNCTIONS))
    assert together.tolist() == [roots_of([name])[0] for name in FUNCTIONS]


def test_roots_at_the_ends_and_empty_brackets_need_no_evaluation() -> None:
    def forbidden(x: FloatArray, which: IndexArray) -> FloatArray:
        raise AssertionError(f"evaluated at {x} for {which}")

    low, high = np.array([0.0, 0.0, 5.0]), np.array([1.0, 1.0, 5.0])
    roots = bracketed_roots(forbidden, low, high, np.array([0.0, -1.0, 2.0]), np.array([1.0, 0.0, 2.0]), TOLERANCE)
    assert roots.tolist() == [0.0, 1.0, 5.0]


def test_a_smooth_function_takes_few_evaluations() -> None:
    calls = 0

    def function(x: FloatArray, which: IndexArray) -> FloatArray:
        nonlocal calls
        calls += 1
        return np.sin(x) - np.linspace(0.0, 0.8, 100)[which]

    n = 100
    low, high = np.zeros(n), np.ones(n)
    roots = bracketed_roots(function, low, high, function(low, np.arange(n)), function(high, np.arange(n)), TOLERANCE)
    np.testing.assert_allclose(roots, np.arcsin(np.linspace(0.0, 0.8, n)), atol=2.0 * TOLERANCE, rtol=0.0)
    assert calls <= 2 + 12
