"""An orientation as people write it: a key that carries the convention, and its numbers; nothing is guessed.

rpy_deg           roll, pitch, yaw about the fixed x, y, z: R = Rz Ry Rx    URDF, ROS, FANUC W P R, Yaskawa Rx Ry Rz
abc_deg           the same matrix in the order yaw, pitch, roll             KUKA A B C
rotvec_deg        the axis, as long as the angle                            UR's rotation vector, there in rad
quaternion_xyzw   a unit quaternion, its scalar last                        ROS
direction         where the tool's z axis points, for arms of five axes
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.robots.poses.rotations import of_rotation_vector, of_rpy_deg, turned

DIRECTION: Final = "direction"

_READ: Final[dict[str, tuple[int, Callable[[FloatArray], FloatArray]]]] = {
    "rpy_deg": (3, of_rpy_deg),
    "quaternion_xyzw": (4, lambda values: values / np.linalg.norm(values)),
    "rotvec_deg": (3, of_rotation_vector),
    "abc_deg": (3, lambda values: of_rpy_deg(values[::-1])),
}
"""How many numbers each key has, and the rotation that they are."""

ORIENTATIONS: Final = (*_READ, DIRECTION)
"""The keys of an orientation; a pose has at most one of them."""

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
        length = float(np.linalg.norm(self.values))
        if self.key == "quaternion_xyzw" and not abs(length - 1.0) <= NORM_OFF_MAX:
            raise InputError(f"{self.key}: has the length {length:g}, a rotation has 1, x y z and then the scalar w")
        if self.key == DIRECTION and not length > 0.0:
            raise InputError(f"{self.key}: 0 0 0 points nowhere; 0 0 -1 is straight down")

    def __str__(self) -> str:
        return f"{self.key} {' '.join(f'{value:g}' for value in self.values)}"

    @property
    def rotation(self) -> FloatArray:
        """The unit quaternion, of shape (4,); only for a key that says the whole rotation."""
        return _READ[self.key][1](np.array(self.values))

    @property
    def direction(self) -> FloatArray:
        """The unit vector of the tool's z axis, of shape (3,)."""
        if self.key == DIRECTION:
            return np.asarray(np.array(self.values) / np.linalg.norm(self.values))
        return turned(np.array([0.0, 0.0, 1.0]), self.rotation)
