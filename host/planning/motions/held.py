"""A part of a motion, and a motion with standstills put in: what a machine has done that waited for inputs."""

from bisect import bisect
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.trajectory import DerivedTrajectory, OutputChange


@dataclass(frozen=True, slots=True, eq=False)
class TimeSpan(DerivedTrajectory):
    """A part of a trajectory that need not begin or end at rest.

    Attributes:
        from_s: where the part begins, a whole number of milliseconds.
        until_s: where it ends, likewise.
    """

    from_s: float
    until_s: float

    @property
    def duration_s(self) -> float:
        """Duration of the part."""
        return (round(1000 * self.until_s) - round(1000 * self.from_s)) / 1000

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """The trajectory's breakpoints in the part."""
        from_ms, until_ms, all_s = round(1000 * self.from_s), round(1000 * self.until_s), self.trajectory.breakpoints_s
        own = slice(bisect(all_s, (from_ms + 0.5) / 1000), bisect(all_s, (until_ms - 0.5) / 1000))
        return tuple((round(1000 * t_s) - from_ms) / 1000 for t_s in all_s[own])

    @property
    def output_changes(self) -> tuple[OutputChange, ...]:
        """The trajectory's changes of outputs that are wholly in the part."""
        return tuple(
            replace(change, from_s=change.from_s - self.from_s, until_s=change.until_s - self.from_s)
            for change in self.trajectory.output_changes
            if self.from_s <= change.from_s and change.until_s <= self.until_s
        )

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions, of shape (n, joints)."""
        return self.trajectory.positions(self.from_s + t_s)

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities, of shape (n, joints)."""
        return self.trajectory.velocities(self.from_s + t_s)


class Hold(NamedTuple):
    """An inserted standstill: time in the original motion, and duration, in milliseconds."""

    at_ms: int
    duration_ms: int


@dataclass(frozen=True, slots=True, eq=False)
class Held(DerivedTrajectory):
    """A trajectory that stands still at some instants, where it rests anyway.

    Attributes:
        holds: the standstills, in order of time.
    """

    holds: tuple[Hold, ...]

    @property
    def duration_s(self) -> float:
        """Duration of the trajectory and of all standstills."""
        return (round(1000 * self.trajectory.duration_s) + sum(hold.duration_ms for hold in self.holds)) / 1000

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """The trajectory's breakpoints at their new times, and the ends of the standstills."""
        own = {self._later_s(t_s) for t_s in self.trajectory.breakpoints_s}
        ends = {t_s for pair in self._spans_s() for t_s in pair if 0 < t_s < self.duration_s}
        return tuple(sorted(own | ends))

    @property
    def output_changes(self) -> tuple[OutputChange, ...]:
        """The trajectory's changes of outputs, at their new times."""
        return tuple(
            replace(change, from_s=self._later_s(change.from_s), until_s=self._later_s(change.until_s))
            for change in self.trajectory.output_changes
        )

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions, of shape (n, joints)."""
        return self.trajectory.positions(self._own_s(t_s))

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities, of shape (n, joints)."""
        return self.trajectory.velocities(self._own_s(t_s))

    def _later_s(self, t_s: float) -> float:
        """Convert a time of the original motion; at a standstill, to its end."""
        ms = 1000 * t_s
        return (ms + sum(hold.duration_ms for hold in self.holds if hold.at_ms <= ms)) / 1000

    def _spans_s(self) -> list[tuple[float, float]]:
        """Return the beginning and the end of each standstill."""
        ends_ms = accumulate(hold.duration_ms for hold in self.holds)
        return [
            ((hold.at_ms + end_ms - hold.duration_ms) / 1000, (hold.at_ms + end_ms) / 1000)
            for hold, end_ms in zip(self.holds, ends_ms, strict=True)
        ]

    def _own_s(self, t_s: FloatArray) -> FloatArray:
        """Convert times to the original motion, in which time does not advance during standstills."""
        stood_s = np.zeros_like(t_s)
        for begin_s, end_s in self._spans_s():
            stood_s += np.clip(t_s - begin_s, 0.0, end_s - begin_s)
        return np.asarray(np.clip(t_s - stood_s, 0.0, self.trajectory.duration_s))
