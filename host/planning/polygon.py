"""The polygon of straight lines between points, and the deviation of a motion through the points from it."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.planning.motion import Motion
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import tool_places_mm
from steptwin.host.robots.robot import Robot

RANGE_PART: Final = 0.01
"""Fraction of a joint's range up to which a deviation gets no warning."""

TOOL_MM: Final = 1.0
"""Distance of the tool up to which a deviation gets no warning."""

TOOL: Final = "tool"

_CHUNK: Final = 1 << 16
"""Number of instants compared at once; bounds the memory."""


@dataclass(frozen=True, slots=True)
class Departure:
    """The largest deviation of a joint, or of the tool, from the polygon.

    Attributes:
        what: name of the joint, or TOOL.
        distance: distance, in `unit`.
        unit: mm or deg.
        t_s: time of the deviation.
        allowed: distance up to which it gets no warning.
    """

    what: str
    distance: float
    unit: str
    t_s: float
    allowed: float

    @property
    def is_large(self) -> bool:
        """True if it deserves a warning."""
        return self.distance > self.allowed


@dataclass(frozen=True, slots=True, eq=False)
class Polygon:
    """The straight lines in joint space from point to point.

    Attributes:
        times_s: shape (points,).
        positions: joint positions, of shape (points, joints), in mm and degrees.
        tool_mm: x, y and z of the points, of shape (points, 3), if the tool has straight lines, too; None if it follows
            the joints' lines.
    """

    times_s: FloatArray
    positions: FloatArray
    tool_mm: FloatArray | None = None

    def velocities(self) -> FloatArray:
        """Return the joints' velocities on each line, of shape (lines, joints), at constant speed."""
        velocities: FloatArray = np.diff(self.positions, axis=0) / np.diff(self.times_s)[:, np.newaxis]
        return velocities

    def departures(self, robot: Robot, motion: Motion) -> tuple[Departure, ...]:
        """Return the largest deviation of each joint, and then of the tool, from the polygon.

        At each instant it is the distance from the nearest place on the line between the neighbouring points, not from
        the place at constant speed. Nearness is measured in fractions of the joints' ranges. At the points' times it is
        the distance from the point, which a blend misses.
        """
        names = (*robot.joint_names, TOOL)
        units = (*(joint.unit for joint in robot.joints), "mm")
        allowed = (*(RANGE_PART * (joint.upper - joint.lower) for joint in robot.joints), TOOL_MM)
        largest, at_s = np.zeros(len(names)), np.zeros(len(names))
        for t_s, distances in self._distances(robot, motion):
            worst = distances.argmax(axis=0)
            highest = distances[worst, np.arange(len(names))]
            at_s = np.where(highest > largest, t_s[worst], at_s)
            largest = np.maximum(highest, largest)
        rows = zip(names, largest.tolist(), units, at_s.tolist(), allowed, strict=True)
        return tuple(Departure(*row) for row in rows)

    def _distances(self, robot: Robot, motion: Motion) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Yield instants of shape (n,) with the deviations of all joints and the tool, of shape (n, joints + 1)."""
        end_ms = round(1000 * motion.duration_s)
        for first in range(0, end_ms + 1, _CHUNK):
            t_s = np.arange(first, min(first + _CHUNK, end_ms + 1)) / 1000
            yield t_s, self._from_lines(robot, t_s, motion.positions(t_s))
        for first in range(0, len(self.times_s), _CHUNK):
            chunk = slice(first, first + _CHUNK)
            tool_mm = None if self.tool_mm is None else self.tool_mm[chunk]
            joints = motion.positions(self.times_s[chunk])
            yield self.times_s[chunk], _apart(robot, joints, self.positions[chunk], tool_mm)

    def _from_lines(self, robot: Robot, t_s: FloatArray, joints: FloatArray) -> FloatArray:
        line = np.clip(np.searchsorted(self.times_s, t_s, side="right") - 1, 0, len(self.times_s) - 2)
        ranges = np.array([joint.upper - joint.lower for joint in robot.joints])
        nearest = _nearest(self.positions / ranges, line, joints / ranges) * ranges
        tool_mm = None if self.tool_mm is None else _nearest(self.tool_mm, line, _tool_mm(robot, joints))
        return _apart(robot, joints, nearest, tool_mm)


def _tool_mm(robot: Robot, joints: FloatArray) -> FloatArray:
    return tool_places_mm(make_kinematics(robot), joints)


def _apart(robot: Robot, joints: FloatArray, wanted: FloatArray, wanted_mm: FloatArray | None) -> FloatArray:
    """Return the distances of joints and tool from wanted positions; the tool's default is its place by the joints."""
    if wanted_mm is None:
        wanted_mm = _tool_mm(robot, wanted)
    off_mm = np.linalg.norm(_tool_mm(robot, joints) - wanted_mm, axis=1)
    return np.column_stack([np.abs(joints - wanted), off_mm])


def _nearest(points: FloatArray, line: Int64Array, places: FloatArray) -> FloatArray:
    """Return the places nearest to `places` on the lines that begin at the points with the indices `line`."""
    start, way = points[line], points[line + 1] - points[line]
    length2 = (way**2).sum(axis=1)
    along = ((places - start) * way).sum(axis=1) / np.where(length2 > 0, length2, 1.0)
    nearest: FloatArray = start + np.clip(along, 0.0, 1.0)[:, np.newaxis] * way
    return nearest
