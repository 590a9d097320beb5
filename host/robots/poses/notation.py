"""An orientation as people write it: a key that carries the convention, and its numbers; nothing is guessed.

rpy_deg           roll, pitch, yaw about the fixed x, y, z: R = Rz Ry Rx    URDF, ROS, FANUC W P R, Yaskawa Rx Ry Rz
abc_deg           the same matrix in the order yaw, pitch, roll             KUKA A B C
rotvec_deg        the axis, as long as the angle                            UR's rotation vector, there in rad
quaternion_xyzw   a unit quaternion, its scalar last                        ROS
direction         where the tool's z axis points, for arms of five axes

In the columns of a table each number has a name of its own, which says its part: COLUMNS.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.robots.poses.rotations import (
    of_rotation_vector,
    of_rpy_deg,
    rotation_vector_deg,
    rpy_deg,
    turned,
)

DIRECTION: Final = "direction"


def _unit(values: FloatArray) -> FloatArray:
    return np.asarray(values / np.linalg.norm(values, axis=-1, keepdims=True))


_Convert = Callable[[FloatArray], FloatArray]
_READ: Final[dict[str, tuple[int, _Convert, _Convert]]] = {
    "rpy_deg": (3, of_rpy_deg, rpy_deg),
    "quaternion_xyzw": (4, _unit, _unit),
    "rotvec_deg": (3, of_rotation_vector, rotation_vector_deg),
    "abc_deg": (3, lambda values: of_rpy_deg(values[..., ::-1]), lambda rotation: rpy_deg(rotation)[..., ::-1]),
}
"""How many numbers each key has, the rotation that they are, and the numbers that are a rotation."""

ORIENTATIONS: Final = (*_READ, DIRECTION)
"""The keys of an orientation; a pose has at most one of them."""

COLUMNS: Final[dict[str, dict[str, str]]] = {
    "rpy_deg": {"roll": "deg", "pitch": "deg", "yaw": "deg"},
    "quaternion_xyzw": {"qx": "", "qy": "", "qz": "", "qw": ""},
    "rotvec_deg": {"rotvec_x": "deg", "rotvec_y": "deg", "rotvec_z": "deg"},
    "abc_deg": {"abc_a": "deg", "abc_b": "deg", "abc_c": "deg"},
    DIRECTION: {"dx": "", "dy": "", "dz": ""},
}
"""The names of an orientation's columns and their units, by its key."""

NORM_OFF_MAX: Final = 1e-3
"""Distance from 1 by which the length of a quaternion may be rounded; it is made 1."""


@dataclass(frozen=True, slots=True)
class Orientation:
    """An orientation by its key and numbers.

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
        """Return a rotation, a unit quaternion of shape (4,), under a key that says the whole rotation."""
        return cls(key, tuple((_READ[key][2](rotation) + 0.0).tolist()))

    def __str__(self) -> str:
        return f"{self.key} {' '.join(f'{value:g}' for value in self.values)}"

    @property
    def rotation(self) -> FloatArray:
        """The unit quaternion, of shape (4,); only for a key that says the whole rotation."""
        return orientations_of(self.key, np.array(self.values))

    @property
    def direction(self) -> FloatArray:
        """The unit vector of the tool's z axis, of shape (3,)."""
        if self.key == DIRECTION:
            return orientations_of(self.key, np.array(self.values))
        return turned(np.array([0.0, 0.0, 1.0]), self.rotation)


def have_right_length(key: str, values: FloatArray) -> BoolArray:
    """Return, of shape (...), whether a key's numbers, of shape (..., count), are as long as they must be."""
    length = np.linalg.norm(values, axis=-1)
    if key == "quaternion_xyzw":
        return np.asarray(np.abs(length - 1.0) <= NORM_OFF_MAX)
    return np.asarray(length > 0.0 if key == DIRECTION else np.isfinite(length))


def orientations_of(key: str, values: FloatArray) -> FloatArray:
    """Return unit quaternions (..., 4), or unit vectors (..., 3) of directions, of a key's numbers (..., count)."""
    return _unit(values) if key == DIRECTION else _READ[key][1](values)
