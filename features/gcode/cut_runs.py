"""G-code for tool paths: a reader of our own, the words that hold from line to line, and paths without a stop.

Without a stop, nearly straight lines are merged, and the corners between moves rounded.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import dist
from typing import Final, Self

import numpy as np

from steptwin.features.fastest.contour import Contour, rounding_coefficients
from steptwin.features.gcode.arc_fit import with_arcs
from steptwin.features.gcode.modal import ArcShape, CutMove
from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.planning.no_way import NO_WAY

KINK_MAX_DEG: Final = 0.1
"""Angle up to which a corner is none, so that the path flows on without a rounding."""

_PASS: Final = 3.0 / 16.0
"""Part of r |t2 - t1| at which a rounding by r passes its corner, t1 and t2 being the directions of length 1."""
_MERGED_MAX: Final = 200
"""Lines that are merged into one at most: each is compared with all before it."""
_TURN_KINK_DEG_MM: Final = 1e-3
"""Jump of the turn for each mm from which on it makes a corner."""
_LEAST_MM: Final = 1e-3
"""Least rounding; where a corner is to be passed nearer, the tool stops."""


@dataclass(frozen=True, slots=True, eq=False)
class Placing:
    """Where the file's coordinates are in the station.

    Attributes:
        origin: shape (3,), place of their origin in mm, for the robot's tool.
        axes: shape (3, 3), their axes as rows.
        turn_deg: what is added to the file's turn.
        attitude: columns of a pose behind x, y and z that stay; empty where the turn is the only one, or there is none.
        columns: columns of a pose: 3 for a tool without attitude, 4 with the turn.
    """

    origin: FloatArray
    axes: FloatArray
    turn_deg: float
    attitude: tuple[float, ...]
    columns: int

    def pose(self, spot: Sequence[float]) -> tuple[float, ...]:
        """Return the pose of a spot."""
        place = self.origin + np.array(spot[:3]) @ self.axes
        return (*place.tolist(), *(self.attitude or ((spot[3] + self.turn_deg,) if self.columns > 3 else ())))

    def spot(self, pose: Sequence[float]) -> tuple[float, float, float, float]:
        """Return the spot of a pose."""
        x, y, z = (self.axes @ (np.array(pose[:3]) - self.origin)).tolist()
        return x, y, z, pose[3] - self.turn_deg if self.columns > 3 and not self.attitude else 0.0


# --- merging


def _merged(moves: Sequence[CutMove]) -> tuple[CutMove, ...]:
    """Return the moves with lines in a row taken for one, where all their corners are within the distance asked for."""
    found: list[CutMove] = []
    corners: list[tuple[float, float, float]] = []
    for move in moves:
        corner = move.start[:3]
        if found and len(corners) < _MERGED_MAX and _go_together(found[-1], move):
            kept = [*corners, corner]
            if _is_straight(found[-1].start[:3], move.goal[:3], kept, move.corner.merge_mm):
                found[-1], corners = replace(found[-1], goal=move.goal), kept
                continue
        found.append(move)
        corners = []
    return tuple(found)


def _go_together(first: CutMove, second: CutMove) -> bool:
    return (
        second.corner.merge_mm > 0
        and first.arc is None
        and second.arc is None
        and not second.changes
        and first.feed_mm_s == second.feed_mm_s
        and first.corner == second.corner
        and first.start[3] == first.goal[3] == second.goal[3]
    )


def _is_straight(
    start: tuple[float, ...], goal: tuple[float, ...], corners: Sequence[tuple[float, ...]], off_mm: float
) -> bool:
    """Return whether corners lie along a line in their order, none farther from it than a distance."""
    length = dist(start, goal)
    if length <= NO_WAY:
        return False
    dx, dy, dz = ((b - a) / length for a, b in zip(start, goal, strict=True))
    before = 0.0
    for x, y, z in ((c[0] - start[0], c[1] - start[1], c[2] - start[2]) for c in corners):
        along = x * dx + y * dy + z * dz
        if not before <= along <= length or x * x + y * y + z * z - along * along > off_mm * off_mm:
            return False
        before = along
    return True


# --- legs and corners


_NO_ARC: Final = ArcShape(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Legs:
    """Moves as pieces in the file's coordinates, by the part from 0 to 1; arrays are as those of Contour."""

    coefficients: FloatArray
    circles: FloatArray
    angles: FloatArray
    growths: FloatArray
    lengths: FloatArray

    @classmethod
    def of(cls, moves: Sequence[CutMove]) -> "_Legs":
        start, goal = np.array([move.start for move in moves]), np.array([move.goal for move in moves])
        shapes = [move.arc or _NO_ARC for move in moves]
        arcs = np.array([(arc.x_mm, arc.y_mm, arc.sweep_rad, arc.growth) for arc in shapes])
        angles, growths = arcs[:, 2], arcs[:, 3]
        is_arc = (angles != 0.0)[:, np.newaxis]
        rows, planes = np.arange(len(moves))[:, np.newaxis], np.array([arc.plane for arc in shapes])
        spokes = np.where(is_arc, start[rows, planes] - arcs[:, :2], 0.0)
        coefficients, circles = np.zeros((len(moves), 6, 4)), np.zeros((len(moves), 2, 3))
        coefficients[:, 5], coefficients[:, 4] = start, goal - start
        coefficients[rows, 5, planes] -= spokes
        coefficients[rows, 4, planes] = np.where(is_arc, 0.0, coefficients[rows, 4, planes])
        circles[rows, 0, planes] = spokes
        circles[rows, 1, planes] = np.stack([-spokes[:, 1], spokes[:, 0]], axis=1)
        radii_mm = np.hypot(*spokes.T)
        round_mm = radii_mm * (1.0 + growths / 2.0) * np.abs(angles)
        lengths = np.sqrt(np.sum(coefficients[:, 4, :3] ** 2, axis=1) + round_mm**2 + (radii_mm * growths) ** 2)
        return cls(coefficients, circles, angles, growths, lengths)

    def own(self, begin: int, end: int) -> Self:
        """Return some of the legs."""
        arrays = (self.coefficients, self.circles, self.angles, self.growths, self.lengths)
        return type(self)(*(each[begin:end] for each in arrays))

    def ends(self, part: FloatArray) -> FloatArray:
        """Return values, first and second derivatives by the length, shape (legs, 3, 4), at a part of each leg."""
        length = self.lengths[:, np.newaxis]
        cos, sin = (f(self.angles * part)[:, np.newaxis] for f in (np.cos, np.sin))
        spin, growing = ((each / self.lengths)[:, np.newaxis] for each in (self.angles, self.growths))
        grown = 1.0 + (self.growths * part)[:, np.newaxis]
        first, second = self.circles[:, 0], self.circles[:, 1]
        outward, onward = first * cos + second * sin, second * cos - first * sin
        values = np.zeros((len(part), 3, 4))
        values[:, 0] = self.coefficients[:, 5] + part[:, np.newaxis] * self.coefficients[:, 4]
        values[:, 1] = self.coefficients[:, 4] / length
        values[:, 0, :3] += grown * outward
        values[:, 1, :3] += grown * spin * onward + growing * outward
        values[:, 2, :3] = 2.0 * growing * spin * onward - grown * spin**2 * outward
        return values

    def radii_mm(self, moves: Sequence[CutMove], blend_mm: float) -> tuple[FloatArray, BoolArray]:
        """Return how far each corner is rounded, and whether the tool stops there, both of shape (moves - 1,)."""
        last, first = self.ends(np.ones(len(moves)))[:-1, 1], self.ends(np.zeros(len(moves)))[1:, 1]
        kink = np.linalg.norm(_directions(last) - _directions(first), axis=1)
        turns_on = np.abs(last[:, 3] - first[:, 3]) <= _TURN_KINK_DEG_MM
        flows = (kink <= 2.0 * np.sin(np.deg2rad(KINK_MAX_DEG) / 2.0)) & turns_on
        modes = [move.corner for move in moves[:-1]]
        passes = np.array([np.inf if mode.passes_mm is None else mode.passes_mm for mode in modes])
        with np.errstate(divide="ignore"):
            wanted = np.where(np.isfinite(passes), passes / (_PASS * kink), blend_mm)
        wanted[[mode.is_exact for mode in modes]] = 0.0
        radii = np.minimum(wanted, np.minimum(self.lengths[:-1], self.lengths[1:]) / 2.0)
        radii[flows] = 0.0
        stops = ~flows & (radii < _LEAST_MM)
        return np.where(stops, 0.0, radii), stops

    def contour(self, placing: Placing, moves: Sequence[CutMove], radii: FloatArray) -> tuple[Contour, FloatArray]:
        """Return the path through the legs, whose corners are rounded so far, and where on it each leg begins."""
        begin, end = np.append(0.0, radii) / self.lengths, 1.0 - np.append(radii, 0.0) / self.lengths
        count, feeds = len(moves), np.array([move.feed_mm_s for move in moves])
        coefficients, circles = np.zeros((2 * count - 1, 6, 4)), np.zeros((2 * count - 1, 2, 3))
        angles, growths, lengths, speeds = np.zeros((4, 2 * count - 1))
        coefficients[::2], circles[::2], angles[::2], growths[::2] = self.between(begin, end)
        lengths[::2], lengths[1::2] = (end - begin) * self.lengths, 2.0 * radii
        speeds[::2], speeds[1::2] = feeds, np.minimum(feeds[:-1], feeds[1:])
        powers = (2.0 * radii)[:, np.newaxis, np.newaxis] ** np.arange(3)[:, np.newaxis]
        coefficients[1::2] = rounding_coefficients(self.ends(end)[:-1] * powers, self.ends(begin)[1:] * powers)
        numbers = np.array([move.line for move in moves]).repeat(2)[:-1]
        is_rounding = np.arange(2 * count - 1) % 2 == 1
        kept = lengths > 0.0
        kept[::2] &= (lengths[::2] > NO_WAY) | ((begin == 0.0) & (end == 1.0))  # a whole leg stays, however short
        starts = np.concatenate([[0.0], np.cumsum(np.where(kept, lengths, 0.0))])
        begins = starts[:-1][::2] - np.append(0.0, radii)
        coefficients[:, :, :3] = coefficients[:, :, :3] @ placing.axes
        coefficients[:, 5, :3] += placing.origin
        coefficients[:, 5, 3] += placing.turn_deg
        contour = Contour(
            coefficients[kept],
            circles[kept] @ placing.axes,
            angles[kept],
            growths[kept],
            lengths[kept],
            speeds[kept],
            numbers[kept],
            is_rounding[kept],
            placing.attitude,
            placing.columns,
        )
        return contour, begins

    def between(self, begin: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return coefficients, circles, angles and growths of the part of each leg between two parts of it."""
        coefficients, width = self.coefficients.copy(), (end - begin)[:, np.newaxis]
        coefficients[:, 5] += begin[:, np.newaxis] * coefficients[:, 4]
        coefficients[:, 4] *= width
        turned = (self.angles * begin)[:, np.newaxis]
        cos, sin = np.cos(turned), np.sin(turned)
        first, second = self.circles[:, 0], self.circles[:, 1]
        grown = 1.0 + self.growths * begin
        circles = np.stack([first * cos + second * sin, second * cos - first * sin], axis=1)
        circles *= grown[:, np.newaxis, np.newaxis]
        return coefficients, circles, self.angles * width[:, 0], self.growths * width[:, 0] / grown


def _directions(slopes: FloatArray) -> FloatArray:
    """Return the directions of length 1 of the places' derivatives, shape (n, 3)."""
    return np.asarray(slopes[:, :3] / np.linalg.norm(slopes[:, :3], axis=1, keepdims=True))


# --- runs


@dataclass(frozen=True, slots=True, eq=False)
class CutRun:
    """Moves that follow each other without a stop, or with stops that make them faster; made by `of`.

    Attributes:
        contour: the path.
        moves: the moves, merged.
        begins_mm: shape (moves,), where each begins on the path, or the middle of the rounding before it.
        radii_mm: shape (moves - 1,), how far each corner is rounded; 0 at stops, and where two moves flow on.
        stops: corners in which it stops, by their numbers, rising.
    """

    contour: Contour
    moves: tuple[CutMove, ...]
    begins_mm: FloatArray
    radii_mm: FloatArray
    stops: tuple[int, ...]
    _legs: _Legs
    _placing: Placing

    @classmethod
    def of(cls, legs: _Legs, moves: Sequence[CutMove], placing: Placing, radii_mm: FloatArray) -> Self:
        """Return the run through legs, whose corners are rounded so far."""
        contour, begins_mm = legs.contour(placing, moves, radii_mm)
        return cls(contour, tuple(moves), begins_mm, radii_mm, (), legs, placing)

    @property
    def stops_mm(self) -> FloatArray:
        """Where it stops."""
        return self.begins_mm[1:][list(self.stops)]

    def stopping_in(self, corners: Sequence[int]) -> Self:
        """Return the run that stops in some of its corners, by their numbers, rising."""
        radii_mm = self.radii_mm.copy()
        radii_mm[list(corners)] = 0.0
        return replace(self.of(self._legs, self.moves, self._placing, radii_mm), stops=tuple(corners))


def curved(moves: Sequence[CutMove]) -> list[CutMove]:
    """Return the moves with short lines in a row taken for arcs, within the distance in which lines are merged."""
    return with_arcs(moves, _go_together)


def cut_runs(moves: Sequence[CutMove], placing: Placing, blend_mm: float) -> list[CutRun]:
    """Return moves, each of which begins where the one before ends, as runs from stop to stop.

    Moves have a length. `blend_mm` rounds corners where the file says nothing of them; 0 stops there.
    """
    merged = _merged(moves)
    legs = _Legs.of(merged)
    radii_mm, stops = legs.radii_mm(merged, blend_mm)
    ends = [0, *(np.flatnonzero(stops) + 1).tolist(), len(merged)]
    return [
        CutRun.of(legs.own(begin, end), merged[begin:end], placing, radii_mm[begin : end - 1])
        for begin, end in pairwise(ends)
    ]
