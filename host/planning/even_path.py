"""A tool path over its true length: with a constant speed of its parameter the tool itself has a constant speed."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Self

import numpy as np
import scipy

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.paths import SampledPath

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

EVENNESS: Final = 0.005
"""Largest part by which the tool's speed differs from that of the parameter."""

_PARTS_MIN, _PARTS_MAX = 16, 1024
"""Number of parts into which the curve between two poses is divided to measure it: as many as EVENNESS takes."""
_BETWEEN: Final = np.arange(1, 8) / 8
"""Places in a part at which the speed is checked."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)
"""Gauss' nodes and weights for the length of a part: exact for polynomials of degree 11."""


@dataclass(frozen=True, slots=True, eq=False)
class EvenPath:
    """A curve through poses, as a function of its length to within EVENNESS; made by `of`.

    Attributes:
        path: the curve, over the length of the polygon through the poses.
        parameter: that length as a function of the true one, with a continuous second derivative.
    """

    path: SampledPath
    parameter: "CubicSpline"

    @classmethod
    def of(cls, path: SampledPath) -> Self:
        """Return a curve over its true length; raise InputError if the tool turns back on the spot somewhere on it."""
        parts = _PARTS_MIN
        while True:
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
        """Return the curve, measured in this number of parts between two poses."""
        poses_at = path.curve.x
        knots = np.interp(np.arange(parts * (len(poses_at) - 1) + 1) / parts, np.arange(len(poses_at)), poses_at)
        half = np.diff(knots)[:, np.newaxis] / 2
        speeds = _speeds(path, (knots[:-1, np.newaxis] + half * (1 + _NODES)).ravel()).reshape(len(half), -1)
        lengths_mm = np.concatenate(([0.0], np.cumsum((half * speeds) @ _WEIGHTS)))
        ends = 1 / np.maximum(_speeds(path, knots[[0, -1]]), EVENNESS)
        begin, end = ends.tolist()
        return cls(path, scipy.interpolate.CubicSpline(lengths_mm, knots, bc_type=((1, begin), (1, end))))

    def unevenness(self) -> FloatArray:
        """Return the largest part by which the speed is off in each part of the curve."""
        s_mm = self.parameter.x
        between_mm = (s_mm[:-1, np.newaxis] + np.diff(s_mm)[:, np.newaxis] * _BETWEEN).ravel()
        off = np.abs(np.linalg.norm(self.derivatives(between_mm)[:, :3], axis=1) - 1)
        return np.asarray(off.reshape(-1, len(_BETWEEN)).max(axis=1))

    @property
    def length_mm(self) -> float:
        """Length of the curve."""
        return float(self.parameter.x[-1])

    def poses(self, s_mm: FloatArray) -> FloatArray:
        """Return poses of shape (n, 4)."""
        return self.path.poses(self._polygon_mm(s_mm))

    def derivatives(self, s_mm: FloatArray) -> FloatArray:
        """Return derivatives of shape (n, 4)."""
        return np.asarray(self.path.derivatives(self._polygon_mm(s_mm)) * self.parameter(s_mm, 1)[:, np.newaxis])

    def _polygon_mm(self, s_mm: FloatArray) -> FloatArray:
        """Return the length of the polygon, which rounding must not lead beyond its end: there is no curve."""
        return np.asarray(np.clip(self.parameter(s_mm), 0.0, self.path.length_mm))


def _speeds(path: SampledPath, parameter: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(path.derivatives(parameter)[:, :3], axis=1))
