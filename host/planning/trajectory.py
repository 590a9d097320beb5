"""The interface of a trajectory: joint positions and velocities as functions of time."""

from dataclasses import dataclass
from typing import Protocol

from steptwin.host.common.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class Switching:
    """A change of a digital output during a motion, while the machine stands still.

    Attributes:
        output: name of the output in the robot file.
        on: its new level.
        from_s: time of the motion from which the output may change.
        until_s: time by which it must have changed, since the machine moves on.
    """

    output: str
    on: bool
    from_s: float
    until_s: float


class Trajectory(Protocol):
    """A motion of all joints from rest to rest, defined at every instant of [0, duration_s].

    A run is planned from it and verified against it: the planner samples it at PVT points, the verifier's oracle
    inverts it at the step thresholds.
    """

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the robot's order."""
        ...

    @property
    def duration_s(self) -> float:
        """Duration in seconds, a whole number of milliseconds."""
        ...

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """Times in between at which the acceleration jumps, whole milliseconds: each needs a PVT point."""
        ...

    @property
    def switchings(self) -> tuple[Switching, ...]:
        """Changes of outputs during the motion, in order of time."""
        ...

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions in mm and degrees, shape (n, joints), at times of shape (n,) in [0, duration_s]."""
        ...

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities in mm/s and deg/s, shape (n, joints), at times of shape (n,) in [0, duration_s]."""
        ...
