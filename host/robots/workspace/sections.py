"""Sections of an arm's workspace with its slides at home: the plan at a height, and the profile from the side.

Their areas are integrals over the radius about the arm's axis, of the azimuths or the heights within reach there:

    plan: A = integral of r w(r) dr, w in radians        profile: A = integral of h(r) dr

The ends of w and h are found by bisection. The radii are Gauss-Legendre nodes: they crowd towards both ends, where w
and h go to 0 like square roots.

On a line of constant first coordinate the second one is tested on a grid. Every change between outside and inside is
refined by bisection, on all lines at once. A stretch or gap that is narrower than the grid may be missed.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import check_planning_time, in_planning_time, planning_step
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
from steptwin.host.robots.poses import SCARA
from steptwin.host.robots.poses.rotations import of_rotation_vector
from steptwin.host.robots.robot import Robot

ATTITUDES: Final = 36
"""Number of attitudes tried, evenly spaced, if any attitude is allowed.

Attitudes in between would widen the reach of a tool at the distance l from the wrist's axis by at most
l (1 - cos 5 deg), 0.4 % of l.
"""

_STRIDES: Final = (9, 3, 1)
"""Steps of rounds over the other attitudes, every ninth first: most positions within reach need no other round."""

_CHUNK: Final = 1 << 12
"""Number of poses solved at once: their arrays fit in the processor's cache."""

_PROBES: Final = 4096
"""Number of random joint positions from which the box is estimated."""
_MARGIN: Final = 0.1
"""Fraction by which the estimated box is enlarged to contain the whole workspace."""


@dataclass(frozen=True, slots=True, eq=False)
class ArmReach:
    """A robot with its slides at their home positions.

    Attributes:
        robot: the whole machine.
        kinematics: the kinematics of the whole machine.
        home: shape (joints,), the home position, where the slides stay.
        axis_mm: x and y of the arm's own axis.
        attitude_deg: attitude of a SCARA's tool; None if any attitude is allowed. A tool that turns in space is always
            as at home, rotated about the arm's axis.
    """

    robot: Robot
    kinematics: Kinematics
    home: FloatArray
    axis_mm: tuple[float, float]
    attitude_deg: float | None

    @classmethod
    def of(cls, robot: Robot, attitude_deg: float | None) -> Self:
        """Return a robot's arm; raise InputError if its dimensions or joints are not its mechanism's.

        Also if the robot has no tool or no closed form of its inverse, or if its tool does not have the attitude.
        """
        kinematics, home = make_kinematics(robot), np.array(robot.home)
        if not has_sections(robot):
            raise InputError(f"{robot.name}: its inverse is no closed form: random joints alone show its workspace")
        if attitude_deg is not None:
            kinematics.task.check({"phi": attitude_deg}, None)
        return cls(robot, kinematics, home, kinematics.axis_mm(home), attitude_deg)

    @property
    def slides(self) -> dict[str, float]:
        """The positions of the slides, which shift the whole arm, by name, in mm."""
        return {self.robot.joint_names[column]: self.robot.home[column] for column, _ in self.kinematics.slides}

    @property
    def home_azimuth_deg(self) -> float:
        """The direction from the arm's axis to the tool in the home position."""
        x_mm, y_mm = self._home_pose[:2] - np.array(self.axis_mm)
        return float(np.rad2deg(np.arctan2(y_mm, x_mm)))

    @property
    def home_z_mm(self) -> float:
        """The tool's height in the home position."""
        return float(self._home_pose[2])

    def reachable(self, radius_mm: FloatArray, azimuth_deg: FloatArray, z_mm: FloatArray) -> BoolArray:
        """Return, of shape (n,), whether a branch reaches positions in cylindrical coordinates, each of shape (n,)."""
        x_mm, y_mm = self.points_mm(radius_mm, azimuth_deg).T
        if self.kinematics.task is not SCARA:
            return self._reached(self._as_at_home(np.column_stack([x_mm, y_mm, z_mm]), azimuth_deg))
        if self.attitude_deg is not None:
            return self._reached(np.column_stack([x_mm, y_mm, z_mm, np.full(len(x_mm), self.attitude_deg)]))
        if self.kinematics.attitude_follows:
            return self._reached(np.column_stack([x_mm, y_mm, z_mm, np.full(len(x_mm), np.nan)]))
        outwards = np.column_stack([x_mm, y_mm, z_mm, azimuth_deg])
        reached, turnable = self._solved(outwards)
        places = np.flatnonzero(turnable & ~reached)
        for begin in range(0, len(places), _CHUNK):
            with planning_step("the workspace"):
                check_planning_time()
            part = places[begin : begin + _CHUNK]
            reached[part] = self._reached_turned(outwards[part])
        return reached

    def _as_at_home(self, places_mm: FloatArray, azimuth_deg: FloatArray) -> FloatArray:
        """Return poses at places of shape (n, 3), oriented as at home, turned about the arm's axis by the azimuths."""
        task = self.kinematics.task
        if task.is_flat:
            return places_mm
        turns_deg = np.outer(azimuth_deg - self.home_azimuth_deg, [0.0, 0.0, 1.0])
        home = np.broadcast_to(self._home_pose[3:], (len(places_mm), task.width - 3))
        return np.column_stack([places_mm, task.carried(of_rotation_vector(turns_deg), home)])

    def points_mm(self, radius_mm: FloatArray, azimuth_deg: FloatArray) -> FloatArray:
        """Return x and y, of shape (n, 2), of positions in cylindrical coordinates, each of shape (n,)."""
        (x_mm, y_mm), azimuth_rad = self.axis_mm, np.deg2rad(azimuth_deg)
        return np.column_stack([x_mm + radius_mm * np.cos(azimuth_rad), y_mm + radius_mm * np.sin(azimuth_rad)])

    def box_mm(self) -> tuple[float, float, float]:
        """Return the largest radius, and the lowest and highest height, of a box around the workspace."""
        lower, upper = ([getattr(joint, bound) for joint in self.robot.joints] for bound in ("lower", "upper"))
        joints = np.random.default_rng(0).uniform(lower, upper, (_PROBES, len(lower)))
        for column, _ in self.kinematics.slides:
            joints[:, column] = self.home[column]
        poses = self.kinematics.forward(np.vstack([self.home, joints]))
        radius_mm = np.nanmax(np.hypot(*(poses[:, :2] - np.array(self.axis_mm)).T))
        lowest_mm, highest_mm = np.nanmin(poses[:, 2]), np.nanmax(poses[:, 2])
        margin_mm = _MARGIN * (highest_mm - lowest_mm)
        return float((1.0 + _MARGIN) * radius_mm), float(lowest_mm - margin_mm), float(highest_mm + margin_mm)

    @property
    def _home_pose(self) -> FloatArray:
        pose: FloatArray = self.kinematics.forward(self.home[None])[0]
        return pose

    def _reached_turned(self, outwards: FloatArray) -> BoolArray:
        """Return, of shape (n,), whether some branch reaches poses of shape (n, 4) in another of the attitudes."""
        reached, tried = np.zeros(len(outwards), np.bool_), {0}
        for stride in _STRIDES:
            turns_deg = np.array(
                [turn * 360.0 / ATTITUDES for turn in range(0, ATTITUDES, stride) if turn not in tried]
            )
            tried |= {*range(0, ATTITUDES, stride)}
            left = np.flatnonzero(~reached)
            poses = np.repeat(outwards[left], len(turns_deg), axis=0)
            poses[:, 3] += np.tile(turns_deg, len(left))
            found = self._reached(poses).reshape(len(left), len(turns_deg))
            reached[left] = np.logical_or.reduce(found, axis=1)
        return reached

    def _reached(self, poses: FloatArray) -> BoolArray:
        """Return, of shape (n,), whether some branch reaches poses of shape (n, 4)."""
        return self._solved(poses)[0]

    def _solved(self, poses: FloatArray) -> tuple[BoolArray, BoolArray]:
        """Return, each of shape (n,), whether some branch reaches poses of shape (n, 4), or may in another attitude."""
        reached, turnable = np.empty(len(poses), np.bool_), np.ones(len(poses), np.bool_)
        turning = self.kinematics.turning
        for begin in range(0, len(poses), _CHUNK):
            with planning_step("the workspace"):
                check_planning_time()
            part = slice(begin, begin + _CHUNK)
            branches = self.kinematics.inverse(poses[part], self.home)
            reached[part] = np.logical_or.reduce([branch.reachable for branch in branches])
            if turning is not None:
                turnable[part] = np.logical_or.reduce([branch.reachable_but_for(turning) for branch in branches])
        return reached, turnable


def orientation_words(robot: Robot, attitude_deg: float | None) -> str:
    """Return the tool's orientation in the sections as text: as at home about the arm's axis if it turns in space."""
    task = make_kinematics(robot).task
    if task is SCARA:
        return "any attitude" if attitude_deg is None else f"attitude {attitude_deg:g} deg"
    return "any orientation" if task.is_flat else "oriented as at home"


def has_sections(robot: Robot) -> bool:
    """Return whether a robot's workspace can be scanned: it has a tool, and a closed form of its inverse."""
    kinematics = make_kinematics(robot)
    return kinematics.task.width > 0 and kinematics.has_closed_form


Region = Callable[[FloatArray, FloatArray], BoolArray]
"""A function that returns whether points, given by their coordinates of shape (n,), are inside."""

_HALVINGS: Final = 40
"""Number of bisections that shrink a cell of the grid to rounding error."""

_PARTS: Final = 16
"""Number of parts into which a round of the search divides a few lines."""

_FEW_LINES: Final = 256

_ZOOM: Final = 8
"""Number of parts into which a zoom divides each of the two cells beside the best line."""

_ZOOMS: Final = 12
"""Number of zooms after which any cell has shrunk to rounding error."""

_LEVEL: Final = 1e-9
"""An extreme is found if three neighbouring lines are this close to it; two lines may be on its two sides."""


@dataclass(frozen=True, slots=True, eq=False)
class Stretches:
    """The parts of lines that are inside, in the order of the lines and along each; all arrays of shape (n,).

    Attributes:
        line: index of the line.
        begin: second coordinate of the part's beginning.
        end: second coordinate of its end.
    """

    line: NDArray[np.intp]
    begin: FloatArray
    end: FloatArray


def swapped(region: Region) -> Region:
    """Return the same region with its coordinates exchanged."""
    return lambda first, second: region(second, first)


def stretches(region: Region, lines: FloatArray, grid: FloatArray) -> Stretches:
    """Return the parts inside of lines, given by their first coordinates, between the ends of the grid."""
    inside = region(np.repeat(lines, len(grid)), np.tile(grid, len(lines))).reshape(len(lines), len(grid))
    changes = np.diff(np.pad(inside.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    begins, ends = np.nonzero(changes == 1), np.nonzero(changes == -1)
    outside = np.concatenate([np.maximum(begins[1] - 1, 0), np.minimum(ends[1], len(grid) - 1)])
    inner = np.concatenate([begins[1], ends[1] - 1])
    line = np.concatenate([begins[0], ends[0]])
    begin, end = np.split(_bisected(region, lines[line], grid[outside], grid[inner]), 2)
    return Stretches(begins[0], begin, end)


def widths(found: Stretches, lines: int) -> FloatArray:
    """Return, of shape (lines,), the length of each line that is inside."""
    total: FloatArray = np.bincount(found.line, found.end - found.begin, minlength=lines).astype(np.float64)
    return total


def edges(found: Stretches, lines: FloatArray, grid: FloatArray) -> FloatArray:
    """Return, of shape (m, 2), the points where lines enter or leave the region; not those where the grid ends."""
    first = lines[np.concatenate([found.line, found.line])]
    second = np.concatenate([found.begin, found.end])
    kept = (second > grid[0]) & (second < grid[-1])
    return np.column_stack([first[kept], second[kept]])


def extent(region: Region, lines: FloatArray, grid: FloatArray, found: Stretches) -> tuple[float, float] | None:
    """Return the least and the greatest second coordinate inside, also between the lines; None if nothing was found."""
    if not len(found.line):
        return None
    return (
        _least(region, lines, grid, found, lambda stretch: stretch.begin),
        -_least(region, lines, grid, found, lambda stretch: -stretch.end),
    )


def _least(
    region: Region, lines: FloatArray, grid: FloatArray, found: Stretches, value: Callable[[Stretches], FloatArray]
) -> float:
    """Return the least value of all stretches: zoom in around its line until neighbouring lines agree."""
    least = np.inf
    for _ in range(_ZOOMS):
        on_line = np.full(len(lines), np.inf)
        np.minimum.at(on_line, found.line, value(found))
        least = min(least, float(on_line.min()))
        level = on_line < least + _LEVEL
        if np.any(level[:-2] & level[1:-1] & level[2:]):
            break
        lines = _around(lines, int(on_line.argmin()))
        found = stretches(region, lines, grid)
    return least


def _around(lines: FloatArray, line: int) -> FloatArray:
    """Return closer lines between a line's two neighbours, rising and with the line itself."""
    below, above = lines[max(line - 1, 0)], lines[min(line + 1, len(lines) - 1)]
    return np.unique([np.linspace(below, lines[line], _ZOOM + 1), np.linspace(lines[line], above, _ZOOM + 1)])


def _bisected(region: Region, first: FloatArray, outside: FloatArray, inside: FloatArray) -> FloatArray:
    """Return the last second coordinates inside, between one outside and one inside; all of shape (n,).

    Each round halves the interval; for few lines it makes more parts, since a call for few points takes as long.
    """
    parts = _PARTS if len(first) <= _FEW_LINES else 2
    shares = np.arange(1, parts) / parts
    for _ in range(-(-_HALVINGS // (parts.bit_length() - 1))):
        between = outside[:, np.newaxis] + shares * (inside - outside)[:, np.newaxis]
        is_inside = region(np.repeat(first, parts - 1), between.ravel()).reshape(between.shape)
        ways = np.column_stack([outside, between, inside])
        entered = np.argmax(np.column_stack([is_inside, np.ones(len(first), bool)]), axis=1)
        at = np.arange(len(first))
        outside, inside = ways[at, entered], ways[at, entered + 1]
    return inside


_NODES: Final = 257
_RADII: Final = 129
_HEIGHTS: Final = 129
_AZIMUTHS_DEG: Final = np.linspace(-180.0, 180.0, 361)
"""The grid contains the directions of the base's axes, where symmetric arms have dead sectors, however narrow."""


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
        axis_mm: x and y of the arm's axis.
        plan: the section from above.
        profile: the section from the side.
    """

    attitude_deg: float | None
    slides: Mapping[str, float]
    axis_mm: tuple[float, float]
    plan: PlanSection
    profile: ProfileSection


@in_planning_time()
def scan(robot: Robot, attitude_deg: float | None = None, z_mm: float | None = None) -> Scan:
    """Return the plan at a height, by default the home position's, and the profile in the direction of home."""
    arm = ArmReach.of(robot, attitude_deg)
    radius_mm, lowest_mm, highest_mm = arm.box_mm()
    radii_mm = np.linspace(0.0, radius_mm, _RADII)
    plan = _plan(arm, arm.home_z_mm if z_mm is None else z_mm, radii_mm)
    profile = _profile(arm, radii_mm, np.linspace(lowest_mm, highest_mm, _HEIGHTS))
    return Scan(attitude_deg, arm.slides, arm.axis_mm, plan, profile)


def _plan(arm: ArmReach, z_mm: float, radii_mm: FloatArray) -> PlanSection:
    def region(radius_mm: FloatArray, azimuth_deg: FloatArray) -> BoolArray:
        return arm.reachable(radius_mm, azimuth_deg, np.full(len(radius_mm), z_mm))

    rows = _scanned(region, radii_mm, _AZIMUTHS_DEG + arm.robot.base.phi_deg)
    return PlanSection(
        z_mm=z_mm,
        radius_mm=rows.radius_mm,
        area_mm2=float(rows.weights_mm @ (rows.radii_mm * np.deg2rad(rows.widths))),
        radii_mm=rows.radii_mm,
        reachable_deg=rows.widths,
        boundary_mm=arm.points_mm(*rows.edges.T),
    )


def _profile(arm: ArmReach, radii_mm: FloatArray, heights_mm: FloatArray) -> ProfileSection:
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
    """Return nodes in -1..1 and their weights, each of shape (_NODES,); computing them takes as long as a scan."""
    return np.polynomial.legendre.leggauss(_NODES)


def _scanned(region: Region, radii_mm: FloatArray, across: FloatArray) -> _Rows:
    """Scan a region with the radius and another coordinate, between the ends of both grids."""
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
