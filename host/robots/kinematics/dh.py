"""Denavit-Hartenberg tables as data, in the form of papers: an independent computation of each pose.


Papers use two conventions:

    standard (distal)             T_i = Rz(theta_i) Tz(d_i) Tx(a_i) Rx(alpha_i)
    modified (Craig, proximal)    T_i = Rx(alpha_i-1) Tx(a_i-1) Rz(theta_i) Tz(d_i)

Sources: J. Denavit, R. S. Hartenberg, "A kinematic notation for lower-pair mechanisms based on matrices", 1955;
J. J. Craig, "Introduction to Robotics: Mechanics and Control", section 3.4.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Self

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.poses.base_frame import STATION, BaseFrame

Variables = Mapping[str, FloatArray]
"""Variables of a table by name, in mm and degrees, each of shape (n,)."""


class Convention(Enum):
    """End of a link at which its frame is: the far end (standard) or the near end (modified)."""

    STANDARD = "standard"
    MODIFIED = "modified"


@dataclass(frozen=True, slots=True)
class DhParameter:
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
        """Return the values of the parameter, of shape (n,), or () for a constant."""
        if not self.variable:
            return np.asarray(self.constant)
        return self.constant + self.sign * variables[self.variable]


@dataclass(frozen=True, slots=True)
class DhRow:
    """One link: twist alpha and angle theta in degrees, length a and offset d in mm."""

    alpha_deg: float
    a_mm: float
    d_mm: DhParameter
    theta_deg: DhParameter

    def with_errors(self, a_mm: float, alpha_deg: float, d_mm: float, theta_deg: float) -> Self:
        """Return the link with errors added to its parameters."""
        offset, angle = self.d_mm, self.theta_deg
        return replace(
            self,
            alpha_deg=self.alpha_deg + alpha_deg,
            a_mm=self.a_mm + a_mm,
            d_mm=replace(offset, constant=offset.constant + d_mm),
            theta_deg=replace(angle, constant=angle.constant + theta_deg),
        )


@dataclass(frozen=True, slots=True)
class TwoSliders:
    """Two sliders on parallel upright screws, linked to one platform: they move two variables that are no joints.

    Attributes:
        carrier: joint that carries the screws.
        left: joint of the slider that is nearer to the carrier's axis.
        right: joint of the other slider.
        across: variable of the platform's distance from the middle between the screws, away from the carrier's axis.
        up: variable of the platform's height.
        middle_mm: distance of the middle between the screws from the carrier's axis.
        half_mm: half the distance between the screws.
        link_mm: length of each link.
    """

    carrier: str
    left: str
    right: str
    across: str
    up: str
    middle_mm: float
    half_mm: float
    link_mm: float


@dataclass(frozen=True, slots=True)
class DhTable:
    """A table's rows from the base to the tool, in one convention.

    Attributes:
        convention: the convention.
        rows: the rows.
        base: position of the base in the station.
        sliders: mechanism that moves variables that are no joints; None if all variables are joints.
    """

    convention: Convention
    rows: tuple[DhRow, ...]
    base: BaseFrame = STATION
    sliders: TwoSliders | None = None

    @property
    def variables(self) -> tuple[str, ...]:
        """The names of the variables, from the base to the tool."""
        parameters = (parameter for row in self.rows for parameter in (row.d_mm, row.theta_deg))
        return tuple(parameter.variable for parameter in parameters if parameter.variable)

    @property
    def link_names(self) -> tuple[str, ...]:
        """The names of the rows: link1 and so on."""
        return tuple(f"link{number}" for number in range(1, len(self.rows) + 1))

    def transforms(self, variables: Variables) -> FloatArray:
        """Return the tool's homogeneous transforms in the station's frame, of shape (n, 4, 4), lengths in mm."""
        tool: FloatArray = self.frames(variables)[-1]
        return tool

    def frames(self, variables: Variables) -> FloatArray:
        """Return the frames of the base and after each row, in the station's frame, shape (rows + 1, n, 4, 4)."""
        count = max((len(values) for values in variables.values()), default=1)
        frames = np.empty((len(self.rows) + 1, count, 4, 4))
        frames[0] = self.base.matrix
        for i, row in enumerate(self.rows):
            np.matmul(frames[i], self._link(row, variables, count), out=frames[i + 1])
        return frames

    def with_errors(self, errors: FloatArray) -> Self:
        """Return the table with errors, of shape (rows, 4), added to each row's a_mm, alpha_deg, d_mm and theta_deg."""
        rows = (row.with_errors(*each) for row, each in zip(self.rows, errors.tolist(), strict=True))
        return replace(self, rows=tuple(rows))

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
