"""The interface of a time law: the distance covered from rest to rest, as a function of time."""

from typing import Protocol

from steptwin.host.common.arrays import FloatArray


class Law(Protocol):
    """Distance, velocity and acceleration as functions of time, from 0 to a whole number of milliseconds.

    The classmethod `fastest` of each law chooses the shortest one within limits in the distance's unit. It raises
    InputError for a limit that is not above 0, or so low that the motion would take days.
    """

    @property
    def distance(self) -> float:
        """Distance covered, in any unit, which may be negative; velocities are in that unit per second."""
        ...

    @property
    def duration_s(self) -> float:
        """Duration, a whole number of milliseconds."""
        ...

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """Times in between at which acceleration or jerk jumps, whole milliseconds: each needs a PVT point."""
        ...

    def position(self, t_s: FloatArray) -> FloatArray:
        """Return the distance covered at times of shape (n,) in [0, duration_s]; exactly `distance` at the end."""
        ...

    def velocity(self, t_s: FloatArray) -> FloatArray:
        """Return the first derivative, exactly 0 at both ends."""
        ...

    def acceleration(self, t_s: FloatArray) -> FloatArray:
        """Return the second derivative; at a jump the value after it, but at the end the value before."""
        ...
