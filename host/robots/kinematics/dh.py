"""Denavit-Hartenberg tables as data, in the form that papers print; they give each pose in an independent way.

Papers use two conventions:

    standard (distal)             T_i = Rz(theta_i) Tz(d_i) Tx(a_i) Rx(alpha_i)
    modified (Craig, proximal)    T_i = Rx(alpha_i-1) Tx(a_i-1) Rz(theta_i) Tz(d_i)

Sources: J. Denavit, R. S. Hartenberg, "A kinematic notation for lower-pair mechanisms based on matrices", 1955;
J. J. Craig, "Introduction to Robotics: Mechanics and Control", section 3.4.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

import numpy as np

from steptwin.host.common.arrays import FloatArray

Variables = Mapping[str, FloatArray]
"""The variables of a table by name, in mm and degrees, each of shape (n,)."""


class Convention(Enum):
    """The end of a link at which its frame is: the far end (standard) or the near end (modified)."""

    STANDARD = "standard"
    MODIFIED = "modified"


@dataclass(frozen=True, slots=True)
class Parameter:
    """A constant, or a constant plus or minus one variable, in mm or degrees."""

    constant: float = 0.0
    variable: str = ""
    sign: int = 1

    def __str__(self) -> str:
        if not self.variable:
            return f"{self.constant:g}"
        signed = f"-{self.variable}" if self.sign < 0 else self.variable
        return f"{signed} {'-' if self.constant < 0 else '+'} {abs(self.constant):g}" if self.constant else signed

    def values(self, variables: Variables) -> FloatArray:
        """Return the parameter's values, of shape (n,), or () for a constant."""
        if not self.variable:
            return np.asarray(self.constant)
        return self.constant + self.sign * variables[self.variable]


@dataclass(frozen=True, slots=True)
class DhRow:
    """One link: twist alpha and angle theta in degrees, length a and offset d in mm."""

    alpha_deg: float
    a_mm: float
    d_mm: Parameter
    theta_deg: Parameter


@dataclass(frozen=True, slots=True)
class DhTable:
    """The rows of a table from the world frame to the tool, in one convention."""

    convention: Convention
    rows: tuple[DhRow, ...]

    def transforms(self, variables: Variables) -> FloatArray:
        """Return the tool's homogeneous transforms in the world frame, of shape (n, 4, 4), lengths in mm."""
        count = max((len(values) for values in variables.values()), default=1)
        product = np.broadcast_to(np.eye(4), (count, 4, 4))
        for row in self.rows:
            product = product @ self._link(row, variables, count)
        return product

    def _link(self, row: DhRow, variables: Variables, count: int) -> FloatArray:
        fixed = _rotation_x(row.alpha_deg)
        fixed[0, 3] = row.a_mm
        moving = _screw_z(row.theta_deg.values(variables), row.d_mm.values(variables), count)
        return fixed @ moving if self.convention is Convention.MODIFIED else moving @ fixed


def _rotation_x(angle_deg: float) -> FloatArray:
    c, s = np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))
    return np.array([[1.0, 0.0, 0.0, 0.0], [0.0, c, -s, 0.0], [0.0, s, c, 0.0], [0.0, 0.0, 0.0, 1.0]])


def _screw_z(theta_deg: FloatArray, d_mm: FloatArray, count: int) -> FloatArray:
    """Return the rotation about z together with the shift along z; their order does not matter."""
    screw = np.zeros((count, 4, 4))
    c, s = np.cos(np.deg2rad(theta_deg)), np.sin(np.deg2rad(theta_deg))
    screw[:, 0, 0], screw[:, 0, 1] = c, -s
    screw[:, 1, 0], screw[:, 1, 1] = s, c
    screw[:, 2, 2], screw[:, 3, 3] = 1.0, 1.0
    screw[:, 2, 3] = d_mm
    return screw
