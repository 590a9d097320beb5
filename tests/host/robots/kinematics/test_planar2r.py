"""The two-link arm: hand cases, both elbows, the edge of reach, and the Jacobian against finite differences."""

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.robots.kinematics import Elbow, Planar2R
from tests.messages import refusing

ARM = Planar2R(200.0, 150.0)


def at(*values: float) -> FloatArray:
    return np.array(values)


def test_a_right_angle_by_hand() -> None:
    th1, th2 = ARM.inverse(at(200.0), at(150.0), Elbow.RIGHT)
    assert np.rad2deg(th1) == pytest.approx([0.0])
    assert np.rad2deg(th2) == pytest.approx([90.0])


def test_the_elbows_mirror_each_other_in_the_line_to_the_wrist() -> None:
    """th2' = -th2 and th1' = th1 + 2 atan2(l2 sin th2, l1 + l2 cos th2)."""
    x, y = at(200.0, -120.0, 30.0), at(150.0, -200.0, 99.0)
    right, left = ARM.inverse(x, y, Elbow.RIGHT), ARM.inverse(x, y, Elbow.LEFT)
    assert np.all(right[1] > 0)
    assert left[1] == pytest.approx(-right[1])
    swing = np.arctan2(150.0 * np.sin(right[1]), 200.0 + 150.0 * np.cos(right[1]))
    assert left[0] == pytest.approx(right[0] + 2 * swing)


@pytest.mark.parametrize("elbow", Elbow)
def test_forward_undoes_inverse(elbow: Elbow) -> None:
    generator = np.random.default_rng(1)
    radius, angle = generator.uniform(50.0, 350.0, 10_000), generator.uniform(-np.pi, np.pi, 10_000)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    found_x, found_y = ARM.forward(*ARM.inverse(x, y, elbow))
    assert np.hypot(found_x - x, found_y - y).max() < 1e-9


class TestTheEdgeOfReach:
    """Wrist distances of 50 and 350 mm. A c2 tolerance of 1e-9 is 8.6e-8 mm outside, 6e-7 mm inside."""

    @pytest.mark.parametrize("elbow", Elbow)
    def test_both_edges_are_reached(self, elbow: Elbow) -> None:
        _, th2 = ARM.inverse(at(350.0, 0.0), at(0.0, -50.0), elbow)
        assert np.abs(np.rad2deg(th2)) == pytest.approx([0.0, 180.0], abs=1e-5)
        assert ARM.reach_mm == (50.0, 350.0)

    @pytest.mark.parametrize("distance_mm", [350.0 + 5e-8, 50.0 - 4e-7])
    def test_rounding_errors_beyond_the_edge_are_allowed(self, distance_mm: float) -> None:
        th1, th2 = ARM.inverse(at(distance_mm), at(0.0), Elbow.RIGHT)
        assert np.isfinite([th1, th2]).all()
        assert ARM.forward(th1, th2)[0] == pytest.approx([distance_mm], abs=1e-6)

    @pytest.mark.parametrize("distance_mm", [350.0 + 2e-7, 50.0 - 1e-6, 0.0, 1e9])
    def test_more_is_out_of_reach(self, distance_mm: float) -> None:
        assert np.isnan(ARM.inverse(at(distance_mm), at(0.0), Elbow.LEFT)).all()


def test_a_pose_out_of_reach_does_not_disturb_its_neighbours() -> None:
    th1, _ = ARM.inverse(at(200.0, 400.0, 200.0), at(150.0, 0.0, 150.0), Elbow.RIGHT)
    assert np.isnan(th1).tolist() == [False, True, False]
    assert th1[0] == th1[2]


def test_joint_velocities_are_those_of_finite_differences() -> None:
    generator = np.random.default_rng(2)
    th1, th2 = generator.uniform(-3.0, 3.0, 1000), generator.uniform(0.2, 2.9, 1000) * generator.choice([-1, 1], 1000)
    w1, w2 = generator.uniform(-1.0, 1.0, (2, 1000))
    h = 1e-6
    ahead, behind = ARM.forward(th1 + h * w1, th2 + h * w2), ARM.forward(th1 - h * w1, th2 - h * w2)
    vx, vy = ((a - b) / (2 * h) for a, b in zip(ahead, behind, strict=True))
    found_w1, found_w2 = ARM.joint_velocities(th1, th2, vx, vy)
    assert found_w1 == pytest.approx(w1, abs=1e-6)
    assert found_w2 == pytest.approx(w2, abs=1e-6)


def test_the_determinant_vanishes_where_the_arm_is_stretched_or_folded() -> None:
    assert ARM.determinant(np.deg2rad(at(0.0, 90.0, -90.0, 180.0))) == pytest.approx([0, 30_000, -30_000, 0], abs=1e-8)
    with np.errstate(all="raise"):  # a singular pose gives no numpy warning
        speeds = ARM.joint_velocities(at(0.0), at(0.0), at(1.0), at(0.0))
    assert not np.isfinite(speeds).any()


@pytest.mark.parametrize("links", [(0.0, 150.0), (200.0, -1.0), (float("nan"), 150.0), (200.0, float("nan"))])
def test_links_must_be_longer_than_0(links: tuple[float, float]) -> None:
    with refusing(InputError):
        Planar2R(*links)
