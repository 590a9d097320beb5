"""A path of the joints as pieces in a row: polynomials of the joints, and paths of the tool with joints that follow."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Final, Protocol, Self

import numpy as np
import scipy

from steptwin.features.fastest.rows import PathLimits, PathRates
from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.planning.motions.tool_move import check_start, followed
from steptwin.host.planning.motions.whole import Pace
from steptwin.host.planning.paths import FreeAttitude, OutOfReachError, ToolPath
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
from steptwin.host.robots.robot import Robot

if TYPE_CHECKING:
    from scipy.interpolate import BPoly, PPoly


_APART_MM: Final = 0.25
"""Distance between two places of a path at which it is looked at, and the joints' turns are stored."""
_GUIDES_MIN, _GUIDES_MAX = 64, 100_000
_STEEP_DEG: Final = 5.0
"""Turn of a joint from one guide to the next above which more guides are laid in between."""
_UNEVEN_DEG: Final = 0.2
"""The same for a turn beside which those before and after are small: it looks like a jump."""
_UNEVEN: Final = 10.0
"""Such a turn over the larger one beside it."""
_STEEP_PARTS: Final = 8
_SHORTEST_MM: Final = 1e-3
"""Way between two guides on which such a turn is a jump: no motor step of an arm resolves it."""
_ROUNDS_MAX: Final = 12
"""Rounds of laying guides; eight parts each make a hundred metres shorter than the shortest way in ten."""


def _after(at_mm: float) -> str:
    return f"after {at_mm:.2f} mm"


def _where_at(where: Callable[[float], str], guide_mm: FloatArray, i: int) -> str:
    return where(float(guide_mm[i]))


@dataclass(frozen=True, slots=True, eq=False)
class FollowedPath:
    """A path of the tool on one branch of the inverse kinematics; made by `along`.

    Attributes:
        path: path of the tool.
        kinematics: kinematics of the robot.
        branch: branch of the inverse kinematics at the start.
        guide_mm: shape (m,), lengths for which the joints' turns are stored.
        guides: shape (m, joints), the joints there, without jumps of a whole turn.
        rotary: columns of the rotary joints.
        changes: lengths from which on the arm is on another branch, and its name; only where two branches meet.
    """

    path: ToolPath
    kinematics: Kinematics
    branch: str
    guide_mm: FloatArray
    guides: FloatArray
    rotary: tuple[int, ...]
    changes: tuple[tuple[float, str], ...] = ()

    @classmethod
    def along(
        cls, robot: Robot, path: ToolPath, branch: str, start: FloatArray, where: Callable[[float], str] = _after
    ) -> Self:
        """Return a path that begins at the joints `start`, of shape (joints,), on a branch.

        Raises InputError if it leaves the mechanism's reach, comes near a singularity, does not begin at `start` or
        makes a joint jump; the message says `where`, usually after how many mm. Limits of the joints are not checked.
        """
        kinematics = make_kinematics(robot)
        if kinematics.attitude_follows:
            path = FreeAttitude(path)
        count = int(np.clip(np.ceil(path.length_mm / _APART_MM), _GUIDES_MIN, _GUIDES_MAX)) + 1
        guide_mm = np.linspace(0.0, path.length_mm, count)
        rotary = tuple(axis for axis, joint in enumerate(robot.joints) if joint.unit is Unit.DEG)
        for _ in range(_ROUNDS_MAX):
            solved = followed(robot, path.poses(guide_mm), partial(_where_at, where, guide_mm), branch, start)
            check_start(robot, branch, start, solved.joints[0], "at its start")
            steep = _steep(kinematics, solved.joints, rotary)
            if not steep.any():
                break
            check_planning_time()
            _check_jumps(robot, kinematics, guide_mm, solved.joints, steep, where)
            guide_mm = _denser(guide_mm, steep)
        changes = tuple((float(guide_mm[i]), name) for i, name in solved.changes)
        return cls(path, kinematics, branch, guide_mm, solved.joints, rotary, changes)

    def steep_mm(self, begin_mm: float, end_mm: float) -> FloatArray:
        """Return the lengths between two on which joints turn so fast that its guides are dense there, rising."""
        if self.kinematics.keeps_branch:  # its guides are even
            return np.zeros(0)
        apart = np.diff(self.guide_mm)
        dense = apart < apart.max() / 2.0
        at_dense = np.append(dense, False) | np.append(False, dense)
        own = (self.guide_mm > begin_mm) & (self.guide_mm < end_mm)
        return np.asarray(self.guide_mm[at_dense & own])

    @property
    def end(self) -> FloatArray:
        """Shape (joints,), the joints at the path's end."""
        return np.asarray(self.guides[-1])

    def branch_at(self, s_mm: float) -> str:
        """Return the branch on which the arm is at a length."""
        return next((name for at_mm, name in reversed(self.changes) if at_mm <= s_mm), self.branch)

    def joints(self, s_mm: FloatArray) -> FloatArray:
        """Return joints of shape (n, joints) at lengths of shape (n,)."""
        guides = np.column_stack([np.interp(s_mm, self.guide_mm, column) for column in self.guides.T])
        solved = self.kinematics.at(self.path.poses(s_mm), self.branch, self.guides[0], guides)
        for axis in self.rotary:  # choose the turn that the guide is in
            solved[:, axis] += 360.0 * np.round((guides[:, axis] - solved[:, axis]) / 360.0)
        return solved

    def derivatives(self, s_mm: FloatArray) -> FloatArray:
        """Return the joints' derivatives by the length, of shape (n, joints), by the inverse Jacobian."""
        return self.kinematics.joint_velocities(self.joints(s_mm), self.path.derivatives(s_mm))


def _steep(kinematics: Kinematics, joints: FloatArray, rotary: tuple[int, ...]) -> BoolArray:
    """Return between which guides a joint turns far, of shape (guides - 1,); never on a branch that is kept."""
    if kinematics.keeps_branch:
        return np.zeros(len(joints) - 1, np.bool_)
    turned = np.abs(np.diff(joints[:, rotary], axis=0))
    padded = np.pad(turned, ((1, 1), (0, 0)))
    uneven = (turned > _UNEVEN_DEG) & (turned > _UNEVEN * np.maximum(padded[:-2], padded[2:]))
    return np.asarray((uneven | (turned > _STEEP_DEG)).any(axis=1))


def _denser(guide_mm: FloatArray, steep: BoolArray) -> FloatArray:
    """Return guides with further ones in these gaps between them."""
    begin, end = guide_mm[:-1][steep, np.newaxis], guide_mm[1:][steep, np.newaxis]
    between = begin + (end - begin) * (np.arange(1, _STEEP_PARTS) / _STEEP_PARTS)
    return np.sort(np.concatenate([guide_mm, between.ravel()]))


def _check_jumps(
    robot: Robot,
    kinematics: Kinematics,
    guide_mm: FloatArray,
    joints: FloatArray,
    steep: BoolArray,
    where: Callable[[float], str],
) -> None:
    """Raise OutOfReachError where a joint turns far between two guides that are as near as guides get."""
    jumps = np.flatnonzero(steep & (np.diff(guide_mm) <= _SHORTEST_MM))
    if not len(jumps):
        return
    row = int(jumps[0])
    turned = np.abs(np.diff(joints[row : row + 2], axis=0))[0]
    axis = int(np.argmax([each * (joint.unit is Unit.DEG) for each, joint in zip(turned, robot.joints, strict=True)]))
    pose = kinematics.task.words(np.round(kinematics.forward(joints[row : row + 1])[0], 3))
    near = ", ".join(filter(None, (kinematics.near_what(joints[row]), f"at {pose}")))
    raise OutOfReachError(
        f"{where(float(guide_mm[row]))} the tool's path breaks off: {robot.joints[axis].name} would turn by"
        f" {turned[axis]:.3g} deg on {guide_mm[row + 1] - guide_mm[row]:.1g} mm, {near}"
    )


class PathPiece(Protocol):
    """A part of a path, by a parameter from 0 to its length."""

    @property
    def length(self) -> float:
        """Length, above 0: of the tool's way in mm, or of a turn in degrees."""
        ...

    @property
    def pace(self) -> Pace:
        """What limits it."""
        ...

    def places(self) -> FloatArray:
        """Return the parameters at which its limits are looked at, rising from 0 to its length."""
        ...

    def joints(self, s: FloatArray, order: int) -> FloatArray:
        """Return joints, or their first or second derivative, of shape (n, joints), at parameters of shape (n,)."""
        ...

    def tool(self, s: FloatArray) -> FloatArray:
        """Return the tool's way in mm and its turn in degrees for each unit of the parameter, of shape (n, 2)."""
        ...


_STRAIGHT_PLACES: Final = 40
_CURVED_PLACES: Final = 32
SMALL: Final = 1e-4
"""Half of the step of central differences, in units of a piece's parameter."""


def _dense_at_ends(length: float, count: int) -> FloatArray:
    """Return parameters from 0 to a length, denser at both ends, where a motion speeds up and slows down."""
    return np.asarray((1.0 - np.cos(np.linspace(0.0, np.pi, count))) * (length / 2.0))


@dataclass(frozen=True, slots=True, eq=False)
class JointPiece:
    """A polynomial of the joints: a straight leg, or what rounds a corner.

    Attributes:
        robot: the robot.
        curve: joints of shape (joints,) as a polynomial of the parameter, from 0 to the length.
        pace: what limits it.
        is_straight: True for a straight leg.
    """

    robot: Robot
    curve: "BPoly | PPoly"
    pace: Pace
    is_straight: bool = False

    @classmethod
    def straight(cls, robot: Robot, start: FloatArray, goal: FloatArray, length: float, pace: Pace) -> Self:
        """Return the straight leg from joints to others, both of shape (joints,), of a length as its parameter."""
        return cls(robot, scipy.interpolate.BPoly(np.stack([start, goal])[:, np.newaxis], [0.0, length]), pace, True)

    @classmethod
    def through(cls, robot: Robot, curve: "PPoly", pace: Pace) -> Self:
        """Return the piece along a curve of the joints by its length, looked at in each of the curve's knots."""
        return cls(robot, curve, pace)

    @classmethod
    def rounding(cls, robot: Robot, begin: FloatArray, end: FloatArray, length: float, pace: Pace) -> Self:
        """Return the quintic between two ends: each joints, first and second derivative, of shape (3, joints)."""
        return cls(robot, scipy.interpolate.BPoly.from_derivatives([0.0, length], [begin, end]), pace)

    @property
    def length(self) -> float:
        """Length of the parameter."""
        return float(self.curve.x[-1])

    def places(self) -> FloatArray:
        """Return its places."""
        if self.is_straight:
            return _dense_at_ends(self.length, _STRAIGHT_PLACES)
        knots = np.asarray(self.curve.x)
        return knots if len(knots) > 2 else np.linspace(0.0, self.length, _CURVED_PLACES)

    def joints(self, s: FloatArray, order: int) -> FloatArray:
        """Return joints or a derivative."""
        return np.asarray(self.curve(s, order))

    def tool(self, s: FloatArray) -> FloatArray:
        """Return the tool's way and turn, by central differences of the forward kinematics where they are limited."""
        rates = np.zeros((len(s), 2))
        if np.isfinite(self.pace.tool_mm_s) or np.isfinite(self.pace.tool_deg_s):
            kinematics = make_kinematics(self.robot)
            ends = np.clip(np.stack([s - SMALL, s + SMALL]), 0.0, self.length)
            before, after = (kinematics.forward(self.joints(at, 0)) for at in ends)
            apart = ends[1] - ends[0]
            rates[:, 0] = np.linalg.norm(after[:, :3] - before[:, :3], axis=1) / apart
            if not kinematics.task.is_flat:
                rates[:, 1] = kinematics.task.off_deg(before, after) / apart
        return rates


@dataclass(frozen=True, slots=True, eq=False)
class ToolPiece:
    """A part of a path of the tool, whose joints follow from it.

    Attributes:
        followed: the path with its joints.
        begin: where the part begins on the path.
        length: length of the part.
        pace: what limits it.
        places_on: number of places at which its limits are looked at.
    """

    followed: FollowedPath
    begin: float
    length: float
    pace: Pace
    places_on: int = _STRAIGHT_PLACES

    def places(self) -> FloatArray:
        """Return its places, and more of them where joints turn fast."""
        usual = _dense_at_ends(self.length, self.places_on)
        steep = self.followed.steep_mm(self.begin, self.begin + self.length) - self.begin
        return np.union1d(usual, steep) if len(steep) else usual

    def joints(self, s: FloatArray, order: int) -> FloatArray:
        """Return joints or a derivative; the second one by differences of the first."""
        at = self.begin + s
        match order:
            case 0:
                return self.followed.joints(at)
            case 1:
                return self.followed.derivatives(at)
            case _:
                ends = np.clip(np.stack([at - SMALL, at + SMALL]), self.begin, self.begin + self.length)
                before, after = (self.followed.derivatives(end) for end in ends)
                return np.asarray((after - before) / (ends[1] - ends[0])[:, np.newaxis])

    def tool(self, s: FloatArray) -> FloatArray:
        """Return the tool's way and turn."""
        slopes = self.followed.path.derivatives(self.begin + s)
        turning = slopes[:, 3:6] if slopes.shape[1] > 4 else np.zeros((len(s), 1))
        return np.column_stack([np.linalg.norm(slopes[:, :3], axis=1), np.linalg.norm(turning, axis=1)])


@dataclass(frozen=True, eq=False)
class PiecewisePath:
    """Pieces in a row, each of which begins where the one before ends; implements JointPath."""

    robot: Robot
    pieces: tuple[PathPiece, ...]

    @cached_property
    def starts(self) -> FloatArray:
        """Shape (pieces + 1,), the parameter at which each piece begins, and the end."""
        return np.concatenate([[0.0], np.cumsum([piece.length for piece in self.pieces])])

    def rates(self) -> PathRates:
        """Return the path at the places of all pieces; where two meet, with the values of both."""
        own = [(piece, piece.places()) for piece in self.pieces]
        joints, first, second = (np.concatenate([piece.joints(s, order) for piece, s in own]) for order in range(3))
        # a piece ends where the next one begins, to the last bit, which adding up its own lengths would not give
        s = np.concatenate(
            [
                np.append(start + s[:-1], end)
                for (_, s), start, end in zip(own, self.starts, self.starts[1:], strict=False)
            ]
        )
        return PathRates(s, joints, first, second, np.concatenate([piece.tool(at) for piece, at in own]))

    def limits(self) -> PathLimits:
        """Return the limits at the same places."""
        counts = [len(piece.places()) for piece in self.pieces]
        paces = [(piece.pace.percent, piece.pace.tool_mm_s, piece.pace.tool_deg_s) for piece in self.pieces]
        each = np.repeat(np.array(paces), counts, axis=0)
        return PathLimits.of(self.robot, each[:, 0], each[:, 1:])

    def at(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return joints and their first derivatives at parameters of shape (n,)."""
        joints, first = (np.empty((len(s), len(self.robot.joints))) for _ in range(2))
        for own, piece, at in self._pieces_at(s):
            joints[own], first[own] = piece.joints(at, 0), piece.joints(at, 1)
        return joints, first

    def tool(self, s: FloatArray) -> FloatArray:
        """Return the tool's ways and turns at parameters of shape (n,)."""
        tool = np.empty((len(s), 2))
        for own, piece, at in self._pieces_at(s):
            tool[own] = piece.tool(at)
        return tool

    def _pieces_at(self, s: FloatArray) -> Iterator[tuple[BoolArray, PathPiece, FloatArray]]:
        """Yield the pieces on which parameters are: which these are, the piece, and its own parameters there."""
        which = np.clip(np.searchsorted(self.starts, s, side="right") - 1, 0, len(self.pieces) - 1)
        for i in np.unique(which):
            own, piece = which == i, self.pieces[i]
            yield own, piece, np.clip(s[own] - self.starts[i], 0.0, piece.length)
