"""A trajectory on the fine grid of time at which its limits are checked."""

from typing import Final, NamedTuple, Self

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.planning.trajectory import Trajectory

_CHECK_MS: Final = 1
"""Time between two instants at which limits are checked; every PVT point is checked as well."""


class Samples(NamedTuple):
    """A trajectory on a fine grid of time: times of shape (n,), the rest of shape (n, joints)."""

    t_s: FloatArray
    positions: FloatArray
    velocities: FloatArray

    @classmethod
    def of(cls, trajectory: Trajectory, times_ms: Int64Array) -> Self:
        """Sample a trajectory every millisecond and at its points' times."""
        t_s = np.union1d(np.arange(0, times_ms[-1], _CHECK_MS), times_ms) / 1000
        return cls(t_s, trajectory.positions(t_s), trajectory.velocities(t_s))
