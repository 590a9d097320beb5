"""All joints from one position to another along one time law: they start and end together, straight in joint space."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.laws import Law
from steptwin.host.planning.trajectory import Switching
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class JointMove:
    """q(t) = start + (goal - start) s(t); fulfils Trajectory.

    Attributes:
        joint_names: the robot's joints.
        start: joint positions at t = 0, mm and degrees.
        goal: those at the end.
        law: s(t), with a distance of 1.

    Raises:
        InputError: a law of another distance.
    """

    joint_names: tuple[str, ...]
    start: tuple[float, ...]
    goal: tuple[float, ...]
    law: Law

    switchings: ClassVar[tuple[Switching, ...]] = ()

    def __post_init__(self) -> None:
        if self.law.distance != 1.0:
            raise InputError(f"the law of a joint move covers {self.law.distance:g} instead of 1")

    @property
    def duration_s(self) -> float:
        """The law's duration."""
        return self.law.duration_s

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """The law's breakpoints."""
        return self.law.breakpoints_s

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Joint positions, shape (n, joints)."""
        part = self.law.position(t_s)[:, np.newaxis]
        return np.asarray(np.array(self.start) + part * self._way)

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Joint velocities, shape (n, joints)."""
        return np.asarray(self.law.velocity(t_s)[:, np.newaxis] * self._way)

    def accelerations(self, t_s: FloatArray) -> FloatArray:
        """Joint accelerations, shape (n, joints)."""
        return np.asarray(self.law.acceleration(t_s)[:, np.newaxis] * self._way)

    @property
    def _way(self) -> FloatArray:
        return np.subtract(self.goal, self.start)


def limits_along(robot: Robot, way: FloatArray) -> tuple[float, float]:
    """The highest speed and acceleration of s(t), per second, at which no joint going this way exceeds its own.

    A way of shape (joints,) that is 0 throughout allows any: both are then infinite.
    """
    sizes = np.abs(way)
    with np.errstate(divide="ignore", over="ignore"):
        speeds = np.array([joint.speed_max for joint in robot.joints]) / sizes
        accelerations = np.array([joint.acceleration_max for joint in robot.joints]) / sizes
    return float(speeds.min()), float(accelerations.min())
