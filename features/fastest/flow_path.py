"""A path of the joints through very many legs and roundings, which are computed together.

Polynomials of the joints are one table. So are lines, arcs and roundings of a tool that does not turn in space; other
paths of the tool give their poses one by one, and the joints of all poses are then found at once.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb
from typing import Final

import numpy as np

from steptwin.features.fastest.contour import Contour, polynomials
from steptwin.features.fastest.pieces import SMALL, JointPiece, PathPiece, ToolPiece
from steptwin.features.fastest.rows import PathLimits, PathRates
from steptwin.features.fastest.tool_rounding import ToolRounding
from steptwin.host.common.arrays import BoolArray, FloatArray, Int64Array
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.planning.paths import Arc, FreeAttitude, StraightLine, ToolPath
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
from steptwin.host.robots.robot import Robot

_DEGREE: Final = 5
_POSE: Final = 4
"""Columns of the table of poses: x, y, z and the turn."""

_MANY: Final = 200
"""Pieces above which every second of their places is enough: in a long motion no short piece decides much."""
_THINNED: Final = 2

Place = tuple[Int64Array, FloatArray]
"""Places of the path: the number of the piece, and its own parameter, both of shape (n,)."""


@dataclass(frozen=True, eq=False)
class FlowPath:
    """Pieces in a row, each of which begins where the one before ends; implements LimitedPath.

    Pieces are polynomials of the joints of at most the fifth degree, and parts of paths of the tool.
    """

    robot: Robot
    pieces: tuple[PathPiece, ...]

    @cached_property
    def starts(self) -> FloatArray:
        """Shape (pieces + 1,), the parameter at which each piece begins, and the end."""
        return np.concatenate([[0.0], np.cumsum(self._lengths)])

    def rates(self) -> PathRates:
        """Return the path at the places of all pieces; where two meet, with the values of both."""
        return self._rates

    @cached_property
    def _rates(self) -> PathRates:
        which, own = self._places
        lengths, at_end = self._lengths[which], np.append(np.diff(which) > 0, True)
        s = np.where(at_end, self.starts[which + 1], self.starts[which] + own)
        joints, first = self._joints((which, own))
        sides = [np.clip(own + side * SMALL, 0.0, lengths) for side in (-1.0, 1.0)]
        before, after = (self._joints((which, side))[1] for side in sides)
        second = (after - before) / (sides[1] - sides[0])[:, np.newaxis]
        rows = self._by_joints[which]
        second[rows] = self._polynomials.values(which[rows], own[rows], 2)
        return PathRates(s, joints, first, second, self._tool((which, own)))

    def limits(self) -> PathLimits:
        """Return the limits at the same places."""
        each = self._paces[self._places[0]]
        return PathLimits.of(self.robot, each[:, 0], each[:, 1:])

    def at(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return joints and their first derivatives at parameters of shape (n,)."""
        return self._joints(self._place(s))

    def tool(self, s: FloatArray) -> FloatArray:
        """Return the tool's ways and turns at parameters of shape (n,)."""
        return self._tool(self._place(s))

    # --- pieces

    @cached_property
    def _lengths(self) -> FloatArray:
        return np.array([piece.length for piece in self.pieces])

    @cached_property
    def _paces(self) -> FloatArray:
        """Shape (pieces, 3), percentage and the tool's speeds."""
        return np.array([(pace.percent, pace.tool_mm_s, pace.tool_deg_s) for pace in (p.pace for p in self.pieces)])

    @cached_property
    def _by_joints(self) -> BoolArray:
        """Shape (pieces,), whether a piece is a polynomial of the joints."""
        return np.array([isinstance(piece, JointPiece) for piece in self.pieces])

    @cached_property
    def _places(self) -> Place:
        """The places at which limits are looked at."""
        own = [piece.places() for piece in self.pieces]
        if len(own) > _MANY:
            own = [np.append(each[:-1:_THINNED], each[-1]) for each in own]
        return np.repeat(np.arange(len(own)), [len(each) for each in own]), np.concatenate(own)

    def _place(self, s: FloatArray) -> Place:
        which = np.clip(np.searchsorted(self.starts, s, side="right") - 1, 0, len(self.pieces) - 1)
        return which, np.clip(s - self.starts[which], 0.0, self._lengths[which])

    def _joints(self, place: Place) -> tuple[FloatArray, FloatArray]:
        """Return joints and their first derivatives at places."""
        which, own = place
        joints, first = np.empty((2, len(own), len(self.robot.joints)))
        rows = self._by_joints[which]
        if rows.any():
            for order, values in enumerate((joints, first)):
                values[rows] = self._polynomials.values(which[rows], own[rows], order)
        if not rows.all():
            joints[~rows], first[~rows] = self._tools.joints(which[~rows], own[~rows])
        return joints, first

    def _tool(self, place: Place) -> FloatArray:
        """Return the tool's way in mm and its turn in degrees for each unit of the parameter, of shape (n, 2)."""
        which, own = place
        tool, rows = np.zeros((len(own), 2)), self._by_joints[which]
        if not rows.all():
            slopes = self._tools.slopes(which[~rows], own[~rows])
            tool[~rows, 0] = np.linalg.norm(slopes[:, :3], axis=1)
            if slopes.shape[1] > _POSE:
                tool[~rows, 1] = np.linalg.norm(slopes[:, 3:6], axis=1)
        limited = rows & np.isfinite(self._paces[which, 1:]).any(axis=1)
        if limited.any():
            tool[limited] = self._tool_of_joints(which[limited], own[limited])
        return tool

    def _tool_of_joints(self, which: Int64Array, own: FloatArray) -> FloatArray:
        """Return the tool's way and turn on polynomials of the joints, by central differences."""
        kinematics = make_kinematics(self.robot)
        sides = [np.clip(own + side * SMALL, 0.0, self._lengths[which]) for side in (-1.0, 1.0)]
        before, after = (kinematics.forward(self._polynomials.values(which, side, 0)) for side in sides)
        apart, rates = sides[1] - sides[0], np.zeros((len(own), 2))
        rates[:, 0] = np.linalg.norm(after[:, :3] - before[:, :3], axis=1) / apart
        if not kinematics.task.is_flat:
            rates[:, 1] = kinematics.task.off_deg(before, after) / apart
        return rates

    @cached_property
    def _polynomials(self) -> "_Polynomials":
        """The polynomials of the joints, by the pieces' numbers."""
        rows = np.zeros((len(self.pieces), _DEGREE + 1, len(self.robot.joints)))
        for i, piece in enumerate(self.pieces):
            if isinstance(piece, JointPiece):
                rows[i] = _powers(np.asarray(piece.curve.c)[:, 0])
        return _Polynomials(rows, self._lengths)

    @cached_property
    def _tools(self) -> "_Tools":
        return _Tools.of(self.robot, self.pieces)


@dataclass(frozen=True, slots=True, eq=False)
class _Polynomials:
    """Polynomials of pieces' parts from 0 to 1, of shape (pieces, 6, columns), from the highest power on."""

    rows: FloatArray
    lengths: FloatArray

    def values(self, which: Int64Array, own: FloatArray, order: int) -> FloatArray:
        """Return values, or a derivative by the pieces' own parameter, of shape (n, columns)."""
        lengths = self.lengths[which, np.newaxis]
        return polynomials(self.rows, which, own[:, np.newaxis] / lengths, order) / lengths**order


def _powers(bernstein: FloatArray) -> FloatArray:
    """Return the coefficients of a polynomial in its part, from the highest of six powers on, from Bernstein's."""
    degree = len(bernstein) - 1
    found = np.zeros((_DEGREE + 1, bernstein.shape[1]))
    found[_DEGREE - degree :] = _TO_POWERS[degree] @ bernstein
    return found


_TO_POWERS: Final = {
    degree: np.array(
        [
            [(-1.0) ** (k - i) * comb(degree, k) * comb(k, i) if i <= k else 0.0 for i in range(degree + 1)]
            for k in range(degree, -1, -1)
        ]
    )
    for degree in (1, _DEGREE)
}
"""Matrices that make powers of the part, from the highest on, of the coefficients of a polynomial of a degree."""


# --- paths of the tool


@dataclass(frozen=True, slots=True, eq=False)
class _Tools:
    """The parts of paths of the tool among pieces, by the pieces' numbers.

    Attributes:
        pieces: the pieces; polynomials of the joints are not asked for.
        kinematics: kinematics of the robot.
        table: lines, arcs and roundings, if the tool does not turn in space and there is no other path; else None.
        turns_freely: True for a tool that cannot turn by itself.
        begins: shape (pieces,), where each piece begins among the guides.
        branch_of: shape (pieces,), number of each piece's branch.
        branches: names of the branches.
        guide_mm: shape (m,), not falling, lengths for which the joints' turns are stored, of all paths in a row.
        guides: shape (m, joints), the joints there.
        rotary: columns of the rotary joints.
    """

    pieces: Sequence[PathPiece]
    kinematics: Kinematics
    table: Contour | None
    turns_freely: bool
    begins: FloatArray
    branch_of: Int64Array
    branches: tuple[str, ...]
    guide_mm: FloatArray
    guides: FloatArray
    rotary: tuple[int, ...]

    @classmethod
    def of(cls, robot: Robot, pieces: Sequence[PathPiece]) -> "_Tools":
        kinematics, names, begins = make_kinematics(robot), [""] * len(pieces), np.zeros(len(pieces))
        guide_mm, guides, all_mm = list[FloatArray](), list[FloatArray](), 0.0
        for i, piece in enumerate(pieces):
            if isinstance(piece, ToolPiece):
                names[i], begins[i] = piece.followed.branch, all_mm + piece.begin
                guide_mm.append(all_mm + piece.followed.guide_mm)
                guides.append(piece.followed.guides)
                all_mm = guide_mm[-1][-1]
        branches = tuple(sorted(set(names)))
        return cls(
            pieces,
            kinematics,
            _table(pieces) if kinematics.task.is_flat else None,
            kinematics.attitude_follows,
            begins,
            np.array([branches.index(name) for name in names]),
            branches,
            np.concatenate(guide_mm),
            np.concatenate(guides),
            tuple(axis for axis, joint in enumerate(robot.joints) if joint.unit is Unit.DEG),
        )

    def joints(self, which: Int64Array, own: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return joints and their first derivatives."""
        at_mm = self.begins[which] + own
        guides = np.column_stack([np.interp(at_mm, self.guide_mm, column) for column in self.guides.T])
        poses, joints, branch_of = self.poses(which, own), np.empty_like(guides), self.branch_of[which]
        for number in np.unique(branch_of):
            rows = branch_of == number
            near = guides[rows]
            joints[rows] = self.kinematics.at(poses[rows], self.branches[number], near, near)
        for axis in self.rotary:  # choose the turn that the guide is in
            joints[:, axis] += 360.0 * np.round((guides[:, axis] - joints[:, axis]) / 360.0)
        return joints, self.kinematics.joint_velocities(joints, self.slopes(which, own))

    def poses(self, which: Int64Array, own: FloatArray) -> FloatArray:
        """Return the tool's poses."""
        if self.table is None:
            return self._one_by_one(which, own, lambda path, at: path.poses(at))
        poses = self.table.poses_of(which, own / self.table.lengths_mm[which])
        if self.turns_freely:
            poses[:, 3] = np.nan
        return poses

    def slopes(self, which: Int64Array, own: FloatArray) -> FloatArray:
        """Return the poses' first derivatives."""
        if self.table is None:
            return self._one_by_one(which, own, lambda path, at: path.derivatives(at))
        slopes = self.table.rates_of(which, own / self.table.lengths_mm[which], 1)
        if self.turns_freely:
            slopes[:, 3] = 0.0
        return slopes

    def _one_by_one(
        self, which: Int64Array, own: FloatArray, values_of: Callable[[ToolPath, FloatArray], FloatArray]
    ) -> FloatArray:
        """Return values of each piece's own path, for pieces that do not fall."""
        ends = np.flatnonzero(np.diff(which)) + 1
        parts = list[FloatArray]()
        for rows in np.split(np.arange(len(which)), ends):
            check_planning_time()
            piece = self.pieces[which[rows[0]]]
            assert isinstance(piece, ToolPiece)
            parts.append(values_of(piece.followed.path, piece.begin + own[rows]))
        return np.concatenate(parts)


def _table(pieces: Sequence[PathPiece]) -> Contour | None:
    """Return lines, arcs and roundings as a contour's pieces; None if there is another path of the tool."""
    count = len(pieces)
    coefficients, circles, angles = np.zeros((count, _DEGREE + 1, _POSE)), np.zeros((count, 2, 3)), np.zeros(count)
    columns = _POSE
    for i, piece in enumerate(pieces):
        if isinstance(piece, ToolPiece):
            path = piece.followed.path
            path = path.path if isinstance(path, FreeAttitude) else path
            match path:
                case StraightLine():
                    begin, end = path.poses(np.array([piece.begin, piece.begin + piece.length]))
                    columns = len(begin)
                    coefficients[i, 4:, :columns] = end - begin, begin
                case Arc():
                    columns = _POSE if path.attitudes_deg else _POSE - 1
                    angles[i] = _arc(path, piece, coefficients[i], circles[i])
                case ToolRounding():
                    rows = _powers(np.asarray(path.curve.c)[:, 0])
                    columns = rows.shape[1]
                    coefficients[i, :, :columns] = rows
                case _:
                    return None
    lengths = np.array([piece.length for piece in pieces])
    zeros = np.zeros(count)
    return Contour(
        coefficients, circles, angles, zeros, lengths, zeros, np.zeros(count, np.int64), zeros, columns=columns
    )


def _arc(path: Arc, piece: ToolPiece, coefficients: FloatArray, circle: FloatArray) -> float:
    """Write a part of an arc; return its angle in rad."""
    turned = piece.begin / path.radius_mm
    cos, sin = np.cos(turned), np.sin(turned)
    circle[0] = path.radius_mm * (cos * path.outward + sin * path.onward)
    circle[1] = path.radius_mm * (cos * path.onward - sin * path.outward)
    coefficients[5, :3] = path.centre_mm
    if path.attitudes_deg is not None:
        rate = (path.attitudes_deg[1] - path.attitudes_deg[0]) / path.length_mm
        coefficients[5, 3] = path.attitudes_deg[0] + rate * piece.begin
        coefficients[4, 3] = rate * piece.length
    return piece.length / path.radius_mm
