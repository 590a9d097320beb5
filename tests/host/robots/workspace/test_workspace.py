"""Workspaces: the cloud's figures, the sections against closed forms worked out here, and the search for boundaries."""

import dataclasses
from collections.abc import Iterable
from functools import cache
from math import pi
from typing import Any

import numpy as np
import pytest

from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.usual_scara import Lift
from steptwin.host.robots.workspace import SAMPLES_MAX, Scan, monte_carlo, orientation_words, scan
from steptwin.host.robots.workspace.sections import edges, extent, stretches, swapped, widths
from tests.host.robots.kinematics.test_usual_scara import scara
from tests.messages import refusing


@cache
def scanned(robot: str, attitude_deg: float | None = None) -> Scan:
    return scan(load_robot(robot), attitude_deg)


class TestMonteCarlo:
    def test_the_laboratory_arm(self) -> None:
        cloud = monte_carlo(load_robot("lab-scara"), 100_000, 1)
        assert (cloud.samples, cloud.seed, cloud.counted, cloud.left_out) == (100_000, 1, 100_000, 0)
        assert cloud.radius_mm == pytest.approx((338.099917, 800.0), abs=1e-6)
        assert cloud.z_mm == pytest.approx((-150.0, 100.0), abs=0.01)

    def test_joints_are_drawn_one_after_the_other_in_chunks_of_any_size(self) -> None:
        robot, samples = load_robot("lab-scara"), 70_000
        rng = np.random.default_rng(3)
        joints = np.column_stack([rng.uniform(joint.lower, joint.upper, samples) for joint in robot.joints])
        positions_mm = make_kinematics(robot).forward(joints)[:, :3]
        radius_mm = np.hypot(positions_mm[:, 0], positions_mm[:, 1])
        cloud = monte_carlo(robot, samples, 3)
        assert cloud.radius_mm == pytest.approx((radius_mm.min(), radius_mm.max()), abs=1e-12)
        assert cloud.z_mm == pytest.approx((positions_mm[:, 2].min(), positions_mm[:, 2].max()), abs=1e-12)
        np.testing.assert_allclose(cloud.cloud_mm, positions_mm[:20_000], rtol=0.0, atol=1e-12)

    def test_a_seed_reproduces_its_cloud(self) -> None:
        robot = load_robot("teaching-scara")
        first, again, other = (monte_carlo(robot, 1000, seed) for seed in (5, 5, 6))
        np.testing.assert_array_equal(first.cloud_mm, again.cloud_mm)
        assert first.radius_mm == again.radius_mm
        assert first.radius_mm != other.radius_mm

    def test_samples_that_the_mechanism_cannot_take_are_left_out(self) -> None:
        """|z2| <= 150, with z2 = D k / 2 and k = sqrt(4 L^2 / (4 h^2 + D^2) - 1) of the sliders' distance D."""
        cloud = monte_carlo(load_robot("hybrid-arm"), 50_000, 2)
        rng = np.random.default_rng(2)
        _, z5_mm, z6_mm, _ = (rng.uniform(-limit, limit, 50_000) for limit in (170.0, 250.0, 250.0, 360.0))
        distance_mm = z5_mm - z6_mm
        z2_mm = distance_mm / 2.0 * np.sqrt(4.0 * 350.0**2 / (300.0**2 + distance_mm**2) - 1.0)
        assert cloud.counted == np.count_nonzero(np.abs(z2_mm) <= 150.0)
        assert 0 < cloud.left_out < 50_000
        assert cloud.radius_mm == pytest.approx((250.0, 550.0), abs=0.1)
        radius_mm = np.hypot(cloud.cloud_mm[:, 0], cloud.cloud_mm[:, 1])
        assert 250.0 <= radius_mm.min() <= radius_mm.max() <= 550.0

    def test_a_sample_that_does_not_count_leaves_no_figures(self) -> None:
        cloud = monte_carlo(load_robot("hybrid-arm"), 1, 2)
        assert (cloud.counted, cloud.left_out) == (0, 1)
        assert cloud.radius_mm is cloud.z_mm is None
        assert cloud.cloud_mm.shape == (0, 3)

    def test_slides_move_too(self) -> None:
        """Slides of 2000 and 1000 mm, a reach of 390 mm, heights of the arm from 10 to 160 mm."""
        cloud = monte_carlo(load_robot("warehouse-scara"), 100_000, 1)
        assert cloud.radius_mm is not None
        assert cloud.z_mm is not None
        assert 2300.0 < cloud.radius_mm[1] <= 2390.0
        assert 10.0 <= cloud.z_mm[0] < 20.0
        assert 1150.0 < cloud.z_mm[1] <= 1160.0

    @pytest.mark.parametrize("samples", [-1, 0, SAMPLES_MAX + 1])
    def test_too_few_or_too_many(self, samples: int) -> None:
        with refusing(InputError):
            monte_carlo(load_robot("lab-scara"), samples, 1)

    def test_a_negative_seed_is_refused(self) -> None:
        with refusing(InputError):
            monte_carlo(load_robot("lab-scara"), 10, -1)


def reachable_rad(l1_mm: float, l2_mm: float, shoulder_deg: float, elbow_rad: FloatArray) -> FloatArray:
    """Return the part of a circle that two links reach with the shoulder within +- a limit, at an elbow's angle.

    The right arm's wrist is b = atan2(l2 sin e, l1 + l2 cos e) to the left of the upper arm, the left arm's b to the
    right. The two arcs overlap and make 2 (limit + b), at most the whole circle.
    """
    b_rad = np.arctan2(l2_mm * np.sin(elbow_rad), l1_mm + l2_mm * np.cos(elbow_rad))
    width_rad: FloatArray = np.minimum(2.0 * (np.deg2rad(shoulder_deg) + b_rad), 2.0 * pi)
    return width_rad


def planar_area_mm2(l1_mm: float, l2_mm: float, shoulder_deg: float, elbow_deg: float) -> float:
    """Integrate r w dr over the elbow's angle e: r dr = -l1 l2 sin e de."""
    elbow_rad = np.linspace(0.0, np.deg2rad(elbow_deg), 200_001)
    width_rad = reachable_rad(l1_mm, l2_mm, shoulder_deg, elbow_rad)
    return float(np.trapezoid(width_rad * l1_mm * l2_mm * np.sin(elbow_rad), elbow_rad))


ARMS = {
    "lab-scara": (400.0, 400.0, 150.0, 130.0),
    "teaching-scara": (95.0, 100.0, 130.0, 150.0),
    "calibration-scara": (250.0, 350.0, 130.0, 145.0),
}
"""Lengths of both links, and limits of shoulder and elbow."""

REACHES = {
    "lab-scara": (338.094609393, 800.0),
    "teaching-scara": (50.700270, 195.0),
    "calibration-scara": (204.079377325, 600.0),
    "warehouse-scara": (62.657078, 390.0),
    "hybrid-arm": (250.0, 550.0),
}
"""Warehouse: with the elbow at 150 degrees the wrist is at 102.657078 mm, and the tool may point 40 mm inwards."""

HEIGHTS = {
    "lab-scara": (-150.0, 100.0),
    "teaching-scara": (-100.0, -40.0),
    "calibration-scara": (100.0, 300.0),
    "warehouse-scara": (10.0, 160.0),
    "hybrid-arm": (346.227766, 846.227766),
}


SLOW = "warehouse-scara", "teaching-scara", "calibration-scara", "ar4-mk3"
"""Robots whose workspace takes too long to be computed in every run."""


def robots(names: Iterable[str]) -> list[Any]:
    return [pytest.param(name, marks=pytest.mark.slow if name in SLOW else ()) for name in names]


class TestSections:
    @pytest.mark.slow
    @pytest.mark.parametrize("robot", robots(REACHES))
    def test_reaches(self, robot: str) -> None:
        sections = scanned(robot)
        assert sections.plan.radius_mm == pytest.approx(REACHES[robot], abs=1e-6)
        assert sections.profile.radius_mm == pytest.approx(REACHES[robot], abs=1e-6)
        assert sections.profile.z_mm == pytest.approx(HEIGHTS[robot], abs=1e-6)

    @pytest.mark.parametrize(
        "robot", robots([*REACHES, "ar4-mk3"])
    )  # other arms are scanned by the same code as the AR4
    def test_by_default_at_home(self, robot: str) -> None:
        loaded, sections = load_robot(robot), scanned(robot)
        x_mm, y_mm, z_mm, *_ = make_kinematics(loaded).forward(np.array([loaded.home]))[0]
        assert sections.plan.z_mm == z_mm
        assert sections.profile.azimuth_deg == pytest.approx(np.rad2deg(np.arctan2(y_mm, x_mm)), abs=1e-12)
        assert sections.attitude_deg is None

    def test_the_laboratory_arms_area(self) -> None:
        assert scanned("lab-scara").plan.area_mm2 == pytest.approx(1_622_522.690, rel=1e-6)

    @pytest.mark.parametrize("robot", robots(ARMS))
    def test_areas_of_two_links(self, robot: str) -> None:
        sections = scanned(robot)
        assert sections.plan.area_mm2 == pytest.approx(planar_area_mm2(*ARMS[robot]), rel=1e-5)
        depth_mm = np.ptp(REACHES[robot])
        assert sections.profile.area_mm2 == pytest.approx(depth_mm * np.ptp(HEIGHTS[robot]), rel=1e-7)

    @pytest.mark.parametrize("robot", robots(ARMS))
    def test_full_circles_and_dead_sectors(self, robot: str) -> None:
        """The scan finds even narrow dead sectors, because they lie about an axis, which is on its grid."""
        l1_mm, l2_mm, shoulder_deg, _ = ARMS[robot]
        plan = scanned(robot).plan
        elbow_rad = np.arccos((plan.radii_mm**2 - l1_mm**2 - l2_mm**2) / (2.0 * l1_mm * l2_mm))
        expected_deg = np.rad2deg(reachable_rad(l1_mm, l2_mm, shoulder_deg, elbow_rad))
        np.testing.assert_allclose(plan.reachable_deg, expected_deg, rtol=0.0, atol=1e-6)

    def test_the_laboratory_arms_dead_sector(self) -> None:
        """Beyond 800 cos 30 deg, about -Y, half as wide as 30 degrees - th3 / 2."""
        plan = scanned("lab-scara").plan
        th3_deg = np.rad2deg(2.0 * np.arccos(plan.radii_mm / 800.0))
        full = plan.radii_mm <= 692.820323
        assert 0 < np.count_nonzero(full) < len(full)
        np.testing.assert_allclose(plan.reachable_deg[full], 360.0, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(plan.reachable_deg[~full], 360.0 - (60.0 - th3_deg[~full]), rtol=0.0, atol=1e-6)
        x_mm, y_mm = plan.boundary_mm.T
        outside = np.hypot(x_mm, y_mm) > 692.9
        sector = outside & (np.hypot(x_mm, y_mm) < 799.9)
        assert (y_mm[sector] < 0.0).all()
        assert x_mm[sector].max() == pytest.approx(-x_mm[sector].min(), abs=1e-6)

    @pytest.mark.slow
    def test_the_warehouse_arm_in_one_attitude_is_the_wrists_region_shifted(self) -> None:
        sections = scanned("warehouse-scara", 17.25)
        assert sections.attitude_deg == 17.25
        assert sections.plan.area_mm2 == pytest.approx(planar_area_mm2(200.0, 150.0, 120.0, 150.0), rel=1e-4)
        shift_mm = 40.0 * np.array([np.cos(np.deg2rad(17.25)), np.sin(np.deg2rad(17.25))])
        wrist_mm = np.hypot(*(sections.plan.boundary_mm - shift_mm).T)
        assert (wrist_mm.min(), wrist_mm.max()) == pytest.approx((102.657078, 350.0), abs=1e-6)

    @pytest.mark.slow
    def test_the_warehouse_arm_in_any_attitude(self) -> None:
        """The area is that of the points of a polar grid at which one of many attitudes has the wrist in its region.

        How far the wrist is from the shoulder depends on the tool's angle to the point's azimuth, not on the azimuth.
        """
        radius_mm = np.linspace(60.0, 392.0, 250)
        azimuth_rad = np.deg2rad(np.arange(-179.5, 180.0, 1.0))
        tool_rad = np.deg2rad(np.arange(0.0, 360.0, 3.0))
        wrist = radius_mm[:, None] - 40.0 * np.exp(1j * tool_rad)
        cosine = (np.abs(wrist) ** 2 - 200.0**2 - 150.0**2) / (2.0 * 200.0 * 150.0)
        width_rad = reachable_rad(200.0, 150.0, 120.0, np.arccos(np.clip(cosine, -1.0, 1.0)))
        bends = (cosine <= 1.0) & (cosine >= np.cos(np.deg2rad(150.0)))
        wrist_rad = azimuth_rad[:, None] + np.angle(wrist)[:, None, :]
        turns = 2.0 * np.abs((wrist_rad + pi) % (2.0 * pi) - pi) <= width_rad[:, None, :]
        within = bends[:, None, :] & turns
        circles_mm = radius_mm * 2.0 * pi * within.any(axis=2).mean(axis=1)
        area_mm2 = scanned("warehouse-scara").plan.area_mm2
        assert area_mm2 == pytest.approx(float(np.trapezoid(circles_mm, radius_mm)), rel=3e-3)

    @pytest.mark.slow
    def test_slides_away_from_zero_carry_the_sections_along(self) -> None:
        robot = load_robot("warehouse-scara")
        there = dataclasses.replace(robot, home=(700.0, 400.0, *robot.home[2:]))
        moved, still = scan(there, 17.25), scanned("warehouse-scara", 17.25)
        assert (moved.axis_mm, moved.slides) == ((700.0, 0.0), {"sx": 700.0, "sz": 400.0})
        assert (still.axis_mm, still.slides) == ((0.0, 0.0), {"sx": 0.0, "sz": 0.0})
        assert moved.plan.z_mm == still.plan.z_mm + 400.0
        assert moved.plan.area_mm2 == pytest.approx(still.plan.area_mm2, rel=1e-9)
        assert moved.profile.azimuth_deg == pytest.approx(still.profile.azimuth_deg, abs=1e-9)
        assert moved.profile.z_mm == pytest.approx((410.0, 560.0), abs=1e-6)
        expected_mm = still.plan.boundary_mm + np.array([700.0, 0.0])
        np.testing.assert_allclose(moved.plan.boundary_mm, expected_mm, rtol=0.0, atol=1e-6)

    def test_the_hybrid_arm(self) -> None:
        """Each height is the sliders' stroke minus the difference of the links' rises, at z2 = radius - 400."""
        sections = scanned("hybrid-arm")
        profile = sections.profile
        assert profile.area_mm2 == pytest.approx(126_839.592, rel=1e-5)
        z2_mm = profile.radii_mm - 400.0
        left_mm, right_mm = (np.sqrt(350.0**2 - (z2_mm + side * 150.0) ** 2) for side in (1, -1))
        np.testing.assert_allclose(profile.reachable_mm, 500.0 - np.abs(left_mm - right_mm), rtol=0.0, atol=1e-6)
        assert sections.plan.area_mm2 == pytest.approx(pi * (550.0**2 - 250.0**2) * 340.0 / 360.0, rel=1e-9)

    def test_out_of_reach(self) -> None:
        sections = scan(load_robot("teaching-scara"), z_mm=0.0)
        assert (sections.plan.z_mm, sections.plan.radius_mm, sections.plan.area_mm2) == (0.0, None, 0.0)
        assert sections.plan.radii_mm.shape == sections.plan.reachable_deg.shape == (0,)
        assert sections.plan.boundary_mm.shape == (0, 2)
        assert sections.profile.area_mm2 > 0.0

    @pytest.mark.slow
    def test_a_wrist_that_cannot_turn_limits_an_attitude(self) -> None:
        """With th4 within +-10 degrees, th1 + th2 must be within 10 degrees of the attitude."""
        robot = load_robot("teaching-scara")
        stiff = dataclasses.replace(robot.joints[3], lower=-10.0, upper=10.0)
        narrow = scan(dataclasses.replace(robot, joints=(*robot.joints[:3], stiff)), 0.0)
        assert 0.0 < narrow.plan.area_mm2 < 0.5 * scanned("teaching-scara").plan.area_mm2
        assert np.max(np.abs(narrow.plan.boundary_mm[:, 1])) <= 95.0 + 100.0 * np.sin(np.deg2rad(10.0)) + 1e-6

    @pytest.mark.parametrize("robot", robots(ARMS))
    def test_boundary_points_are_on_the_edge_of_reach(self, robot: str) -> None:
        """One micrometre to one side of each point is within reach, to the other side out of reach."""
        kinematics, plan = make_kinematics(load_robot(robot)), scanned(robot).plan
        for beyond_mm in (-1e-3, 1e-3):
            points_mm = plan.boundary_mm * (1.0 + beyond_mm / np.hypot(*plan.boundary_mm.T))[:, None]
            poses = np.column_stack([points_mm, np.full(len(points_mm), plan.z_mm), np.zeros(len(points_mm))])
            reached = np.logical_or.reduce([branch.reachable for branch in kinematics.inverse(poses)])
            if beyond_mm < 0.0:
                inwards = reached
        assert (inwards != reached).all()


def disc(x: FloatArray, y: FloatArray) -> BoolArray:
    """A disc with its centre at (0.3, 0.2) and radius 1."""
    return np.asarray((x - 0.3) ** 2 + (y - 0.2) ** 2 <= 1.0)


class TestStretches:
    def test_chords(self) -> None:
        lines, grid = np.array([-2.0, -0.5, 0.3, 1.1]), np.linspace(-3.0, 3.0, 31)
        found = stretches(disc, lines, grid)
        half = np.sqrt(1.0 - (lines[1:] - 0.3) ** 2)
        assert found.line.tolist() == [1, 2, 3]
        np.testing.assert_allclose(found.begin, 0.2 - half, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(found.end, 0.2 + half, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(widths(found, len(lines)), [0.0, *(2.0 * half)], rtol=0.0, atol=1e-11)

    def test_several_on_a_line(self) -> None:
        found = stretches(lambda x, y: np.asarray(np.sin(x * y) > 0.0), np.array([1.0]), np.linspace(0.5, 9.5, 20))
        np.testing.assert_allclose(found.begin, [0.5, 2 * pi], rtol=0.0, atol=1e-11)
        np.testing.assert_allclose(found.end, [pi, 3 * pi], rtol=0.0, atol=1e-11)

    def test_edges_are_not_where_the_grid_ends(self) -> None:
        lines, grid = np.array([0.3]), np.linspace(0.2, 2.0, 10)
        found = stretches(disc, lines, grid)
        assert found.begin.tolist() == [0.2]
        np.testing.assert_allclose(edges(found, lines, grid), [[0.3, 1.2]], rtol=0.0, atol=1e-12)

    @pytest.mark.parametrize("count", [8, 13])
    def test_an_extent_lies_between_the_lines(self, count: int) -> None:
        lines, grid = np.linspace(-2.0, 2.0, count) ** 3 / 4.0, np.linspace(-2.0, 2.0, 30)
        assert extent(disc, lines, grid, stretches(disc, lines, grid)) == pytest.approx((-0.8, 1.2), abs=1e-9)
        turned = swapped(disc)
        assert extent(turned, lines, grid, stretches(turned, lines, grid)) == pytest.approx((-0.7, 1.3), abs=1e-9)

    def test_a_region_with_nothing_inside(self) -> None:
        lines, grid = np.array([5.0, 6.0]), np.linspace(-1.0, 1.0, 5)
        found = stretches(disc, lines, grid)
        assert widths(found, 2).tolist() == [0.0, 0.0]
        assert extent(disc, lines, grid, found) is None
        assert edges(found, lines, grid).shape == (0, 2)


@pytest.mark.slow
@pytest.mark.parametrize("lift", Lift)
def test_a_tool_that_does_not_turn_reaches_the_annulus_of_its_arm(lift: Lift) -> None:
    """Links of 200 and 150 mm and an elbow of +-150 deg: 350 to sqrt(200^2 + 150^2 - 2 * 200 * 150 cos 30) mm."""
    robot = scara(lift, turning=False)
    least_mm = float(np.sqrt(200**2 + 150**2 - 2 * 200 * 150 * np.cos(np.deg2rad(30))))
    cloud = monte_carlo(robot, 2000, 1)
    assert cloud.left_out == 0
    assert cloud.radius_mm is not None
    assert least_mm <= cloud.radius_mm[0] < cloud.radius_mm[1] <= 350
    plan = scan(robot).plan
    assert plan.radius_mm == pytest.approx((least_mm, 350.0), abs=1e-3)
    turning = scan(scara(lift)).plan
    assert plan.area_mm2 == pytest.approx(turning.area_mm2, rel=1e-4)


def test_words_say_how_the_tool_is_turned_in_the_sections() -> None:
    """A tool that turns in space has the orientation that it has at home: its random positions reach farther."""
    assert orientation_words(load_robot("lab-scara"), None) == "any attitude"
    assert orientation_words(load_robot("lab-scara"), -30.0) == "attitude -30 deg"
    assert orientation_words(load_robot("ar4-mk3"), None) == "oriented as at home"
