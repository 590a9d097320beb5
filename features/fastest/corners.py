"""Round the corners between the legs of a motion that does not stop, and measure how near each corner is passed.

A leg is a straight move of the joints or a path of the tool. A corner rounded by r leaves its leg r mm of the tool
before its end and is back on the next leg r mm after its begin, outside it is exactly on the legs. The rounding is the
polynomial of degree five whose ends have the place, the direction and the curvature of the legs: between two straight
lines it is a quartic that passes the corner at 3/16 r |t2 - t1|, with the directions t1 and t2 of length 1.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple, Protocol, Self

import numpy as np
import scipy

from steptwin.features.fastest.flow_path import FlowPath
from steptwin.features.fastest.pieces import FollowedPath, JointPiece, PathPiece, PiecewisePath, ToolPiece
from steptwin.features.fastest.tool_rounding import ToolRounding
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import at_most
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.planning.motions.whole import CornerError, Pace
from steptwin.host.planning.paths import Oriented, StraightLine, ToolPath
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import tool_places_mm
from steptwin.host.robots.poses import Task
from steptwin.host.robots.robot import Robot

KINK_MAX_DEG: Final = 0.1
"""Largest angle between two legs that flow into each other without a rounding: three typed decimals make 0.001."""

_MEASURED: Final = 64
"""Parts of a joint move whose tool ways are added up."""
_MM_PER_DEG: Final = 0.5
"""Way for which a degree counts in a move that turns the tool, or an arm about it, more than it moves it."""
_PASS_PLACES: Final = 401
_SMALL_MM: Final = 1e-4


class MotionLeg(Protocol):
    """A part of a motion between two corners, by a parameter from 0 to its length."""

    @property
    def pace(self) -> Pace:
        """What limits it."""
        ...

    @property
    def length(self) -> float:
        """Length of the parameter: the tool's way in mm."""
        ...

    def reach(self, r_mm: float, *, at_end: bool) -> float:
        """Return the length of the part of the leg whose tool way is r mm, at its end or its begin."""
        ...

    def way_mm(self, reach: float, *, at_end: bool) -> float:
        """Return the tool's way on a part of the leg of such a length; the inverse of `reach`."""
        ...

    def part(self, begin: float, end: float) -> PathPiece:
        """Return the part between two parameters."""
        ...

    def joints_at(self, s: float) -> FloatArray:
        """Return joints of shape (joints,) at a parameter."""
        ...

    def end_rows(self, s: float) -> FloatArray:
        """Return joints, first and second derivative, of shape (3, joints), at a parameter."""
        ...


@dataclass(frozen=True, eq=False)
class JointLeg:
    """A straight move of the joints, by a parameter that is even in the joints and as long as the tool's way in mm."""

    robot: Robot
    start: FloatArray
    goal: FloatArray
    pace: Pace

    @cached_property
    def _ways_mm(self) -> FloatArray:
        """Shape (_MEASURED + 1,), the tool's way up to places even in the joints; at least _MM_PER_DEG of a joint's."""
        parts = np.linspace(0.0, 1.0, _MEASURED + 1)[:, np.newaxis]
        places = tool_places_mm(make_kinematics(self.robot), self.start + parts * (self.goal - self.start))
        steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
        least = _MM_PER_DEG * np.abs(self.goal - self.start).max() / _MEASURED
        return np.concatenate([[0.0], np.cumsum(np.maximum(steps, least))])

    @property
    def length(self) -> float:
        """The tool's way."""
        return float(self._ways_mm[-1])

    def reach(self, r_mm: float, *, at_end: bool) -> float:
        """Return the length of a part whose tool way is r mm."""
        ways = self._ways_mm
        part = np.interp(self.length - r_mm if at_end else r_mm, ways, np.linspace(0.0, 1.0, len(ways)))
        return self.length * float(1.0 - part if at_end else part)

    def way_mm(self, reach: float, *, at_end: bool) -> float:
        """Return the tool's way on a part of such a length."""
        ways = self._ways_mm
        part = reach / self.length
        way = float(np.interp(1.0 - part if at_end else part, np.linspace(0.0, 1.0, len(ways)), ways))
        return self.length - way if at_end else way

    def part(self, begin: float, end: float) -> PathPiece:
        """Return the part between two parameters."""
        return JointPiece.straight(self.robot, self.joints_at(begin), self.joints_at(end), end - begin, self.pace)

    def end_rows(self, s: float) -> FloatArray:
        """Return joints and derivatives."""
        return np.stack([self.joints_at(s), (self.goal - self.start) / self.length, np.zeros(len(self.goal))])

    def joints_at(self, s: float) -> FloatArray:
        """Return joints."""
        return np.asarray(self.goal if s == self.length else self.start + s / self.length * (self.goal - self.start))


@dataclass(frozen=True, slots=True, eq=False)
class ToolLeg:
    """A path of the tool."""

    followed: FollowedPath
    pace: Pace

    @property
    def length(self) -> float:
        """Length of the path."""
        return self.followed.path.length_mm

    def reach(self, r_mm: float, *, at_end: bool) -> float:
        """Return r mm."""
        del at_end
        return min(r_mm, self.length)

    def way_mm(self, reach: float, *, at_end: bool) -> float:
        """Return the length."""
        del at_end
        return reach

    def part(self, begin: float, end: float) -> PathPiece:
        """Return the part between two parameters."""
        return ToolPiece(self.followed, begin, end - begin, self.pace)

    def joints_at(self, s: float) -> FloatArray:
        """Return joints."""
        return np.asarray(self.followed.joints(np.array([s]))[0])

    def end_rows(self, s: float) -> FloatArray:
        """Return joints and derivatives."""
        piece = ToolPiece(self.followed, 0.0, self.length, self.pace)
        return np.stack([piece.joints(np.array([s]), order)[0] for order in range(3)])


@dataclass(frozen=True, slots=True)
class Corner:
    """A corner that a motion passes, or in which it stops.

    Attributes:
        r_mm: how far it is rounded; 0 where two legs flow into each other, and at a stop.
        s: parameter of the whole path at which it is passed.
        passes_mm: distance at which the tool passes it.
        middle_s: parameter in the middle of its rounding: the next leg's own parameter counts from there.
        reach: length of its rounding on each of both legs; 0 without one.
        stops: True if the motion stops there.
    """

    r_mm: float
    s: float
    passes_mm: float
    middle_s: float
    reach: float = 0.0
    stops: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """A path through legs, the legs, and the corners in order."""

    path: FlowPath | PiecewisePath
    legs: tuple[MotionLeg, ...]
    corners: tuple[Corner, ...]

    @property
    def stops(self) -> FloatArray:
        """The parameters of the path at which it stops."""
        return np.array([corner.s for corner in self.corners if corner.stops])

    def s_of(self, leg: int, at: float) -> float:
        """Return the path's parameter where the tool is at a leg's own one, or nearest to that place on a rounding.

        Before the leg's begin and behind its end the parameter goes on.
        """
        own, before = self.legs[leg], self.corners[leg - 1] if leg else None
        after = self.corners[leg] if leg < len(self.corners) else None
        begin_s = before.middle_s if before else 0.0
        if before and 0.0 <= at < before.reach:
            return self._nearest(own, at, before.s, begin_s + before.reach)
        if after and own.length - after.reach < at <= own.length:
            return self._nearest(own, at, after.middle_s - after.reach, after.s)
        if before and at < 0.0:
            return before.s + at
        return (after.s - own.length if after and at > own.length else begin_s) + at

    def _nearest(self, leg: MotionLeg, at: float, from_s: float, until_s: float) -> float:
        """Return the path's parameter in a range where the tool is nearest to a place of a leg."""
        s = np.linspace(from_s, until_s, _PASS_PLACES)
        places = tool_places_mm(make_kinematics(self.path.robot), np.vstack([leg.joints_at(at), self.path.at(s)[0]]))
        return float(s[np.argmin(np.linalg.norm(places[1:] - places[0], axis=1))])


class _Rounding(NamedTuple):
    """What rounds a corner, where on it the corner is passed, and at which distance."""

    piece: PathPiece
    half: float
    passes_mm: float


@dataclass(frozen=True, slots=True, eq=False)
class RoundedLegs:
    """Legs with the roundings of their corners, through which flows with or without stops are made; made by `of`.

    Attributes:
        robot: the robot.
        legs: the legs.
        radii_mm: how far each corner is rounded.
        reaches: length of each corner's rounding on both its legs.
        roundings: the roundings; None where two legs flow into each other.
    """

    robot: Robot
    legs: tuple[MotionLeg, ...]
    radii_mm: tuple[float, ...]
    reaches: tuple[float, ...]
    roundings: tuple[_Rounding | None, ...]

    @classmethod
    def of(cls, robot: Robot, legs: Sequence[MotionLeg], radii_mm: Sequence[float]) -> Self:
        """Return legs, each beginning where the one before ends, whose corners are rounded so far.

        Raises CornerError for a rounding that needs more of a leg than there is, and for one of 0 at a kink.
        """
        reaches, roundings = _reaches(legs, radii_mm), list[_Rounding | None]()
        for i, reach in enumerate(reaches):
            check_planning_time()
            if reach == 0.0:
                _check_kink(i, robot, legs[i], legs[i + 1])
                roundings.append(None)
            else:
                piece = _rounded(robot, legs[i], legs[i + 1], reach)
                roundings.append(_Rounding(piece, *_pass(robot, piece, legs[i].joints_at(legs[i].length))))
        return cls(robot, tuple(legs), tuple(radii_mm), tuple(reaches), tuple(roundings))

    def flow(self, stops: Collection[int] = ()) -> Flow:
        """Return the path through the legs that stops in some of the corners, by their numbers."""
        stops = frozenset(stops)
        reaches = [0.0 if i in stops else reach for i, reach in enumerate(self.reaches)]
        pieces: list[PathPiece] = []
        corners: list[Corner] = []
        s = 0.0
        for i, leg in enumerate(self.legs):
            begin = reaches[i - 1] if i else 0.0
            end = leg.length - (reaches[i] if i < len(reaches) else 0.0)
            if end - begin > _SMALL_MM or end - begin == leg.length:  # a whole leg stays, however short
                pieces.append(leg.part(begin, end))
                s += pieces[-1].length
            if i < len(reaches):
                rounding = self.roundings[i]
                if i in stops or rounding is None:
                    corners.append(Corner(0.0, s, 0.0, s, stops=i in stops))
                else:
                    pieces.append(rounding.piece)
                    corners.append(
                        Corner(self.radii_mm[i], s + rounding.half, rounding.passes_mm, s + reaches[i], reaches[i])
                    )
                    s += rounding.piece.length
        path = FlowPath if len(self.legs) > 1 else PiecewisePath
        return Flow(path(self.robot, tuple(pieces)), self.legs, tuple(corners))


def flowing(robot: Robot, legs: Sequence[MotionLeg], radii_mm: Sequence[float]) -> Flow:
    """Return the path through legs without a stop, as `RoundedLegs` makes it."""
    return RoundedLegs.of(robot, legs, radii_mm).flow()


def _reaches(legs: Sequence[MotionLeg], radii_mm: Sequence[float]) -> list[float]:
    """Return the length of each corner's rounding on both its legs; raise CornerError where a leg is too short."""
    reaches = [
        min(before.reach(r_mm, at_end=True), after.reach(r_mm, at_end=False)) if r_mm else 0.0
        for before, after, r_mm in zip(legs, legs[1:], radii_mm, strict=False)
    ]
    for i, leg in enumerate(legs):
        first, last = (reaches[i - 1] if i else 0.0), (reaches[i] if i < len(reaches) else 0.0)
        wanted = [radii_mm[i - 1] if i else 0.0, radii_mm[i] if i < len(reaches) else 0.0]
        full = leg.way_mm(leg.length, at_end=True)
        if first + last <= leg.length * (1 + 1e-9) and max(wanted) <= full * (1 + 1e-9):
            continue
        if i < len(reaches) and (not i or wanted[1] > full):
            most = leg.way_mm(max(leg.length - first, 0.0), at_end=True)
            raise CornerError(i, _too_long(wanted[1], most, full, wanted[0] if i else None))
        most = leg.way_mm(max(leg.length - last, 0.0), at_end=False)
        raise CornerError(i - 1, _too_long(wanted[0], most, full, wanted[1] if i < len(reaches) else None))
    return reaches


def _too_long(r_mm: float, most_mm: float, leg_mm: float, other_mm: float | None) -> str:
    other = f", and the corner at its other end takes {other_mm:g} mm" if other_mm else ""
    hint = f"; {at_most(most_mm)} passes" if most_mm > _SMALL_MM else ""
    return f"blend_mm: {r_mm:g} mm is more than the leg has: {leg_mm:.6g} mm{other}{hint}"


def _check_kink(corner: int, robot: Robot, before: MotionLeg, after: MotionLeg) -> None:
    """Raise CornerError unless the joints go on in the direction that they come in."""
    speeds = np.array([joint.speed_max for joint in robot.joints])
    first, second = before.end_rows(before.length)[1] / speeds, after.end_rows(0.0)[1] / speeds
    sine = np.linalg.norm(first / np.linalg.norm(first) - second / np.linalg.norm(second)) / 2
    kink_deg = float(np.rad2deg(2.0 * np.arcsin(min(1.0, float(sine)))))
    if kink_deg > KINK_MAX_DEG:
        raise CornerError(
            corner,
            f"blend_mm: 0 mm flows on where the joints keep their direction to {KINK_MAX_DEG:g} deg; here they turn by"
            f" {kink_deg:.3g} deg: round the corner, such as blend_mm = 2",
        )


def _pass(robot: Robot, piece: PathPiece, corner: FloatArray) -> tuple[float, float]:
    """Return where a rounding is nearest to the corner at these joints, and at which distance in mm."""
    kinematics = make_kinematics(robot)
    s = np.linspace(0.0, piece.length, _PASS_PLACES)
    places = tool_places_mm(kinematics, np.vstack([corner, piece.joints(s, 0)]))
    away_mm = np.linalg.norm(places[1:] - places[0], axis=1)
    nearest = int(np.argmin(away_mm))
    return float(s[nearest]), float(away_mm[nearest])


# --- roundings


def _rounded(robot: Robot, before: MotionLeg, after: MotionLeg, reach: float) -> PathPiece:
    pace = _slower(before.pace, after.pace)
    if isinstance(before, ToolLeg) and isinstance(after, ToolLeg):
        path = _tool_rounding(before.followed, after.followed, reach)
        if path is not None:
            start = before.followed.joints(np.array([before.length - reach]))[0]
            branch = before.followed.branch_at(before.length - reach)
            followed = FollowedPath.along(robot, path, branch, start)
            return ToolPiece(followed, 0.0, path.length_mm, pace)
    begin, end = before.end_rows(before.length - reach), after.end_rows(reach)
    return JointPiece.rounding(robot, begin, end, 2.0 * reach, pace)


def _slower(first: Pace, second: Pace) -> Pace:
    return Pace(
        min(first.percent, second.percent),
        min(first.tool_mm_s, second.tool_mm_s),
        min(first.tool_deg_s, second.tool_deg_s),
    )


def _tool_rounding(before: FollowedPath, after: FollowedPath, reach: float) -> ToolRounding | None:
    """Return the rounding of the tool's own path; None where a tool turns in space at an uneven rate."""
    task = before.kinematics.task
    rates = _turns(before.path, task), _turns(after.path, task)
    if rates[0] is None or rates[1] is None:
        return None
    columns = task.width if task.is_flat else 3
    first = _ends(before.path, before.path.length_mm - reach, columns)
    second = _ends(after.path, reach, columns)
    curve = scipy.interpolate.BPoly.from_derivatives([0.0, 2.0 * reach], [first, second])
    corner = before.path.poses(np.array([before.path.length_mm]))[0, 3:]
    return ToolRounding(task, curve, corner, (rates[0], rates[1]))


def _turns(path: ToolPath, task: Task) -> FloatArray | None:
    """Return by how much a path turns the tool in space, in degrees for each mm; None where that is uneven."""
    if task.is_flat:
        return np.zeros(3)
    return path.turning.turn_deg / path.length_mm if isinstance(path, Oriented) else None


def _ends(path: ToolPath, at_mm: float, columns: int) -> FloatArray:
    """Return the first columns of a path's pose and of its first and second derivative, shape (3, columns)."""
    ends = np.clip([at_mm - _SMALL_MM, at_mm + _SMALL_MM], 0.0, path.length_mm)
    slopes = path.derivatives(np.array([at_mm, *ends]))[:, :columns]
    bend = np.zeros(columns) if _is_straight(path) else (slopes[2] - slopes[1]) / (ends[1] - ends[0])
    rows: FloatArray = np.nan_to_num(np.stack([path.poses(np.array([at_mm]))[0, :columns], slopes[0], bend]))
    return rows


def _is_straight(path: ToolPath) -> bool:
    return isinstance(path.places if isinstance(path, Oriented) else path, StraightLine)
