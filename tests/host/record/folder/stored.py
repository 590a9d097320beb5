"""Share evidence with values in every array, a comparison of evidence, and a reader of a file's arrays."""

from pathlib import Path
from typing import Any

import numpy as np

from steptwin.host.verify import DriverLimit, DriverViolations, Phases
from steptwin.protocol.drivers import ActiveEdge
from tests.host.verify.motions import altered, expect, motion, perfect_evidence, sines, still

EVIDENCE = altered(
    perfect_evidence(expect(motion(0.5, sines([(20.0, 3.0, 0.0)]), still(7.5)), 80.0, 10.0)),
    violations=DriverViolations(
        (DriverLimit("clk_high", "CLK too short", 30.0, "us", "p. 8"), DriverLimit("hot", "", 170.0, "degC", "p. 9")),
        np.array([500, 500]),
        np.array([1, 0], np.int8),
        np.array([171.5, 29.0]),
    ),
    active_edge=ActiveEdge.FALLING,
    phases=Phases(
        np.array([100, 200]), np.array([0, 63], np.int32), np.array([0, -1515], np.int16), np.array([3000, 0], np.int16)
    ),
)
FINE = altered(
    EVIDENCE,
    phases=Phases(
        np.array([100, 200]),
        np.array([0, 4 * 16_000 - 1], np.int32),
        np.array([0, -1515], np.int16),
        np.array([3000, 0], np.int16),
        16_000,
    ),
)
"""An axis whose driver has 5 to 128 microsteps, beside one without finer steps than a sixteenth."""


def assert_same(first: object, second: object) -> None:
    """Compare dataclasses of numbers and arrays field by field."""
    if isinstance(first, np.ndarray):
        np.testing.assert_array_equal(first, second)
    elif hasattr(first, "__slots__"):
        assert type(first) is type(second)
        for name in first.__slots__:
            assert_same(getattr(first, name), getattr(second, name))
    elif isinstance(first, dict):
        assert isinstance(second, dict)
        assert list(first) == list(second)
        assert_same(tuple(first.values()), tuple(second.values()))
    elif isinstance(first, tuple):
        assert isinstance(second, tuple)
        for one, other in zip(first, second, strict=True):
            assert_same(one, other)
    else:
        assert first == second


def arrays_of(path: Path) -> dict[str, Any]:
    with np.load(path) as stored:
        return dict(stored)
