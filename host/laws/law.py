"""What a time law is: how a distance is covered from rest to rest."""

from math import ceil
from typing import Protocol

from host.errors import InputError
from host.inputs import whole_ms
from host.trajectory import FloatArray

_TOLERANCE_MS = 1e-6
"""What rounding may add to a duration that is a whole number of milliseconds."""
_LONGEST_S = 1e6


class Law(Protocol):
    """Distance, speed and acceleration as functions of time, which begins at 0 and lasts whole milliseconds."""

    @property
    def distance(self) -> float:
        """What is covered, in any unit; velocities are then in that unit per second. It may be negative."""
        ...

    @property
    def duration_s(self) -> float:
        """When it has been covered."""
        ...

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """Where acceleration or jerk jumps between start and end, in whole milliseconds."""
        ...

    def position(self, t_s: FloatArray) -> FloatArray:
        """Distance covered at times of shape (n,) in [0, duration_s]."""
        ...

    def velocity(self, t_s: FloatArray) -> FloatArray:
        """Its first derivative, exactly 0 at both ends."""
        ...

    def acceleration(self, t_s: FloatArray) -> FloatArray:
        """Its second derivative; where that jumps, the value after the jump, and at the end the one before it."""
        ...


def require_duration(duration_s: float) -> None:
    """InputError unless a duration is a whole number of milliseconds above 0."""
    if whole_ms("duration_s", duration_s) < 1:
        raise InputError(f"duration_s: {duration_s:g} s is not at least 0.001 s")


def rounded_up_s(least_s: float) -> float:
    """The shortest time of whole milliseconds, at least one, that is not less.

    Raises:
        InputError: the time is not finite, as from a limit of 0.
    """
    if not least_s < _LONGEST_S:
        raise InputError(f"a motion would last {least_s:g} s: a limit of speed, acceleration or jerk is too low")
    return max(1, ceil(1000.0 * least_s - _TOLERANCE_MS)) / 1000
