"""Sections of an arm's workspace with its slides at home: the plan at a height, and the profile from the side.

Their areas are integrals over the radius about the arm's axis, of the azimuths or the heights within reach there:

    plan: A = integral of r w(r) dr, w in radians        profile: A = integral of h(r) dr

The ends of w and h are found by bisection. The radii are Gauss-Legendre nodes: they crowd towards both ends, where w
and h go to 0 like square roots.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np

from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.workspace.arm import Arm
from steptwin.host.robots.workspace.stretches import Region, Stretches, edges, extent, stretches, swapped, widths

_NODES: Final = 257
_RADII: Final = 129
_HEIGHTS: Final = 129
_AZIMUTHS_DEG: Final = np.linspace(-180.0, 180.0, 361)
"""The grid contains the directions of the axes, where symmetric arms have dead sectors, however narrow."""


@dataclass(frozen=True, slots=True, eq=False)
class PlanSection:
    """The tool positions within reach at one height.

    Attributes:
        z_mm: height of the section.
        radius_mm: least and greatest distance from the arm's axis; None if nothing is within reach.
        area_mm2: area of the section.
        radii_mm: shape (n,), the radii of the integral, rising.
        reachable_deg: shape (n,), the part of the circle at each radius that is within reach.
        boundary_mm: shape (m, 2), points x, y on the boundary, in no order.
    """

    z_mm: float
    radius_mm: tuple[float, float] | None
    area_mm2: float
    radii_mm: FloatArray
    reachable_deg: FloatArray
    boundary_mm: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ProfileSection:
    """The tool positions within reach in a half plane that begins at the arm's axis.

    Attributes:
        azimuth_deg: direction of the half plane.
        radius_mm: least and greatest distance from the arm's axis; None if nothing is within reach.
        z_mm: least and greatest height; None if nothing is within reach.
        area_mm2: area of the section.
        radii_mm: shape (n,), the radii of the integral, rising.
        reachable_mm: shape (n,), the height within reach at each radius.
        boundary_mm: shape (m, 2), points radius, z on the boundary, in no order.
    """

    azimuth_deg: float
    radius_mm: tuple[float, float] | None
    z_mm: tuple[float, float] | None
    area_mm2: float
    radii_mm: FloatArray
    reachable_mm: FloatArray
    boundary_mm: FloatArray


@dataclass(frozen=True, slots=True)
class Scan:
    """Both sections.

    Attributes:
        attitude_deg: attitude of the tool; None if any attitude is allowed.
        slides: positions of the slides, which shift the whole arm, by name, in mm.
        axis_x_mm: x of the arm's axis, which is at y = 0.
        plan: the section from above.
        profile: the section from the side.
    """

    attitude_deg: float | None
    slides: Mapping[str, float]
    axis_x_mm: float
    plan: PlanSection
    profile: ProfileSection


def scan(robot: Robot, attitude_deg: float | None = None, z_mm: float | None = None) -> Scan:
    """Return the plan at a height, by default the home position's, and the profile in the direction of home."""
    arm = Arm.of(robot, attitude_deg)
    radius_mm, lowest_mm, highest_mm = arm.box_mm()
    radii_mm = np.linspace(0.0, radius_mm, _RADII)
    plan = _plan(arm, arm.home_z_mm if z_mm is None else z_mm, radii_mm)
    profile = _profile(arm, radii_mm, np.linspace(lowest_mm, highest_mm, _HEIGHTS))
    return Scan(attitude_deg, arm.slides, arm.axis_x_mm, plan, profile)


def _plan(arm: Arm, z_mm: float, radii_mm: FloatArray) -> PlanSection:
    def region(radius_mm: FloatArray, azimuth_deg: FloatArray) -> BoolArray:
        return arm.reachable(radius_mm, azimuth_deg, np.full(len(radius_mm), z_mm))

    rows = _scanned(region, radii_mm, _AZIMUTHS_DEG)
    radius_mm, azimuth_rad = rows.edges[:, 0], np.deg2rad(rows.edges[:, 1])
    return PlanSection(
        z_mm=z_mm,
        radius_mm=rows.radius_mm,
        area_mm2=float(rows.weights_mm @ (rows.radii_mm * np.deg2rad(rows.widths))),
        radii_mm=rows.radii_mm,
        reachable_deg=rows.widths,
        boundary_mm=np.column_stack([arm.axis_x_mm + radius_mm * np.cos(azimuth_rad), radius_mm * np.sin(azimuth_rad)]),
    )


def _profile(arm: Arm, radii_mm: FloatArray, heights_mm: FloatArray) -> ProfileSection:
    azimuth_deg = arm.home_azimuth_deg

    def region(radius_mm: FloatArray, z_mm: FloatArray) -> BoolArray:
        return arm.reachable(radius_mm, np.full(len(radius_mm), azimuth_deg), z_mm)

    rows = _scanned(region, radii_mm, heights_mm)
    return ProfileSection(
        azimuth_deg=azimuth_deg,
        radius_mm=rows.radius_mm,
        z_mm=extent(region, rows.radii_mm, heights_mm, rows.found),
        area_mm2=float(rows.weights_mm @ rows.widths),
        radii_mm=rows.radii_mm,
        reachable_mm=rows.widths,
        boundary_mm=rows.edges,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """A section as rows of equal radius.

    Attributes:
        radius_mm: least and greatest radius; None if nothing is within reach.
        radii_mm: shape (n,), the radii of the rows.
        weights_mm: shape (n,), the weights of the rows in an integral over the radius.
        found: stretches of the other coordinate within reach.
        edges: shape (m, 2), radius and other coordinate of points on the boundary.
    """

    radius_mm: tuple[float, float] | None
    radii_mm: FloatArray
    weights_mm: FloatArray
    found: Stretches
    edges: FloatArray

    @property
    def widths(self) -> FloatArray:
        """Shape (n,): total length of the other coordinate within reach."""
        return widths(self.found, len(self.radii_mm))


@cache
def _gauss_legendre() -> tuple[FloatArray, FloatArray]:
    """Return nodes in -1..1 and their weights, each of shape (_NODES,): they take as long as all else of a scan."""
    return np.polynomial.legendre.leggauss(_NODES)


def _scanned(region: Region, radii_mm: FloatArray, across: FloatArray) -> _Rows:
    """Scan a region whose coordinates are the radius and another one, between the ends of both grids."""
    rays = stretches(swapped(region), across, radii_mm)
    ray_edges = edges(rays, across, radii_mm)[:, ::-1]
    radius_mm = extent(swapped(region), across, radii_mm, rays)
    if radius_mm is None:
        return _Rows(None, np.empty(0), np.empty(0), rays, ray_edges)
    nodes, weights = _gauss_legendre()
    half_mm = (radius_mm[1] - radius_mm[0]) / 2.0
    rows_mm = radius_mm[0] + half_mm * (1.0 + nodes)
    rows = stretches(region, rows_mm, across)
    return _Rows(radius_mm, rows_mm, half_mm * weights, rows, np.concatenate([edges(rows, rows_mm, across), ray_edges]))
