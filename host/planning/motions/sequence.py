"""Sequences of motions and pauses."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.trajectory import PlannedWait, Switching, Trajectory


@dataclass(frozen=True, slots=True)
class Standstill:
    """A motion in which all joints stand still; implements Trajectory."""

    joint_names: tuple[str, ...]
    at: tuple[float, ...]
    duration_s: float

    breakpoints_s: ClassVar[tuple[float, ...]] = ()
    switchings: ClassVar[tuple[Switching, ...]] = ()

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions, of shape (n, joints), all equal."""
        return np.tile(np.array(self.at), (len(t_s), 1))

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities, of shape (n, joints), all 0."""
        return np.zeros((len(t_s), len(self.joint_names)))


@dataclass(frozen=True, slots=True)
class Sequence:
    """Motions in a row: each begins where the previous one ended; implements Trajectory.

    Attributes:
        joint_names: names of the robot's joints.
        parts: the motions, at least one.
        starts_ms: start of each part, and then the end of the last one.
        switchings: changes of outputs during the motion.
        waits: waits for inputs, each at the beginning of a pause.
    """

    joint_names: tuple[str, ...]
    parts: tuple[Trajectory, ...]
    starts_ms: tuple[int, ...]
    switchings: tuple[Switching, ...]
    waits: tuple[PlannedWait, ...] = ()

    @property
    def duration_s(self) -> float:
        """Duration of all parts together."""
        return self.starts_ms[-1] / 1000

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """The parts' breakpoints, and the times when one part follows another."""
        breakpoints_ms = set(self.starts_ms[1:-1])
        for start_ms, part in zip(self.starts_ms, self.parts, strict=False):
            breakpoints_ms |= {start_ms + round(1000 * t_s) for t_s in part.breakpoints_s}
        return tuple(ms / 1000 for ms in sorted(breakpoints_ms))

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions, of shape (n, joints)."""
        return self._pieced(t_s, lambda part, own_s: part.positions(own_s))

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities, of shape (n, joints)."""
        return self._pieced(t_s, lambda part, own_s: part.velocities(own_s))

    def _pieced(self, t_s: FloatArray, of: Callable[[Trajectory, FloatArray], FloatArray]) -> FloatArray:
        starts_s = np.array(self.starts_ms) / 1000
        which = np.clip(np.searchsorted(starts_s, t_s, side="right") - 1, 0, len(self.parts) - 1)
        values = np.empty((len(t_s), len(self.joint_names)))
        counts = np.bincount(which, minlength=len(self.parts))
        in_order = np.split(np.argsort(which, kind="stable"), np.cumsum(counts)[:-1])
        for i in np.flatnonzero(counts):
            part, own = self.parts[i], in_order[i]
            values[own] = of(part, np.clip(t_s[own] - starts_s[i], 0.0, part.duration_s))
        return values
