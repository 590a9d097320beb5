"""Frame of a robot's base in its station, whose frame is that of all poses for users."""

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.file_models import FileTable
from steptwin.host.common.file_values import Within

PLACE_MAX_MM: Final = 100_000.0
"""Farthest place of a base along each axis: 100 m."""

TURN_MAX_DEG: Final = 360.0
"""Largest turn of a base, to either side."""

_Place = Annotated[float, Within(-PLACE_MAX_MM, PLACE_MAX_MM, "mm")]


@dataclass(frozen=True, slots=True)
class BaseFrame(FileTable):
    """Position x, y, z of the base in the station's frame, and its rotation phi about the vertical; by default all 0.

    Source: the transform S_0T of H. Wang, B. Yin, R. Luo, X. Wang, "Mechanism design and kinematics analysis of 4-dof
    SCARA robot system", J. Mechanical & Electrical Engineering 36(12), 2019, equation 6.

    Raises:
        InputError: the place is beyond PLACE_MAX_MM, the turn beyond TURN_MAX_DEG, or either is not a number.
    """

    x_mm: _Place = 0.0
    y_mm: _Place = 0.0
    z_mm: _Place = 0.0
    phi_deg: Annotated[float, Within(-TURN_MAX_DEG, TURN_MAX_DEG, "deg")] = 0.0

    @property
    def matrix(self) -> FloatArray:
        """Shape (4, 4): the homogeneous transform S_0T from the base's frame to the station's, lengths in mm."""
        c, s = np.cos(np.deg2rad(self.phi_deg)), np.sin(np.deg2rad(self.phi_deg))
        return np.array(
            [[c, 0.0 - s, 0.0, self.x_mm], [s, c, 0.0, self.y_mm], [0.0, 0.0, 1.0, self.z_mm], [0.0, 0.0, 0.0, 1.0]]
        )

    def in_station(self, points_mm: FloatArray) -> FloatArray:
        """Convert points of shape (..., 3) from the base's frame to the station's."""
        if self == STATION:
            return points_mm
        return np.asarray(points_mm @ self.matrix[:3, :3].T + self.matrix[:3, 3])


STATION: Final = BaseFrame()
"""Base at the station's origin without rotation."""
