"""Move all joints straight in joint space by one time law; they start and end together."""

from dataclasses import dataclass

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.laws import Law, Trapezoid
from steptwin.host.planning.motion import JointLaw, Motion
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class JointMove(JointLaw):
    """The law q(t) = start + (goal - start) s(t).

    Attributes:
        start: joint positions at t = 0, in mm and degrees.
        goal: joint positions at the end.
        law: s(t), whose distance must be 1.
    """

    start: tuple[float, ...]
    goal: tuple[float, ...]
    law: Law

    def __post_init__(self) -> None:
        if self.law.distance != 1.0:
            raise InputError(f"the law of a joint move covers {self.law.distance:g} instead of 1")

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions, of shape (n, joints)."""
        part = self.law.position(t_s)[:, np.newaxis]
        return np.asarray(np.array(self.start) + part * self._travel)

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities, of shape (n, joints)."""
        return np.asarray(self.law.velocity(t_s)[:, np.newaxis] * self._travel)

    def accelerations(self, t_s: FloatArray) -> FloatArray:
        """Return joint accelerations, of shape (n, joints)."""
        return np.asarray(self.law.acceleration(t_s)[:, np.newaxis] * self._travel)

    @property
    def _travel(self) -> FloatArray:
        return np.subtract(self.goal, self.start)


def joint_move(joint_names: tuple[str, ...], start: tuple[float, ...], goal: tuple[float, ...], law: Law) -> Motion:
    """Return the motion from a joint position to another by a time law with a distance of 1."""
    return Motion(joint_names, law.duration_s, JointMove(start, goal, law), law.breakpoints_s)


def change_times_s(robot: Robot, changes: FloatArray) -> FloatArray:
    """Return the shortest times of velocity changes within the acceleration limits of joints and axes, shape (n,).

    The changes have the shape (n, joints), in mm/s and deg/s of the joints.
    """
    of_joints = np.abs(changes) / np.array([joint.acceleration_max for joint in robot.joints])
    of_axes = np.abs(robot.coupling.to_axes(changes)) / robot.axis_accelerations_max
    return np.asarray(np.maximum(of_joints, of_axes).max(axis=1))


def limits_along(robot: Robot, travel: FloatArray) -> tuple[float, float]:
    """Return the highest speed and acceleration of s(t), in 1/s and 1/s^2, within the limits of joints and axes.

    `travel` has the shape (joints,), in mm and degrees. Both results are infinite if it is 0 for all joints.
    """
    sizes, axis_sizes = np.abs(travel), np.abs(robot.coupling.to_axes(travel))
    with np.errstate(divide="ignore", over="ignore"):
        speeds = np.array([joint.speed_max for joint in robot.joints]) / sizes
        accelerations = np.array([joint.acceleration_max for joint in robot.joints]) / sizes
        axis_speeds, axis_accelerations = (
            limits / axis_sizes for limits in (robot.axis_speeds_max, robot.axis_accelerations_max)
        )
    return float(min(speeds.min(), axis_speeds.min())), float(min(accelerations.min(), axis_accelerations.min()))


def fastest_law(robot: Robot, travel: FloatArray, part: float = 1.0) -> Trapezoid:
    """Return the fastest law, with a distance of 1, of joints that make their travels together.

    `travel` is as for `limits_along`, and not 0 for all joints; `part` is the fraction of the speed and acceleration
    limits to use.
    """
    speed, acceleration = limits_along(robot, travel)
    return Trapezoid.fastest(1.0, speed * part, acceleration * part)
