"""Paths of the tool: straight lines, arcs, curves through sampled poses and rotations, as functions of the length.

For lengths s of shape (n,) in [0, length_mm], a path returns poses of shape (n, task.width) and their derivatives by s
in mm, which are tool velocities of shape (n, task.rates). The tool turns in proportion to the length. All paths are in
this file because each consists of a few formulas with this convention.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Final, Protocol, Self

import numpy as np
import scipy

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.planning.no_way import NO_WAY
from steptwin.host.robots.poses import Pose, Task, Turning

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline, PPoly


class OutOfReachError(InputError):
    """A path leaves the mechanism's reach, is too close to a singularity, or a joint leaves its limits."""


_PLACE: Final = 3
"""Number of columns of a position: x, y and z in mm."""


class ToolPath(Protocol):
    """A curve that the tool follows."""

    @property
    def length_mm(self) -> float:
        """Length of the path."""
        ...

    def poses(self, s_mm: FloatArray) -> FloatArray:
        """Return poses of shape (n, task.width)."""
        ...

    def derivatives(self, s_mm: FloatArray) -> FloatArray:
        """Return the poses' derivatives by s, of shape (n, task.rates), in mm/mm and deg/mm."""
        ...


@dataclass(frozen=True, slots=True)
class FreeAttitude:
    """A path with NaN as attitudes, for a tool without its own rotation."""

    path: ToolPath

    @property
    def length_mm(self) -> float:
        """The path's length."""
        return self.path.length_mm

    def poses(self, s_mm: FloatArray) -> FloatArray:
        """Return poses of shape (n, 4)."""
        poses = self.path.poses(s_mm)
        poses[:, 3] = np.nan
        return poses

    def derivatives(self, s_mm: FloatArray) -> FloatArray:
        """Return derivatives of shape (n, 4), 0 for the attitude."""
        derivatives = self.path.derivatives(s_mm)
        derivatives[:, 3] = 0.0
        return derivatives


@dataclass(frozen=True, slots=True)
class StraightLine:
    """A straight line in every column of a pose; raises InputError if both ends are at the same position."""

    start: Pose
    goal: Pose

    def __post_init__(self) -> None:
        if not self.length_mm > NO_WAY:
            raise InputError(f"a straight line of {self.length_mm:g} mm has both ends at one place")

    @property
    def length_mm(self) -> float:
        """Distance between the ends."""
        return float(np.linalg.norm(self._way[:3]))

    def poses(self, s_mm: FloatArray) -> FloatArray:
        """Return poses of shape (n, columns)."""
        return np.array(self.start) + s_mm[:, np.newaxis] * (self._way / self.length_mm)

    def derivatives(self, s_mm: FloatArray) -> FloatArray:
        """Return derivatives of shape (n, columns), all equal."""
        return np.tile(self._way / self.length_mm, (len(s_mm), 1))

    @property
    def _way(self) -> FloatArray:
        return np.subtract(self.goal, self.start)


@dataclass(frozen=True, slots=True, eq=False)
class Arc:
    """Part of a circle anywhere in space, or several turns of it; made by `through` or `around`.

    Attributes:
        centre_mm: shape (3,), the circle's centre.
        outward: shape (3,), unit vector from the centre to the start.
        onward: shape (3,), unit vector of the motion at the start.
        radius_mm: radius of the circle.
        sweep_rad: angle from start to goal, above 0; below 2 pi if made by `through`.
        attitudes_deg: phi at start and goal; None for an arc of positions without phi.
    """

    centre_mm: FloatArray
    outward: FloatArray
    onward: FloatArray
    radius_mm: float
    sweep_rad: float
    attitudes_deg: tuple[float, float] | None

    @classmethod
    def through(cls, start: Pose, via_mm: tuple[float, float, float], goal: Pose) -> Self:
        """Return the arc from a SCARA's pose, or a position, through a position to another one.

        Raises InputError if the three positions are on a line, or if two of them are equal.
        """
        a, b, c = np.array(start[:3]), np.array(via_mm), np.array(goal[:3])
        normal = np.cross(b - a, c - a)
        area = float(np.linalg.norm(normal))
        sides_mm = [float(np.linalg.norm(p - q)) for p, q in ((a, b), (b, c), (a, c))]
        if not (min(sides_mm) > NO_WAY and area > 1e-9 * max(sides_mm) ** 2):
            raise InputError(f"an arc through {start[:3]}, {via_mm} and {goal[:3]} mm: they lie on a line")
        centre = _centre(a, b, c, normal)
        radius_mm = float(np.linalg.norm(a - centre))
        outward = (a - centre) / radius_mm
        onward = np.cross(normal / area, outward)
        end = c - centre
        sweep_rad = float(np.arctan2(end @ onward, end @ outward)) % (2.0 * np.pi)
        return cls(centre, outward, onward, radius_mm, sweep_rad, (start[3], goal[3]) if len(start) > _PLACE else None)

    @classmethod
    def around(cls, start: Pose, centre_mm: tuple[float, float], sweep_deg: float, *, turned: bool) -> Self:
        """Return the horizontal arc from a pose or position around a vertical axis, counter-clockwise from above.

        A negative sweep is clockwise; one above 360 degrees makes several turns. With `turned`, phi turns with the arc,
        otherwise it is constant. Raises InputError if the start is on the axis.
        """
        centre = np.array([*centre_mm, start[2]])
        spoke = np.array(start[:3]) - centre
        radius_mm = float(np.linalg.norm(spoke))
        if not radius_mm > NO_WAY:
            raise InputError(f"a circle around x {centre_mm[0]:g}, y {centre_mm[1]:g} mm: the tool is at its centre")
        outward = spoke / radius_mm
        onward = np.sign(sweep_deg) * np.array([-outward[1], outward[0], 0.0])
        attitudes_deg = (start[3], start[3] + (sweep_deg if turned else 0.0)) if len(start) > _PLACE else None
        return cls(centre, outward, onward, radius_mm, abs(float(np.deg2rad(sweep_deg))), attitudes_deg)

    @property
    def length_mm(self) -> float:
        """Length of the arc."""
        return self.radius_mm * self.sweep_rad

    def poses(self, s_mm: FloatArray) -> FloatArray:
        """Return poses of shape (n, 4), or positions of shape (n, 3)."""
        angle = s_mm[:, np.newaxis] / self.radius_mm
        points = self.centre_mm + self.radius_mm * (np.cos(angle) * self.outward + np.sin(angle) * self.onward)
        if self.attitudes_deg is None:
            return np.asarray(points)
        start_deg, goal_deg = self.attitudes_deg
        return np.column_stack([points, start_deg + (goal_deg - start_deg) * s_mm / self.length_mm])

    def derivatives(self, s_mm: FloatArray) -> FloatArray:
        """Return derivatives of shape (n, 4) or (n, 3)."""
        angle = s_mm[:, np.newaxis] / self.radius_mm
        tangents = np.cos(angle) * self.onward - np.sin(angle) * self.outward
        if self.attitudes_deg is None:
            return np.asarray(tangents)
        start_deg, goal_deg = self.attitudes_deg
        return np.column_stack([tangents, np.full(len(s_mm), (goal_deg - start_deg) / self.length_mm)])


def _centre(a: FloatArray, b: FloatArray, c: FloatArray, normal: FloatArray) -> FloatArray:
    """Return the centre of the circle through three points, from the vectors of their triangle."""
    ab, ac = b - a, c - a
    offset = float(ac @ ac) * np.cross(normal, ab) + float(ab @ ab) * np.cross(ac, normal)
    return np.asarray(a + offset / (2.0 * float(normal @ normal)))


@dataclass(frozen=True, slots=True)
class Turn:
    """A rotation of a SCARA's tool at one position; its parameter is the angle in degrees instead of a length in mm."""

    start: Pose
    angle_deg: float

    @property
    def length_mm(self) -> float:
        """Size of the angle, in degrees."""
        return abs(self.angle_deg)

    def poses(self, s_mm: FloatArray) -> FloatArray:
        """Return poses of shape (n, 4), all at one position."""
        return np.array(self.start) + s_mm[:, np.newaxis] * self._rate

    def derivatives(self, s_mm: FloatArray) -> FloatArray:
        """Return derivatives of shape (n, 4), all equal."""
        return np.tile(self._rate, (len(s_mm), 1))

    @property
    def _rate(self) -> FloatArray:
        return np.array([0.0, 0.0, 0.0, np.sign(self.angle_deg)])


@dataclass(frozen=True, slots=True)
class OnTheSpot:
    """A path at one position while the tool turns; its parameter is the angle in degrees."""

    place_mm: Pose
    length_mm: float

    def poses(self, s_mm: FloatArray) -> FloatArray:
        """Return positions of shape (n, 3), all equal."""
        return np.tile(np.array(self.place_mm), (len(s_mm), 1))

    def derivatives(self, s_mm: FloatArray) -> FloatArray:
        """Return derivatives of shape (n, 3), all 0."""
        return np.zeros((len(s_mm), len(self.place_mm)))


@dataclass(frozen=True, slots=True, eq=False)
class Oriented:
    """A path of positions, on which the tool turns in space in proportion to the length."""

    places: ToolPath
    turning: Turning

    @property
    def length_mm(self) -> float:
        """Length of the path of positions."""
        return self.places.length_mm

    def poses(self, s_mm: FloatArray) -> FloatArray:
        """Return poses of shape (n, task.width)."""
        return np.column_stack([self.places.poses(s_mm), self.turning.at(s_mm / self.length_mm)])

    def derivatives(self, s_mm: FloatArray) -> FloatArray:
        """Return derivatives of shape (n, 6)."""
        rate = np.tile(self.turning.turn_deg / self.length_mm, (len(s_mm), 1))
        return np.column_stack([self.places.derivatives(s_mm), rate])


def straight(task: Task, start: Pose, goal: Pose) -> ToolPath:
    """Return the straight path from a pose to another, on which the tool makes the shortest rotation.

    Raises InputError if both are at the same position, or if the tool turns by half a turn or more in space.
    """
    if task.is_flat:
        return StraightLine(start, goal)
    return Oriented(StraightLine(start[:_PLACE], goal[:_PLACE]), Turning.shortest(task, start, goal))


class Smoothing(StrEnum):
    """Shape of a curve through points: with continuous curvature (C2), or without overshoot at corners (Akima)."""

    C2_SPLINE = "c2-spline"
    AKIMA = "akima"


@dataclass(frozen=True, slots=True, eq=False)
class SampledPath:
    """A curve through poses; its parameter is the length of the polygon through them, in mm. Made by `through`.

    Attributes:
        curve: piecewise cubic of the columns of the poses.
    """

    curve: "PPoly"

    @classmethod
    def through(cls, poses: FloatArray, smoothing: Smoothing) -> Self:
        """Return the curve through poses of shape (n, task.width), each column interpolated.

        Raises:
            InputError: there are fewer than three poses, or two successive ones are at the same position.
        """
        if len(poses) < 3:
            raise InputError(f"a curve through {len(poses)} poses: it takes at least 3")
        chords_mm = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1)
        if not chords_mm.min() > NO_WAY:
            i = int(np.argmin(chords_mm))
            raise InputError(f"poses {i + 1} and {i + 2} of the curve are at the same place")
        s_mm = np.concatenate(([0.0], np.cumsum(chords_mm)))
        if smoothing is Smoothing.AKIMA:
            return cls(scipy.interpolate.Akima1DInterpolator(s_mm, poses))
        return cls(scipy.interpolate.CubicSpline(s_mm, poses))

    @property
    def length_mm(self) -> float:
        """Length of the polygon."""
        return float(self.curve.x[-1])

    def poses(self, s_mm: FloatArray) -> FloatArray:
        """Return poses of shape (n, columns)."""
        return np.asarray(self.curve(s_mm))

    def derivatives(self, s_mm: FloatArray) -> FloatArray:
        """Return the columns' derivatives, of shape (n, columns)."""
        return np.asarray(self.curve(s_mm, 1))


EVENNESS: Final = 0.005
"""Largest relative difference between the speeds of the tool and of the parameter."""
_PARTS_MIN, _PARTS_MAX = 16, 1024
"""Bounds of the number of parts in which the curve between two poses is measured; EVENNESS determines it."""
_BETWEEN: Final = np.arange(1, 8) / 8
"""Points in a part where the speed is checked."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)
"""Gauss' nodes and weights for the length of a part: exact for polynomials of degree 11."""


@dataclass(frozen=True, slots=True, eq=False)
class EvenPath:
    """A curve through poses as a function of its length, with a relative error up to EVENNESS; made by `of`.

    Attributes:
        path: the curve as a function of the length of the polygon through the poses.
        parameter: length of the polygon as a function of the curve's length, with a continuous second derivative.
    """

    path: SampledPath
    parameter: "CubicSpline"

    @classmethod
    def of(cls, path: SampledPath) -> Self:
        """Return a curve as a function of its true length; raise InputError if it reverses at a point."""
        parts = _PARTS_MIN
        while True:
            check_planning_time()
            even = cls._measured(path, parts)
            off = even.unevenness()
            if off.max() <= EVENNESS:
                return even
            if parts >= _PARTS_MAX:
                leg = int(off.argmax()) // parts
                raise InputError(
                    f"the curve turns back on the spot between its poses {leg + 1} and {leg + 2}: make two curves of it"
                )
            parts *= 2

    @classmethod
    def _measured(cls, path: SampledPath, parts: int) -> Self:
        """Return the curve, measured with a number of parts between two poses."""
        poses_at = path.curve.x
        knots = np.interp(np.arange(parts * (len(poses_at) - 1) + 1) / parts, np.arange(len(poses_at)), poses_at)
        half = np.diff(knots)[:, np.newaxis] / 2
        speeds = _speeds(path, (knots[:-1, np.newaxis] + half * (1 + _NODES)).ravel()).reshape(len(half), -1)
        lengths_mm = np.concatenate(([0.0], np.cumsum((half * speeds) @ _WEIGHTS)))
        ends = 1 / np.maximum(_speeds(path, knots[[0, -1]]), EVENNESS)
        begin, end = ends.tolist()
        return cls(path, scipy.interpolate.CubicSpline(lengths_mm, knots, bc_type=((1, begin), (1, end))))

    def unevenness(self) -> FloatArray:
        """Return the largest relative speed error in each part of the curve."""
        s_mm = self.parameter.x
        between_mm = (s_mm[:-1, np.newaxis] + np.diff(s_mm)[:, np.newaxis] * _BETWEEN).ravel()
        off = np.abs(np.linalg.norm(self.derivatives(between_mm)[:, :3], axis=1) - 1)
        return np.asarray(off.reshape(-1, len(_BETWEEN)).max(axis=1))

    @property
    def length_mm(self) -> float:
        """Length of the curve."""
        return float(self.parameter.x[-1])

    def poses(self, s_mm: FloatArray) -> FloatArray:
        """Return poses of shape (n, columns)."""
        return self.path.poses(self._polygon_mm(s_mm))

    def derivatives(self, s_mm: FloatArray) -> FloatArray:
        """Return the columns' derivatives, of shape (n, columns)."""
        return np.asarray(self.path.derivatives(self._polygon_mm(s_mm)) * self.parameter(s_mm, 1)[:, np.newaxis])

    def _polygon_mm(self, s_mm: FloatArray) -> FloatArray:
        """Return the length of the polygon, limited to its end, beyond which there is no curve."""
        return np.asarray(np.clip(self.parameter(s_mm), 0.0, self.path.length_mm))


@dataclass(frozen=True, slots=True, eq=False)
class TurnedCurve:
    """A curve through poses whose tool turns in space: the columns of orientations are normalised."""

    task: Task
    curve: EvenPath

    @property
    def length_mm(self) -> float:
        """Length of the curve."""
        return self.curve.length_mm

    def poses(self, s_mm: FloatArray) -> FloatArray:
        """Return poses of shape (n, task.width)."""
        poses = self.curve.poses(s_mm)
        poses[:, _PLACE:] /= np.linalg.norm(poses[:, _PLACE:], axis=1, keepdims=True)
        return poses

    def derivatives(self, s_mm: FloatArray) -> FloatArray:
        """Return derivatives of shape (n, 6)."""
        columns, slopes = self.curve.poses(s_mm)[:, _PLACE:], self.curve.derivatives(s_mm)
        length = np.linalg.norm(columns, axis=1, keepdims=True)
        unit, change = columns / length, slopes[:, _PLACE:] / length
        change -= unit * np.sum(unit * change, axis=1, keepdims=True)
        return np.column_stack([slopes[:, :_PLACE], self.task.turning_deg(unit, change)])


def curve_through(task: Task, poses: FloatArray, smoothing: Smoothing) -> ToolPath:
    """Return the smooth curve through poses of shape (n, task.width); raises as SampledPath and EvenPath."""
    curve = EvenPath.of(SampledPath.through(task.continued(poses), smoothing))
    return curve if task.is_flat else TurnedCurve(task, curve)


def _speeds(path: SampledPath, parameter: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(path.derivatives(parameter)[:, :3], axis=1))
