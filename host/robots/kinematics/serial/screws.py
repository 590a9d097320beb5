"""Forward kinematics and body Jacobian of any chain of joints, from the rows of a DH table.

The rows are multiplied out from the tool to the base, with columns of numbers instead of matrices. Each row is a screw
about z and one about x; a screw needs six products for a position and eight for a quaternion. In the frame of a joint
the tool is at p with the orientation q: the joint moves it by z x p and turns it about z. Rotated into the tool's frame
these are the columns of the body Jacobian (K. M. Lynch, F. C. Park, "Modern Robotics", section 5.1.3), in mm and rad
per rad, or in mm per mm.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import cos, radians, sin
from typing import Final, NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.dh import Convention, DhParameter, DhTable

CHUNK: Final = 2048
"""Number of poses computed at once: their columns fit in the processor's cache."""

Columns = tuple[FloatArray | float, ...]
"""Components of vectors or quaternions, each of shape (n,), or a number if all are equal."""


class _Turn(NamedTuple):
    """A screw about z, or about x if `along_x`; `joint` is the column of its joint, `sign` the joint's direction."""

    along_x: bool
    angle_rad: float
    shift_mm: float
    joint: int | None = None
    sign: int = 1
    slides: bool = False


@dataclass(frozen=True, slots=True)
class Screws:
    """The screws of a DH table from the base to the tool; made by `screws_of`."""

    turns: tuple[_Turn, ...]
    joints: int
    base_mm: tuple[float, float]

    def forward(self, joints: FloatArray) -> FloatArray:
        """Return poses of shape (n, 7), x y z and the quaternion x y z w, for joints (n, joints) in mm and degrees."""
        poses = np.empty((len(joints), 7))
        for first in range(0, len(joints), CHUNK):
            part = slice(first, first + CHUNK)
            place, rotation = self._product(np.ascontiguousarray(joints[part].T), None)
            for column, values in enumerate((*place, *rotation)):
                poses[part, column] = values
        return poses

    def with_jacobian(self, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the poses, as `forward`, and the body Jacobians of shape (n, 6, joints)."""
        jacobians = np.zeros((self.joints, 6, len(joints)))
        place, rotation = self._product(np.ascontiguousarray(joints.T), jacobians)
        poses = np.stack(np.broadcast_arrays(*place, *rotation), axis=-1)
        return np.broadcast_to(poses, (len(joints), 7)), np.moveaxis(jacobians, -1, 0).swapaxes(1, 2)

    def _product(self, joints: FloatArray, jacobians: FloatArray | None) -> tuple[Columns, Columns]:
        place: Columns = (0.0, 0.0, 0.0)
        rotation: Columns = (0.0, 0.0, 0.0, 1.0)
        for turn in reversed(self.turns):
            angle: FloatArray | float = turn.angle_rad
            shift: FloatArray | float = turn.shift_mm
            if turn.joint is not None:
                moved = turn.sign * joints[turn.joint]
                if turn.slides:
                    shift = shift + moved
                else:
                    angle = angle + np.deg2rad(moved)
            if jacobians is not None and turn.joint is not None:
                _write_column(jacobians[turn.joint], turn, place, rotation)
            if turn.along_x:
                place, rotation = _about_x(place, rotation, angle, shift)
            else:
                place, rotation = _about_z(place, rotation, angle, shift)
        (px, py, pz), (x_mm, y_mm) = place, self.base_mm
        return (px + x_mm, py + y_mm, pz), rotation


def _half(angle: FloatArray | float) -> tuple[FloatArray | float, FloatArray | float]:
    """Return cosine and sine of half an angle."""
    if isinstance(angle, float):
        return cos(angle / 2.0), sin(angle / 2.0)
    return np.cos(angle / 2.0), np.sin(angle / 2.0)


def _about_z(
    place: Columns, rotation: Columns, angle: FloatArray | float, shift: FloatArray | float
) -> tuple[Columns, Columns]:
    px, py, pz = place
    if isinstance(angle, float) and angle == 0.0:
        return (px, py, pz + shift), rotation
    ch, sh = _half(angle)
    c, s = ch * ch - sh * sh, 2.0 * sh * ch
    x, y, z, w = rotation
    return (
        (c * px - s * py, s * px + c * py, pz + shift),
        (ch * x - sh * y, ch * y + sh * x, ch * z + sh * w, ch * w - sh * z),
    )


def _about_x(
    place: Columns, rotation: Columns, angle: FloatArray | float, shift: FloatArray | float
) -> tuple[Columns, Columns]:
    px, py, pz = place
    if isinstance(angle, float) and angle == 0.0:
        return (px + shift, py, pz), rotation
    ch, sh = _half(angle)
    c, s = ch * ch - sh * sh, 2.0 * sh * ch
    x, y, z, w = rotation
    return (
        (px + shift, c * py - s * pz, s * py + c * pz),
        (ch * x + sh * w, ch * y - sh * z, ch * z + sh * y, ch * w - sh * x),
    )


def _write_column(jacobian: FloatArray, turn: _Turn, place: Columns, rotation: Columns) -> None:
    """Write a joint's Jacobian column, shape (6, n), in the tool's frame; `rotation` is relative to the joint."""
    x, y, z, w = rotation
    towards_z = (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y))
    if turn.slides:
        for row, value in enumerate(towards_z):
            jacobian[row] = turn.sign * value
        return
    towards_x = (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w))
    towards_y = (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w))
    px, py, _ = place
    for row in range(3):
        jacobian[row] = turn.sign * (px * towards_y[row] - py * towards_x[row])
        jacobian[3 + row] = turn.sign * towards_z[row]


@lru_cache(maxsize=16)
def screws_of(table: DhTable, joints: tuple[str, ...]) -> Screws:
    """Return the screws of a DH table whose variables are among the joints, with the base's position."""
    base = table.base
    turns = [_Turn(False, radians(base.phi_deg), base.z_mm)]
    for row in table.rows:
        fixed = _Turn(True, radians(row.alpha_deg), row.a_mm)
        moving = _moving(row.theta_deg, row.d_mm, {name: column for column, name in enumerate(joints)})
        turns += [fixed, *moving] if table.convention is Convention.MODIFIED else [*moving, fixed]
    return Screws(tuple(turns), len(joints), (base.x_mm, base.y_mm))


def _moving(theta_deg: DhParameter, d_mm: DhParameter, columns: Mapping[str, int]) -> list[_Turn]:
    """Return the screw about z of a row, as two if it both turns and slides."""
    angle_rad, shift_mm = radians(theta_deg.constant), d_mm.constant
    if theta_deg.variable and d_mm.variable:
        sliding = _Turn(False, 0.0, shift_mm, columns[d_mm.variable], d_mm.sign, slides=True)
        return [sliding, _Turn(False, angle_rad, 0.0, columns[theta_deg.variable], theta_deg.sign)]
    if d_mm.variable:
        return [_Turn(False, angle_rad, shift_mm, columns[d_mm.variable], d_mm.sign, slides=True)]
    if theta_deg.variable:
        return [_Turn(False, angle_rad, shift_mm, columns[theta_deg.variable], theta_deg.sign)]
    return [_Turn(False, angle_rad, shift_mm)]
