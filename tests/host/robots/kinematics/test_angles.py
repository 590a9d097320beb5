"""Angles wrapped into one circle."""

import numpy as np
import pytest

from steptwin.host.robots.poses.rotations import wrapped_deg


@pytest.mark.parametrize(
    ("angle_deg", "wrapped"),
    [(0, 0), (180, 180), (-180, 180), (181, -179), (-181, 179), (360, 0), (540, 180), (-540, 180), (725, 5)],
)
def test_full_turns_are_removed(angle_deg: float, wrapped: float) -> None:
    assert wrapped_deg(np.array([angle_deg], dtype=np.float64)).tolist() == [wrapped]


def test_an_angle_in_the_circle_does_not_change_by_a_bit() -> None:
    angles_deg = np.random.default_rng(1).uniform(-180.0, 180.0, 10_000)
    assert wrapped_deg(angles_deg).tolist() == angles_deg.tolist()


def test_nothing_else_than_nan_stays_nan() -> None:
    wrapped = wrapped_deg(np.array([np.nan, 190.0, 3.0]))
    assert np.isnan(wrapped).tolist() == [True, False, False]
    assert wrapped[1:].tolist() == [-170.0, 3.0]
