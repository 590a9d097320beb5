"""What a trajectory is to the rest of the host: joint positions and velocities as functions of time."""

from dataclasses import dataclass
from typing import Protocol

from steptwin.host.common.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class Switching:
    """A digital output that changes during a motion, while the machine stands still.

    Attributes:
        output: its name in the robot's file.
        on: the level that it takes.
        from_s: when it may change, as time of the motion.
        until_s: when it must have changed, because the machine moves on.
    """

    output: str
    on: bool
    from_s: float
    until_s: float


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

    @property
    def switchings(self) -> tuple[Switching, ...]:
        """The outputs that change on the way, in order of time."""
        ...

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Joint positions in mm and degrees, shape (n, joints), at times of shape (n,) inside [0, duration_s]."""
        ...

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Joint velocities in mm/s and deg/s, shape (n, joints), at times of shape (n,) inside [0, duration_s]."""
        ...
