"""The interface of a trajectory: joint positions and velocities as functions of time."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Protocol, runtime_checkable

from steptwin.host.common.arrays import FloatArray

REST_TOLERANCE: Final = 1e-9
"""Rounding error of a velocity of zero, in mm/s or deg/s, with which a motion may start and end."""


@dataclass(frozen=True, slots=True)
class Switching:
    """A change of a digital output during a motion.

    Attributes:
        output: name of the output in the robot file.
        on: its new level.
        from_s: time of the motion from which the output may change.
        until_s: time by which it must have changed.
        on_the_way: True if the machine moves meanwhile, so that a place is meant.
    """

    output: str
    on: bool
    from_s: float
    until_s: float
    on_the_way: bool = False


@dataclass(frozen=True, slots=True)
class PlannedWait:
    """A standstill amid a motion that lasts until a digital input has a level; the plan counts it as no time.

    Attributes:
        input: name of the input in the robot file.
        on: the level that it waits for.
        at_s: time of the motion when the machine stands and begins to wait, a whole number of milliseconds.
        timeout_s: time after which a wait without the level ends the motion.
        place: where the wait is written, such as `step 3`; may be empty.
    """

    input: str
    on: bool
    at_s: float
    timeout_s: float
    place: str = ""

    def __str__(self) -> str:
        return f"{self.input} {'on' if self.on else 'off'}"


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
        """Times in between when the acceleration jumps, whole milliseconds: each needs a PVT point."""
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


DEFAULT_POINT_MS: Final = 10
"""Usual time between PVT points."""


def smooth_breakpoints_ms(trajectory: Trajectory) -> frozenset[int]:
    """Return the breakpoints at which the acceleration hardly jumps; others need not have the attribute."""
    found: frozenset[int] = getattr(trajectory, "smooth_ms", frozenset())
    return found


def states(trajectory: Trajectory, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a trajectory's positions and velocities, both of shape (n, joints), at times of shape (n,).

    A trajectory that computes both together in less time has a method of this name; others need not have it.
    """
    together: Callable[[FloatArray], tuple[FloatArray, FloatArray]] | None = getattr(trajectory, "states", None)
    return together(t_s) if together else (trajectory.positions(t_s), trajectory.velocities(t_s))


@runtime_checkable
class Waiting(Protocol):
    """A trajectory that waits for inputs on its way; others need not have the attribute."""

    @property
    def waits(self) -> tuple[PlannedWait, ...]:
        """The waits, in order of time."""
        ...


def expected_of(trajectory: Trajectory) -> Mapping[str, Any]:
    """Return what features are to find at the end of a trajectory, by key; others need not have the attribute."""
    found: Mapping[str, Any] = getattr(trajectory, "expects", {})
    return found


def waits_of(trajectory: Trajectory) -> tuple[PlannedWait, ...]:
    """Return a trajectory's waits for inputs, in order of time."""
    return trajectory.waits if isinstance(trajectory, Waiting) else ()
