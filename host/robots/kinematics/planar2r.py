"""The arm of every SCARA from shoulder to wrist: two links in a plane.

    x = l1 cos th1 + l2 cos(th1 + th2)        y = l1 sin th1 + l2 sin(th1 + th2)

The inverse follows from the law of cosines. It uses atan2 throughout, which keeps the quadrant; the sign of the elbow
is the only choice (J. J. Craig, "Introduction to Robotics", section 4.4):

    c2 = (x^2 + y^2 - l1^2 - l2^2) / (2 l1 l2)    th2 = +-atan2(sqrt(1 - c2^2), c2)
    th1 = atan2(y, x) - atan2(l2 sin th2, l1 + l2 cos th2)

Angles are in radians here. All arguments and results are arrays of one shape.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError

REACH_TOLERANCE: Final = 1e-9
"""Rounding error by which |c2| may exceed 1 for a wrist on the edge of reach."""


class Elbow(Enum):
    """The side of the line from shoulder to wrist on which the elbow is, seen outwards; right has th2 >= 0."""

    RIGHT = "right"
    LEFT = "left"

    @property
    def sign(self) -> int:
        """The sign of th2."""
        return 1 if self is Elbow.RIGHT else -1


@dataclass(frozen=True, slots=True)
class Planar2R:
    """The two links, in mm; raises InputError unless both are longer than 0."""

    l1_mm: float
    l2_mm: float

    def __post_init__(self) -> None:
        if not (self.l1_mm > 0 and self.l2_mm > 0):
            raise InputError(f"links of {self.l1_mm:g} and {self.l2_mm:g} mm make no arm")

    @property
    def reach_mm(self) -> tuple[float, float]:
        """The least and the greatest distance of the wrist from the shoulder."""
        return abs(self.l1_mm - self.l2_mm), self.l1_mm + self.l2_mm

    def forward(self, th1_rad: FloatArray, th2_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the wrist's x and y in mm."""
        x_mm = self.l1_mm * np.cos(th1_rad) + self.l2_mm * np.cos(th1_rad + th2_rad)
        y_mm = self.l1_mm * np.sin(th1_rad) + self.l2_mm * np.sin(th1_rad + th2_rad)
        return x_mm, y_mm

    def inverse(self, x_mm: FloatArray, y_mm: FloatArray, elbow: Elbow) -> tuple[FloatArray, FloatArray]:
        """Return th1 in (-2 pi, 2 pi) and th2 in [-pi, pi]; both are NaN where the wrist is out of reach."""
        l1, l2 = self.l1_mm, self.l2_mm
        c2 = (x_mm**2 + y_mm**2 - l1**2 - l2**2) / (2.0 * l1 * l2)
        c2 = np.where(np.abs(c2) <= 1.0 + REACH_TOLERANCE, np.clip(c2, -1.0, 1.0), np.nan)
        th2_rad = elbow.sign * np.arctan2(np.sqrt(1.0 - c2**2), c2)
        th1_rad = np.arctan2(y_mm, x_mm) - np.arctan2(l2 * np.sin(th2_rad), l1 + l2 * c2)
        return th1_rad, th2_rad

    def determinant(self, th2_rad: FloatArray) -> FloatArray:
        """Return det J = l1 l2 sin th2 in mm^2; it is 0 where the arm is stretched or folded and the branches meet."""
        return np.asarray(self.l1_mm * self.l2_mm * np.sin(th2_rad))

    def joint_velocities(
        self, th1_rad: FloatArray, th2_rad: FloatArray, vx_mm_s: FloatArray, vy_mm_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the joints' speeds in rad/s for the wrist's velocity: J^-1 v in closed form; not finite if singular.

        J = [[-y, -l2 s12], [x, l2 c12]] with the wrist (x, y), s12 = sin(th1 + th2), c12 = cos(th1 + th2).
        """
        x_mm, y_mm = self.forward(th1_rad, th2_rad)
        across = self.l2_mm * (np.cos(th1_rad + th2_rad) * vx_mm_s + np.sin(th1_rad + th2_rad) * vy_mm_s)
        outward = x_mm * vx_mm_s + y_mm * vy_mm_s
        det = self.determinant(th2_rad)
        with np.errstate(divide="ignore", invalid="ignore"):
            return across / det, -outward / det
