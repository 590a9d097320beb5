"""What a trajectory is to the rest of the host: joint positions and velocities as functions of time."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class Trajectory(Protocol):
    """A motion of all joints from rest to rest, defined at every instant of [0, duration_s].

    It is the truth that a run is planned from and verified against: the planner samples it at PVT points, the
    oracle inverts it at the step thresholds.
    """

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints in the robot's order."""
        ...

    @property
    def duration_s(self) -> float:
        """When the motion ends, in seconds, a whole number of milliseconds."""
        ...

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """Where between 0 and duration_s the acceleration jumps, in whole milliseconds: PVT points must fall there."""
        ...

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Joint positions in mm and degrees, shape (n, joints), at times of shape (n,) inside [0, duration_s]."""
        ...

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Joint velocities in mm/s and deg/s, shape (n, joints), at times of shape (n,) inside [0, duration_s]."""
        ...
