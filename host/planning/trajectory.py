"""The interface of a trajectory: joint positions and velocities as functions of time."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Protocol, runtime_checkable

from steptwin.host.common.arrays import FloatArray

REST_TOLERANCE: Final = 1e-9
"""Rounding error of a velocity of zero, in mm/s or deg/s, with which a motion may start and end."""


@dataclass(frozen=True, slots=True)
class OutputChange:
    """A change of a digital output during a motion: as planned, and in a report as made.

    Attributes:
        output: name of the output in the robot file.
        on: its new level.
        from_s: time of the motion from which the output may change.
        until_s: time by which it must have changed.
        on_the_way: True if the machine moves during the change, at a place; unknown in a stored report.
        changed_s: time of the change on the board; None if the board did not make it.
        already: True if the output had this level already, so no change was expected.
    """

    output: str
    on: bool
    from_s: float
    until_s: float
    on_the_way: bool = False
    changed_s: float | None = None
    already: bool = False

    @property
    def in_time(self) -> bool:
        """True if the output changed between `from_s` and `until_s`, or needed no change."""
        return self.already or (self.changed_s is not None and self.from_s <= self.changed_s <= self.until_s)

    def to_dict(self) -> dict[str, Any]:
        """Return the change under the keys of report.json."""
        window = {"name": self.output, "on": self.on, "from_s": self.from_s, "until_s": self.until_s}
        return window | {"changed_s": self.changed_s, "already": self.already}


@dataclass(frozen=True, slots=True)
class Wait:
    """A standstill in a motion until a digital input has a level.

    In a plan it has no duration. In an executed motion, `at_s` is that motion's own time.

    Attributes:
        input: name of the input in the robot file.
        on: the level that it waits for.
        at_s: time of the motion when the wait begins, a whole number of milliseconds.
        timeout_s: time after which a wait without the level ends the motion.
        place: position of the wait in its file, such as `step 3`; may be empty.
        stood_s: duration of the standstill, until the motion continued or the time-out; 0 in a plan.
        timed_out: True if the time-out ended the motion.
    """

    input: str
    on: bool
    at_s: float
    timeout_s: float
    place: str = ""
    stood_s: float = 0.0
    timed_out: bool = False

    def __str__(self) -> str:
        return f"{self.input} {'on' if self.on else 'off'}"

    @property
    def title(self) -> str:
        """The condition of the wait as text."""
        return self.input if self.on else f"{self.input} to go off"

    @property
    def timeout_message(self) -> str:
        """Message after the time-out."""
        return f"{self.where}the input {self.input} was not {'on' if self.on else 'off'} within {self.timeout_s:g} s"

    @property
    def where(self) -> str:
        """Start of messages about it: its place, if known."""
        return f"{self.place}: " if self.place else ""

    def to_dict(self) -> dict[str, Any]:
        """Return a completed wait under the keys of report.json; only one that has timed out has `timed_out`."""
        made = {"input": self.input, "on": self.on, "at_s": self.at_s, "stood_s": self.stood_s}
        return made | {"timed_out": True} if self.timed_out else made


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
    def output_changes(self) -> tuple[OutputChange, ...]:
        """Changes of outputs during the motion, in order of time."""
        ...

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions in mm and degrees, shape (n, joints), at times of shape (n,) in [0, duration_s]."""
        ...

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities in mm/s and deg/s, shape (n, joints), at times of shape (n,) in [0, duration_s]."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class DerivedTrajectory:
    """A trajectory derived from another one, which it follows unless a subclass changes it; implements Trajectory.

    It has no waits.
    """

    trajectory: Trajectory

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self.trajectory.joint_names

    @property
    def duration_s(self) -> float:
        """Duration, a whole number of milliseconds."""
        return self.trajectory.duration_s

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """Times when the acceleration jumps."""
        return self.trajectory.breakpoints_s

    @property
    def output_changes(self) -> tuple[OutputChange, ...]:
        """Changes of outputs, in order of time."""
        return self.trajectory.output_changes

    @property
    def expects(self) -> Mapping[str, Any]:
        """What features expect at the end, by key."""
        return expected_of(self.trajectory)

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions, of shape (n, joints)."""
        return self.trajectory.positions(t_s)

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities, of shape (n, joints)."""
        return self.trajectory.velocities(t_s)


DEFAULT_POINT_MS: Final = 10
"""Usual time between PVT points."""


def smooth_breakpoints_ms(trajectory: Trajectory) -> frozenset[int]:
    """Return the breakpoints with an almost continuous acceleration; other trajectories need not have the attribute."""
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
    """A trajectory that waits for inputs; others need not have the attribute."""

    @property
    def waits(self) -> tuple[Wait, ...]:
        """The waits, in order of time."""
        ...


def expected_of(trajectory: Trajectory) -> Mapping[str, Any]:
    """Return what features expect at the end of a trajectory, by key; others need not have the attribute."""
    found: Mapping[str, Any] = getattr(trajectory, "expects", {})
    return found


def waits_of(trajectory: Trajectory) -> tuple[Wait, ...]:
    """Return a trajectory's waits for inputs, in order of time."""
    return trajectory.waits if isinstance(trajectory, Waiting) else ()
