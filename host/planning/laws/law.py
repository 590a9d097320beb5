"""What a time law is: how a distance is covered from rest to rest."""

from typing import Protocol

from steptwin.host.common.arrays import FloatArray


class Law(Protocol):
    """Distance, velocity and acceleration as functions of time, which begins at 0 and lasts whole milliseconds.

    The laws' classmethods `fastest` choose the shortest law that keeps limits given in the distance's unit.
    """

    @property
    def distance(self) -> float:
        """What is covered, in any unit; velocities are then in that unit per second. It may be negative."""
        ...

    @property
    def duration_s(self) -> float:
        """When it has been covered, a whole number of milliseconds."""
        ...

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """Where acceleration or jerk jumps between start and end, in whole milliseconds: PVT points must fall there."""
        ...

    def position(self, t_s: FloatArray) -> FloatArray:
        """Distance covered at times of shape (n,) in [0, duration_s], exactly `distance` at the end."""
        ...

    def velocity(self, t_s: FloatArray) -> FloatArray:
        """Its first derivative, exactly 0 at both ends."""
        ...

    def acceleration(self, t_s: FloatArray) -> FloatArray:
        """Its second derivative; where that jumps, the value after the jump, and at the end the one before it."""
        ...
