"""Rotations as unit quaternions, arrays of shape (..., 4) in the order x y z w, and their notations.

A quaternion and its negative are the same rotation. Angles of the notations are in degrees. Formulas: B. Siciliano et
al., "Robotics: Modelling, Planning and Control", sections 2.4 to 2.6. A notation is a key that carries the convention,
and its numbers; nothing is guessed.

rpy_deg           roll, pitch, yaw about the fixed x, y, z: R = Rz Ry Rx    URDF, ROS, FANUC W P R, Yaskawa Rx Ry Rz
abc_deg           the same matrix in the order yaw, pitch, roll             KUKA A B C
rotvec_deg        the axis, as long as the angle                            UR's rotation vector, there in rad
quaternion_xyzw   a unit quaternion, its scalar last                        ROS
direction         where the tool's z axis points, for arms of five axes

In the columns of a table each number has a name of its own: COLUMNS.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.common.errors import InputError

LEVEL_DEG: Final = 89.999
"""Pitch from which on roll and yaw are one turn, which is then all yaw."""
DIRECTION: Final = "direction"


def wrapped_deg(angle_deg: FloatArray) -> FloatArray:
    """Return the angles in (-180, 180]; an angle in that range is not changed at all, and NaN stays NaN.

    The others become 180 - (180 - angle) % 360. NaN, of poses out of reach, is left out: its remainder takes longest.
    """
    outside = (angle_deg <= -180.0) | (angle_deg > 180.0)
    wrapped = np.array(angle_deg)
    wrapped[outside] = 180.0 - (180.0 - wrapped[outside]) % 360.0
    return wrapped


def product(second: FloatArray, first: FloatArray) -> FloatArray:
    """Return the rotations by `first`, then by `second`, both about the axes of the fixed frame."""
    ax, ay, az, aw = np.moveaxis(second, -1, 0)
    bx, by, bz, bw = np.moveaxis(first, -1, 0)
    return np.stack(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ],
        axis=-1,
    )


def reversed_rotation(rotation: FloatArray) -> FloatArray:
    """Return the inverse rotations."""
    return np.asarray(rotation * np.array([-1.0, -1.0, -1.0, 1.0]))


def turned(vectors: FloatArray, rotation: FloatArray) -> FloatArray:
    """Return vectors of shape (..., 3) after the rotations."""
    axis = rotation[..., :3]
    across = 2.0 * np.cross(axis, vectors)
    return np.asarray(vectors + rotation[..., 3:] * across + np.cross(axis, across))


def of_rotation_vector(vector_deg: FloatArray) -> FloatArray:
    """Return the rotations about vectors of shape (..., 3), each by its length in degrees."""
    half_rad = np.deg2rad(np.linalg.norm(vector_deg, axis=-1, keepdims=True)) / 2.0
    part = np.deg2rad(vector_deg) / 2.0 * np.sinc(half_rad / np.pi)  # numpy's sinc is sin(pi x) / (pi x)
    return np.concatenate([part, np.cos(half_rad)], axis=-1)


def rotation_vector_deg(rotation: FloatArray) -> FloatArray:
    """Return the axes, of shape (..., 3), each as long as the angle, at most 180 degrees."""
    shortest = np.where(rotation[..., 3:] < 0.0, -rotation, rotation)
    sine = np.linalg.norm(shortest[..., :3], axis=-1, keepdims=True)
    half_rad = np.arctan2(sine, shortest[..., 3:])
    scale = np.divide(half_rad, sine, out=np.ones_like(sine), where=sine > 0.0)
    return np.asarray(np.rad2deg(2.0 * scale * shortest[..., :3]))


def angle_deg(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the angles, of shape (...), of the shortest rotations from the first to the second ones.

    From the vector part, since an arc cosine would lose angles below 1e-6 deg.
    """
    between = product(second, reversed_rotation(first))
    sine = np.linalg.norm(between[..., :3], axis=-1)
    return np.asarray(np.rad2deg(2.0 * np.arctan2(sine, np.abs(between[..., 3]))))


def of_rpy_deg(rpy_deg: FloatArray) -> FloatArray:
    """Return the rotations by roll, pitch and yaw, of shape (..., 3), about the fixed x, y, z: R = Rz Ry Rx."""
    half_rad = np.deg2rad(rpy_deg) / 2.0
    (cr, cp, cy), (sr, sp, sy) = np.moveaxis(np.cos(half_rad), -1, 0), np.moveaxis(np.sin(half_rad), -1, 0)
    return np.stack(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ],
        axis=-1,
    )


def rpy_deg(rotation: FloatArray) -> FloatArray:
    """Return roll, pitch within +-90 and yaw, of shape (..., 3); from LEVEL_DEG on the roll is 0."""
    elements = matrix(rotation)
    pitch_rad = np.arctan2(-elements[..., 2, 0], np.hypot(elements[..., 2, 1], elements[..., 2, 2]))
    level = np.abs(pitch_rad) >= np.deg2rad(LEVEL_DEG)
    roll_rad = np.where(level, 0.0, np.arctan2(elements[..., 2, 1], elements[..., 2, 2]))
    yaw_rad = np.where(
        level,
        np.arctan2(-elements[..., 0, 1], elements[..., 1, 1]),
        np.arctan2(elements[..., 1, 0], elements[..., 0, 0]),
    )
    return wrapped_deg(np.rad2deg(np.stack([roll_rad, pitch_rad, yaw_rad], axis=-1)))


def matrix(rotation: FloatArray) -> FloatArray:
    """Return the rotation matrices, of shape (..., 3, 3); their columns are the rotated axes."""
    x, y, z, w = np.moveaxis(rotation, -1, 0)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def of_matrix(elements: FloatArray) -> FloatArray:
    """Return the rotations of matrices of shape (..., 3, 3), each by its largest component, which is exact.

    Source: S. W. Shepperd, "Quaternion from rotation matrix", J. Guidance and Control 1(3), 1978.
    """
    trace = np.trace(elements, axis1=-2, axis2=-1)
    diagonal = np.diagonal(elements, axis1=-2, axis2=-1)
    squares = np.concatenate([1.0 + 2.0 * diagonal - trace[..., np.newaxis], 1.0 + trace[..., np.newaxis]], axis=-1)
    skew = elements - np.swapaxes(elements, -1, -2)
    both = elements + np.swapaxes(elements, -1, -2)
    xw, yw, zw = skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]
    xy, xz, yz = both[..., 0, 1], both[..., 0, 2], both[..., 1, 2]
    of_square = [
        [squares[..., 0], xy, xz, xw],
        [xy, squares[..., 1], yz, yw],
        [xz, yz, squares[..., 2], zw],
        [xw, yw, zw, squares[..., 3]],
    ]
    candidates = np.stack([np.stack(row, axis=-1) for row in of_square], axis=-2)
    largest = np.argmax(squares, axis=-1)[..., np.newaxis, np.newaxis]
    chosen = np.take_along_axis(candidates, largest, axis=-2)[..., 0, :]
    return np.asarray(chosen / np.linalg.norm(chosen, axis=-1, keepdims=True))


def _unit(values: FloatArray) -> FloatArray:
    return np.asarray(values / np.linalg.norm(values, axis=-1, keepdims=True))


_Convert = Callable[[FloatArray], FloatArray]
_READ: Final[dict[str, tuple[int, _Convert, _Convert]]] = {
    "rpy_deg": (3, of_rpy_deg, rpy_deg),
    "quaternion_xyzw": (4, _unit, _unit),
    "rotvec_deg": (3, of_rotation_vector, rotation_vector_deg),
    "abc_deg": (3, lambda values: of_rpy_deg(values[..., ::-1]), lambda rotation: rpy_deg(rotation)[..., ::-1]),
}
"""For each key: number of values, conversion to a rotation, and conversion back."""

ORIENTATIONS: Final = (*_READ, DIRECTION)
"""The keys of an orientation; a pose has at most one of them."""

COLUMNS: Final[dict[str, dict[str, str]]] = {
    "rpy_deg": {"roll": "deg", "pitch": "deg", "yaw": "deg"},
    "quaternion_xyzw": {"qx": "", "qy": "", "qz": "", "qw": ""},
    "rotvec_deg": {"rotvec_x": "deg", "rotvec_y": "deg", "rotvec_z": "deg"},
    "abc_deg": {"abc_a": "deg", "abc_b": "deg", "abc_c": "deg"},
    DIRECTION: {"dx": "", "dy": "", "dz": ""},
}
"""Names of an orientation's columns and their units, by its key."""

NORM_OFF_MAX: Final = 1e-3
"""Largest rounding error of a quaternion's length; it is normalised."""


@dataclass(frozen=True, slots=True)
class Orientation:
    """An orientation by its key and numbers.

    Attributes:
        key: how the numbers describe it, a key of robot files and programs such as `rotvec_deg`.
        values: the numbers of this key.

    Raises:
        InputError: there are too many or too few numbers, a quaternion's length is off 1 by more than NORM_OFF_MAX, or
            a direction has no length.
    """

    key: str
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        count = 3 if self.key == DIRECTION else _READ[self.key][0]
        if len(self.values) != count:
            raise InputError(f"{self.key}: has {len(self.values)} numbers, it takes {count}")
        if have_right_length(self.key, np.array(self.values)):
            return
        if self.key == DIRECTION:
            raise InputError(f"{self.key}: 0 0 0 points nowhere; 0 0 -1 is straight down")
        length = float(np.linalg.norm(self.values))
        raise InputError(f"{self.key}: has the length {length:g}, a rotation has 1, x y z and then the scalar w")

    @classmethod
    def of(cls, key: str, rotation: FloatArray) -> "Orientation":
        """Return a rotation, a unit quaternion of shape (4,), under a key for whole rotations."""
        return cls(key, tuple((_READ[key][2](rotation) + 0.0).tolist()))

    def __str__(self) -> str:
        return f"{self.key} {' '.join(f'{value:g}' for value in self.values)}"

    @property
    def rotation(self) -> FloatArray:
        """Unit quaternion of shape (4,); only for a key for whole rotations."""
        return orientations_of(self.key, np.array(self.values))

    @property
    def direction(self) -> FloatArray:
        """The unit vector of the tool's z axis, of shape (3,)."""
        if self.key == DIRECTION:
            return orientations_of(self.key, np.array(self.values))
        return turned(np.array([0.0, 0.0, 1.0]), self.rotation)


def have_right_length(key: str, values: FloatArray) -> BoolArray:
    """Return, of shape (...), whether values of a key, of shape (..., count), have the right length."""
    length = np.linalg.norm(values, axis=-1)
    if key == "quaternion_xyzw":
        return np.asarray(np.abs(length - 1.0) <= NORM_OFF_MAX)
    return np.asarray(length > 0.0 if key == DIRECTION else np.isfinite(length))


def orientations_of(key: str, values: FloatArray) -> FloatArray:
    """Return unit quaternions (..., 4), or unit vectors (..., 3) of directions, from a key's values (..., count)."""
    return _unit(values) if key == DIRECTION else _READ[key][1](values)
