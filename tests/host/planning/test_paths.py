"""Tool paths: their poses, the derivatives of the poses, and points that are refused."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.paths import Arc, SampledPath, Smoothing, StraightLine, ToolPath, Turn
from steptwin.host.robots.poses import Pose
from tests.host.complaints import complaint_of
from tests.messages import refusing

ZIGZAG = np.array(
    [
        [0.0, 0.0, 0.0, 0.0],
        [30.0, 0.0, 0.0, 90.0],
        [30.0, 40.0, 0.0, 180.0],
        [30.0, 40.0, 12.0, 270.0],
        [-3.0, -4.0, 12.0, 500.0],
        [-8.0, -16.0, 12.0, 500.0],
    ]
)
"""A zigzag with legs of 30, 40, 12, 55 and 13 mm, whose attitude goes beyond a full turn."""

PATHS: dict[str, ToolPath] = {
    "line": StraightLine((1.0, 2.0, 3.0, -170.0), (31.0, -38.0, 15.0, 170.0)),
    "arc": Arc.through((10.0, 0.0, 5.0, 30.0), (0.0, 10.0, 5.0), (-10.0, 0.0, 5.0, -60.0)),
    "tilted arc": Arc.through((4.0, 0.0, 0.0, 0.0), (0.0, 7.0, 1.0), (-3.0, -2.0, 6.0, 400.0)),
    "c2 spline": SampledPath.through(ZIGZAG, Smoothing.C2_SPLINE),
    "akima": SampledPath.through(ZIGZAG, Smoothing.AKIMA),
    "turn": Turn((4.0, 5.0, 6.0, 170.0), -300.0),
}


def lengths_mm(path: ToolPath, n: int = 201) -> FloatArray:
    return np.linspace(0.0, path.length_mm, n)


def off_circle_mm(arc: Arc, points_mm: FloatArray) -> float:
    return float(np.abs(np.linalg.norm(points_mm - arc.centre_mm, axis=1) - arc.radius_mm).max())


@pytest.mark.parametrize("name", PATHS)
def test_derivatives_are_those_of_the_poses(name: str) -> None:
    """Compared with central differences over 1 um, not at the points, where Akima's second derivative jumps."""
    path, h_mm = PATHS[name], 1e-3
    s_mm = np.setdiff1d(lengths_mm(path)[1:-1], [30.0, 70.0, 82.0, 137.0])
    differences = (path.poses(s_mm + h_mm) - path.poses(s_mm - h_mm)) / (2 * h_mm)
    assert path.derivatives(s_mm) == pytest.approx(differences, abs=1e-6)


@pytest.mark.parametrize("name", ["line", "arc", "tilted arc"])
def test_lines_and_arcs_are_travelled_at_unit_speed(name: str) -> None:
    path = PATHS[name]
    derivatives = path.derivatives(lengths_mm(path))
    assert np.linalg.norm(derivatives[:, :3], axis=1) == pytest.approx(np.ones(201), abs=1e-12)
    attitude_deg = path.poses(lengths_mm(path))[:, 3]
    assert np.diff(attitude_deg) == pytest.approx(np.full(200, (attitude_deg[-1] - attitude_deg[0]) / 200), abs=1e-9)


def test_a_line_by_hand() -> None:
    line = StraightLine((0.0, 0.0, 0.0, 10.0), (3.0, -4.0, 12.0, 36.0))
    assert line.length_mm == 13.0
    assert line.poses(np.array([0.0, 6.5, 13.0])) == pytest.approx(
        np.array([[0, 0, 0, 10], [1.5, -2, 6, 23], [3, -4, 12, 36]])
    )


class TestArc:
    @pytest.mark.parametrize(
        ("via_mm", "goal", "sweep_deg"),
        [
            ((0.0, 10.0, 5.0), (-10.0, 0.0, 5.0, 0.0), 180.0),
            ((8.0, 6.0, 5.0), (0.0, 10.0, 5.0, 0.0), 90.0),
            ((8.0, -6.0, 5.0), (0.0, 10.0, 5.0, 0.0), 270.0),
            ((-10.0, 0.0, 5.0), (8.0, -6.0, 5.0, 0.0), 323.13010235415595),
            ((-10.0, 0.0, 5.0), (8.0, 6.0, 5.0, 0.0), 323.13010235415595),
            ((-10.0, 0.0, 5.0), (10.0 * np.cos(1e-3), 10.0 * np.sin(1e-3), 5.0, 0.0), 360.0 - 0.18 / np.pi),
        ],
    )
    def test_on_a_circle_of_10_mm(self, via_mm: tuple[float, float, float], goal: Pose, sweep_deg: float) -> None:
        arc = Arc.through((10.0, 0.0, 5.0, 0.0), via_mm, goal)
        assert arc.radius_mm == pytest.approx(10.0)
        assert arc.centre_mm == pytest.approx([0.0, 0.0, 5.0], abs=1e-7)
        assert np.rad2deg(arc.sweep_rad) == pytest.approx(sweep_deg)
        assert arc.length_mm == pytest.approx(10.0 * np.deg2rad(sweep_deg))

    @pytest.mark.slow
    @given(st.tuples(*[st.floats(-100.0, 100.0)] * 9))
    def test_through_three_points_anywhere(self, numbers: tuple[float, ...]) -> None:
        """The arc begins at the first point, ends at the third and passes the second in between."""
        a, b, c = np.reshape(numbers, (3, 3))
        sides_mm = [np.linalg.norm(p - q) for p, q in ((a, b), (b, c), (a, c))]
        assume(np.linalg.norm(np.cross(b - a, c - a)) > 0.05 * max(sides_mm) ** 2)
        assume(max(sides_mm) > 0.1)
        ax, ay, az, bx, by, bz, cx, cy, cz = numbers
        arc = Arc.through((ax, ay, az, -20.0), (bx, by, bz), (cx, cy, cz, 70.0))
        poses = arc.poses(lengths_mm(arc))
        assert poses[0] == pytest.approx([*a, -20.0], abs=1e-9)
        assert poses[-1] == pytest.approx([*c, 70.0], abs=1e-9)
        assert 0.0 < arc.sweep_rad < 2.0 * np.pi
        assert off_circle_mm(arc, poses[:, :3]) < 1e-9
        ahead = b - arc.centre_mm
        via_mm = arc.radius_mm * (np.arctan2(ahead @ arc.onward, ahead @ arc.outward) % (2.0 * np.pi))
        assert 0.0 < via_mm < arc.length_mm
        assert arc.poses(np.array([via_mm]))[0, :3] == pytest.approx(b, abs=1e-9)

    def test_in_a_tilted_plane(self) -> None:
        """The unit circle around (1, 1, 1) in the plane that u and w span."""
        u, w = np.array([1.0, 2.0, 2.0]) / 3.0, np.array([2.0, 1.0, -2.0]) / 3.0
        a, b, c = ((1.0 + np.cos(t) * u + np.sin(t) * w).tolist() for t in (0.0, 2.0, 4.0))
        arc = Arc.through((*a, 0.0), tuple(b), (*c, 0.0))
        assert (arc.radius_mm, arc.sweep_rad) == pytest.approx((1.0, 4.0))
        angles = np.linspace(0.0, 4.0, 81)
        expected = 1.0 + np.outer(np.cos(angles), u) + np.outer(np.sin(angles), w)
        assert arc.poses(angles)[:, :3] == pytest.approx(expected, abs=1e-12)

    @pytest.mark.parametrize(
        ("start", "via_mm", "goal"),
        [
            ((0.0, 0.0, 0.0, 0.0), (1.0, 2.0, 3.0), (2.0, 4.0, 6.0, 0.0)),
            ((0.0, 0.0, 0.0, 0.0), (2.0, 4.0, 6.0), (1.0, 2.0, 3.0, 0.0)),
            ((0.0, 0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (0.0, 0.0, 0.0, 90.0)),
            ((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (5.0, 0.0, 0.0, 0.0)),
            ((1.0, 1.0, 1.0, 0.0), (1.0, 1.0, 1.0), (1.0, 1.0, 1.0, 0.0)),
            ((0.0, 0.0, 0.0, 0.0), (50.0, 5e-8, 0.0), (100.0, 0.0, 0.0, 0.0)),
            ((0.1, 0.1, 0.0, 0.0), (0.2, 0.2, 0.0), (0.3, 0.3, 0.0, 0.0)),
            ((0.0, 0.0, 0.0, 0.0), (float("nan"), 0.0, 0.0), (5.0, 0.0, 0.0, 0.0)),
        ],
    )
    def test_points_on_a_line_are_refused(self, start: Pose, via_mm: tuple[float, float, float], goal: Pose) -> None:
        with refusing(InputError) as caught:
            Arc.through(start, via_mm, goal)
        for point in (start[:3], via_mm, goal[:3]):
            assert str(point) in str(caught.value)

    def test_nearly_on_a_line(self) -> None:
        arc = Arc.through((0.0, 0.0, 0.0, 0.0), (50.0, 2e-7, 0.0), (100.0, 0.0, 0.0, 0.0))
        assert arc.length_mm == pytest.approx(100.0)
        assert arc.poses(np.array([0.0, 50.0, 100.0]))[:, 0] == pytest.approx([0.0, 50.0, 100.0], abs=1e-4)


class TestSampledPath:
    @pytest.mark.parametrize("smoothing", Smoothing)
    def test_it_passes_its_poses(self, smoothing: Smoothing) -> None:
        """Its parameter at a pose is the polygon's length up to it."""
        path = SampledPath.through(ZIGZAG, smoothing)
        assert path.length_mm == 150.0
        assert path.poses(np.array([0.0, 30.0, 70.0, 82.0, 137.0, 150.0])) == pytest.approx(ZIGZAG, abs=1e-10)

    @pytest.mark.parametrize("smoothing", Smoothing)
    def test_on_a_line_it_is_the_line(self, smoothing: Smoothing) -> None:
        on_line = np.outer([0.0, 1.0, 2.5, 7.0], [2.0, -1.0, 2.0, 15.0])
        path = SampledPath.through(on_line, smoothing)
        line = StraightLine((0.0, 0.0, 0.0, 0.0), (14.0, -7.0, 14.0, 105.0))
        assert path.length_mm == pytest.approx(21.0)
        s_mm = np.linspace(0.0, 21.0, 101)
        assert path.poses(s_mm) == pytest.approx(line.poses(s_mm), abs=1e-9)
        assert path.derivatives(s_mm) == pytest.approx(line.derivatives(s_mm), abs=1e-9)

    def test_the_spline_bends_evenly(self) -> None:
        """At a pose its second derivative is continuous, while Akima's jumps."""
        jumps = {}
        for smoothing in Smoothing:
            slopes = SampledPath.through(ZIGZAG, smoothing).derivatives(70.0 + np.array([-2e-6, -1e-6, 1e-6, 2e-6]))
            bends = (slopes[[1, 3]] - slopes[[0, 2]]) / 1e-6
            jumps[smoothing] = np.abs(bends[1] - bends[0]).max()
        assert jumps[Smoothing.C2_SPLINE] < 1e-5
        assert jumps[Smoothing.AKIMA] > 1e-2

    def test_akima_does_not_overshoot_beside_a_corner(self) -> None:
        """Measured as the distance of the curve from the straight leg before the corner's leg."""
        corner = np.array([[x, y, 0, 0] for x, y in ((0, 0), (10, 0), (20, 0), (30, 0), (30, 10), (30, 20), (30, 30))])
        beside_mm = {
            smoothing: np.abs(SampledPath.through(corner, smoothing).poses(np.linspace(0.0, 20.0, 201))[:, 1]).max()
            for smoothing in Smoothing
        }
        assert beside_mm[Smoothing.AKIMA] < 1e-12
        assert beside_mm[Smoothing.C2_SPLINE] > 0.1

    @pytest.mark.parametrize("smoothing", Smoothing)
    @pytest.mark.parametrize(
        ("poses", "message"),
        [
            (ZIGZAG[:0], "a curve through 0 poses: it takes at least 3"),
            (ZIGZAG[:2], "a curve through 2 poses: it takes at least 3"),
            (ZIGZAG[[0, 1, 1, 2]], "poses 2 and 3 of the curve are at the same place"),
            (ZIGZAG[[0, 1, 2]] * [1, 0, 1, 1], "poses 2 and 3 of the curve are at the same place"),
            (ZIGZAG[:3] * [1, np.nan, 1, 1], "poses 1 and 2 of the curve are at the same place"),
        ],
    )
    def test_refusals(self, smoothing: Smoothing, poses: FloatArray, message: str) -> None:
        told = complaint_of(lambda: SampledPath.through(poses, smoothing))
        assert told == message

    @pytest.mark.parametrize("smoothing", Smoothing)
    def test_three_poses_are_enough(self, smoothing: Smoothing) -> None:
        path = SampledPath.through(ZIGZAG[:3], smoothing)
        assert path.poses(np.array([0.0, 30.0, 70.0])) == pytest.approx(ZIGZAG[:3], abs=1e-12)


@pytest.mark.parametrize("attitude_deg", [0.0, 90.0])
def test_a_line_without_length_is_refused(attitude_deg: float) -> None:
    with refusing(InputError):
        StraightLine((1.0, 2.0, 3.0, 0.0), (1.0, 2.0, 3.0, attitude_deg))
