"""A path of the tool of very many lines, arcs and roundings, whose poses are computed for all of them at once.

Each piece is a polynomial of degree five of its own part, from 0 to 1, and, for an arc or a helix, a circle on top of
it. Where two pieces meet, the direction stays, but the curvature may jump: the path is looked at on both sides.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from steptwin.features.fastest.pieces import FollowedPath
from steptwin.features.fastest.rows import PathLimits, PathRates
from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.robots.robot import Robot

_DEGREE: Final = 5
_PLACES_A_MM: Final = 4.0
"""Places on a piece for the square root of its length in mm: short pieces need few."""
_PLACES_MIN, _PLACES_MAX = 3, 40
_PLACES_ROUNDING: Final = 7
"""Least number of places on a rounding: its curvature is highest in the middle, and 0 at its ends."""
_SMALL: Final = 1e-4
"""Half of the step of central differences, in mm."""


@dataclass(frozen=True, eq=False)
class Contour:
    """Pieces in a row; implements ToolPath.

    Attributes:
        coefficients: shape (pieces, 6, 4), polynomials of x, y, z in mm and of the turn in degrees, from the highest
            power of the part on.
        circles: shape (pieces, 2, 3), the vectors of the circle's cosine and sine, 0 where there is none.
        angles_rad: shape (pieces,), angle of the circle over the piece.
        growths: shape (pieces,), part of its radius by which the circle grows over the piece.
        lengths_mm: shape (pieces,), lengths of the parameter, above 0; that of a rounding is both its parts of legs.
        speeds_mm_s: shape (pieces,), highest speed of the tool on each.
        lines: shape (pieces,), number of the line in the file that made each.
        roundings: shape (pieces,), True for a rounding.
        attitude: columns of a pose behind x, y and z that stay; empty where the turn is the only one, or there is none.
        columns: columns of a pose: 3 for a tool without attitude, 4 with the turn.
    """

    coefficients: FloatArray
    circles: FloatArray
    angles_rad: FloatArray
    growths: FloatArray
    lengths_mm: FloatArray
    speeds_mm_s: FloatArray
    lines: Int64Array
    roundings: FloatArray
    attitude: tuple[float, ...] = ()
    columns: int = 4

    @cached_property
    def starts_mm(self) -> FloatArray:
        """Shape (pieces + 1,), where each piece begins, and the end."""
        return np.concatenate([[0.0], np.cumsum(self.lengths_mm)])

    @property
    def length_mm(self) -> float:
        """Length of the parameter."""
        return float(self.starts_mm[-1])

    def poses(self, s_mm: FloatArray) -> FloatArray:
        """Return poses of shape (n, task.width)."""
        return self.poses_of(*self.place_of(s_mm))

    def derivatives(self, s_mm: FloatArray) -> FloatArray:
        """Return derivatives by the length, of shape (n, task.rates)."""
        return self.rates_of(*self.place_of(s_mm), 1)

    def place_of(self, s_mm: FloatArray) -> tuple[Int64Array, FloatArray]:
        """Return the piece, the later of two that meet, and the part of it from 0 to 1, at lengths of shape (n,)."""
        piece = np.clip(np.searchsorted(self.starts_mm, s_mm, side="right") - 1, 0, len(self.lengths_mm) - 1)
        return piece, (s_mm - self.starts_mm[piece]) / self.lengths_mm[piece]

    def poses_of(self, piece: Int64Array, part: FloatArray) -> FloatArray:
        """Return poses at parts of pieces."""
        columns = self._values(piece, part, 0)[:, : self.columns]
        if not self.attitude:
            return columns
        return np.column_stack([columns[:, :3], np.tile(np.array(self.attitude), (len(piece), 1))])

    def rates_of(self, piece: Int64Array, part: FloatArray, order: int) -> FloatArray:
        """Return first or second derivatives of the poses by the length, at parts of pieces."""
        columns = self._values(piece, part, order)[:, : self.columns]
        columns /= self.lengths_mm[piece, np.newaxis] ** order
        return np.column_stack([columns[:, :3], np.zeros((len(piece), 3))]) if self.attitude else columns

    def _values(self, piece: Int64Array, part: FloatArray, order: int) -> FloatArray:
        """Return the four columns, or their derivatives by the part, of shape (n, 4)."""
        values = polynomials(self.coefficients, piece, part[:, np.newaxis], order)
        round_ = np.flatnonzero(self.angles_rad[piece])
        if len(round_):
            own, at = piece[round_], part[round_]
            ways = (1.0 + self.growths[own] * at)[:, np.newaxis] * self._ways_round(own, at, order)
            if order:
                ways += (order * self.growths[own])[:, np.newaxis] * self._ways_round(own, at, order - 1)
            values[round_, :3] += np.einsum("nk,nkj->nj", ways, self.circles[own])
        return values

    def _ways_round(self, piece: Int64Array, part: FloatArray, order: int) -> FloatArray:
        """Return cosine and sine of circles without growth, or their derivatives by the part, of shape (n, 2)."""
        angle = self.angles_rad[piece]
        turned = angle * part + order * np.pi / 2  # a derivative turns by a right angle
        return np.stack([np.cos(turned), np.sin(turned)], axis=1) * (angle**order)[:, np.newaxis]

    @cached_property
    def looked_at(self) -> tuple[Int64Array, FloatArray]:
        """The pieces and parts of them, both of shape (places,), at which limits are looked at; joints stand twice."""
        by_length = np.ceil(_PLACES_A_MM * np.sqrt(self.lengths_mm)).astype(np.int64)
        counts = np.clip(by_length, np.where(self.roundings, _PLACES_ROUNDING, _PLACES_MIN), _PLACES_MAX)
        piece = np.repeat(np.arange(len(counts)), counts)
        first = np.repeat(np.cumsum(counts) - counts, counts)
        even = (np.arange(len(piece)) - first) / (counts - 1)[piece]
        return piece, np.where(self.roundings[piece], even, (1.0 - np.cos(np.pi * even)) / 2.0)


_FACTORS: Final = tuple(
    tuple(float(np.prod(range(power - order + 1, power + 1))) for power in range(_DEGREE, order - 1, -1))
    for order in range(3)
)
"""What a derivative of each order multiplies the powers by, from the highest one on."""


def polynomials(coefficients: FloatArray, piece: Int64Array, part: FloatArray, order: int) -> FloatArray:
    """Return the values of polynomials of shape (pieces, 6, columns), or a derivative, at parts of shape (n, 1)."""
    values = np.zeros((len(part), coefficients.shape[2]))
    for row, factor in zip(range(_DEGREE + 1 - order), _FACTORS[order], strict=True):
        values *= part
        values += factor * coefficients[piece, row]
    return values


@dataclass(frozen=True, eq=False)
class ContourPath:
    """A contour with the joints that follow it; implements LimitedPath."""

    robot: Robot
    contour: Contour
    followed: FollowedPath

    def rates(self) -> PathRates:
        """Return the joints' path at the contour's places; where two pieces meet, on both sides."""
        return self._rates

    @cached_property
    def _rates(self) -> PathRates:
        contour, kinematics, (piece, part) = self.contour, self.followed.kinematics, self.contour.looked_at
        ends = np.append(np.flatnonzero(np.diff(piece)), len(piece) - 1)
        s = contour.starts_mm[piece] + part * contour.lengths_mm[piece]
        s[ends] = contour.starts_mm[1:]
        joints = self.followed.joints(s)
        slopes, bends = (self._without_turn(contour.rates_of(piece, part, order)) for order in (1, 2))
        first = kinematics.joint_velocities(joints, slopes)
        # the joints' second derivative is that of the pose, and the Jacobian's change on the way
        before, after = (kinematics.joint_velocities(joints + side * _SMALL * first, slopes) for side in (-1.0, 1.0))
        second = kinematics.joint_velocities(joints, bends) + (after - before) / (2.0 * _SMALL)
        return PathRates(s, joints, first, second, _way_and_turn(slopes))

    def limits(self) -> PathLimits:
        """Return the limits at the same places."""
        speeds = self.contour.speeds_mm_s[self.contour.looked_at[0]]
        tool = np.column_stack([speeds, np.full(len(speeds), np.inf)])
        return PathLimits.of(self.robot, np.full(len(speeds), 100.0), tool)

    def at(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return joints and their first derivatives at lengths of shape (n,)."""
        joints, slopes = self.followed.joints(s), self._without_turn(self.contour.derivatives(s))
        return joints, self.followed.kinematics.joint_velocities(joints, slopes)

    def tool(self, s: FloatArray) -> FloatArray:
        """Return the tool's ways and turns at lengths of shape (n,)."""
        return _way_and_turn(self._without_turn(self.contour.derivatives(s)))

    def _without_turn(self, rates: FloatArray) -> FloatArray:
        if self.followed.kinematics.attitude_follows:
            rates[:, 3] = 0.0
        return rates


def _way_and_turn(slopes: FloatArray) -> FloatArray:
    """Return the tool's way in mm and its turn in space in degrees, shape (n, 2), for derivatives of its poses."""
    turning = np.linalg.norm(slopes[:, 3:6], axis=1) if slopes.shape[1] > 4 else np.zeros(len(slopes))
    return np.column_stack([np.linalg.norm(slopes[:, :3], axis=1), turning])


def rounding_coefficients(begin: FloatArray, end: FloatArray) -> FloatArray:
    """Return the quintics between two ends as coefficients of shape (n, 6, 4), from the highest power on.

    Both ends are values, first and second derivatives by the part, of shape (n, 3, 4).
    """
    p, v, a = begin[:, 0], begin[:, 1], begin[:, 2]
    way, gain, bend = end[:, 0] - p - v - a / 2, end[:, 1] - v - a, end[:, 2] - a
    rows = [6 * way - 3 * gain + bend / 2, -15 * way + 7 * gain - bend, 10 * way - 4 * gain + bend / 2, a / 2, v, p]
    return np.stack(rows, axis=1)
