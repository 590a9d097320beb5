"""A motion: joint positions and velocities as functions of time, with the outputs and waits on its way."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray

DEFAULT_POINT_MS: Final = 10
"""Usual time between PVT points."""
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


class JointLaw(ABC):
    """Joint positions and velocities as functions of time.

    Times have the shape (n,) and are within the motion. Results have the shape (n, joints), in mm and degrees, and in
    mm/s and deg/s.
    """

    __slots__ = ()

    @abstractmethod
    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions."""

    @abstractmethod
    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities, the derivatives of the positions."""

    def states(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities; a law overrides it if both together take less time."""
        return self.positions(t_s), self.velocities(t_s)


@dataclass(frozen=True, slots=True)
class JointFunctions(JointLaw):
    """A law made of two functions of time.

    Attributes:
        position: function that returns joint positions.
        velocity: function that returns joint velocities.
    """

    position: Callable[[FloatArray], FloatArray]
    velocity: Callable[[FloatArray], FloatArray]

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions."""
        return self.position(t_s)

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities."""
        return self.velocity(t_s)


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A motion of all joints, defined at every instant of [0, duration_s]; `plan` takes those from rest to rest.

    A run is planned from it and verified against it: the planner samples it at PVT points, the verifier's oracle
    inverts it at the step thresholds.

    Attributes:
        joint_names: names of the joints, in the robot's order.
        duration_s: duration in seconds, a whole number of milliseconds.
        law: positions and velocities of the joints.
        breakpoints_s: times in between when the acceleration jumps, whole milliseconds: each needs a PVT point.
        smooth_ms: breakpoints, in milliseconds, where the acceleration hardly jumps.
        output_changes: changes of outputs during the motion, in order of time.
        waits: waits for inputs, in order of time.
        expects: what features expect at the end, by key.
    """

    joint_names: tuple[str, ...]
    duration_s: float
    law: JointLaw
    breakpoints_s: tuple[float, ...] = ()
    smooth_ms: frozenset[int] = frozenset()
    output_changes: tuple[OutputChange, ...] = ()
    waits: tuple[Wait, ...] = ()
    expects: Mapping[str, Any] = field(default_factory=dict)

    @property
    def knots_s(self) -> FloatArray:
        """Start, breakpoints and end."""
        return np.array([0.0, *self.breakpoints_s, self.duration_s])

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions in mm and degrees, shape (n, joints), at times of shape (n,) in [0, duration_s]."""
        return self.law.positions(t_s)

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities in mm/s and deg/s, shape (n, joints), at times of shape (n,) in [0, duration_s]."""
        return self.law.velocities(t_s)

    def states(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities, both of shape (n, joints), at times of shape (n,)."""
        return self.law.states(t_s)
