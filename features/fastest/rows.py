"""PathLimits of a motion along a path, as rows in the path's acceleration and the square of its speed.

With the parameter s of the path, u its second derivative by time and x the square of its first one, joints that follow
q(s) have the velocity q' sqrt(x) and the acceleration q' u + q'' x. So each limit of an acceleration or a torque is a
row a u + b x <= c, and each limit of a speed a bound of x.

Source: Q.-C. Pham, H. Pham, "A New Approach to Time-Optimal Path Parameterization Based on Reachability Analysis",
IEEE Transactions on Robotics 34(3), 2018.
"""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class PathRates:
    """A path of the joints at some places, with its derivatives by the path's parameter.

    Attributes:
        s: shape (n,), the places: parameters of the path, from 0 to its end, not falling. Where the curvature jumps, a
            place stands twice, with the values before and after it.
        joints: shape (n, joints), in mm and degrees.
        first: shape (n, joints), first derivative of the joints by the parameter.
        second: shape (n, joints), second derivative.
        tool: shape (n, 2), way of the tool in mm and its turn in degrees for each unit of the parameter.
    """

    s: FloatArray
    joints: FloatArray
    first: FloatArray
    second: FloatArray
    tool: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """The limits at n places: a u + b x <= c in each of m rows, and 0 <= x <= x_max.

    Attributes:
        a: shape (n, m).
        b: shape (n, m).
        c: shape (n, m), none below 0: the machine may stand everywhere.
        x_max: shape (n,).
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    x_max: FloatArray

    def beside(self, more: Self) -> Self:
        """Return these and more rows at the same places."""
        pairs = ((self.a, more.a), (self.b, more.b), (self.c, more.c))
        a, b, c = (np.concatenate(pair, axis=1) for pair in pairs)
        return type(self)(a, b, c, np.minimum(self.x_max, more.x_max))


_RATE: Final = 1.0 - 1e-4
"""Part of the drivers' step rate that is used: wire units round the speeds, and the firmware refuses any excess."""


@dataclass(frozen=True, slots=True, eq=False)
class PathLimits:
    """The limits along a path, at each of its places.

    Attributes:
        speeds: shape (n, joints + axes), highest speeds of the joints and then of the axes.
        accelerations: shape (n, joints + axes), likewise.
        tool: shape (n, 2), highest speed of the tool in mm/s and deg/s; infinite where none is asked for.
    """

    speeds: FloatArray
    accelerations: FloatArray
    tool: FloatArray

    @classmethod
    def of(cls, robot: Robot, percent: FloatArray, tool: FloatArray) -> Self:
        """Return percentages of the robot's own limits, of shape (n,), and speeds of the tool, of shape (n, 2).

        The axes' speeds are also limited by the drivers' step rate, of which a percentage is no part.
        """
        speeds = [joint.speed_max for joint in robot.joints]
        accelerations = [joint.acceleration_max for joint in robot.joints]
        part = percent[:, np.newaxis] / 100
        by_rate = _RATE * robot.board.driver_rate_max_hz / np.abs(robot.steps_per_unit)
        return cls(
            np.concatenate([part * speeds, np.minimum(part * robot.axis_speeds_max, by_rate)], axis=1),
            part * np.concatenate([accelerations, robot.axis_accelerations_max]),
            tool,
        )

    def rows(self, robot: Robot, rates: PathRates) -> Rows:
        """Return the rows of a path of the robot's joints with these limits."""
        first, second = (with_axes(robot, values) for values in (rates.first, rates.second))
        with np.errstate(divide="ignore"):
            by_joints = (self.speeds / np.abs(first)).min(axis=1)
            by_tool = np.where(np.isfinite(self.tool), self.tool / rates.tool, np.inf).min(axis=1)
        return Rows(
            np.concatenate([first, -first], axis=1),
            np.concatenate([second, -second], axis=1),
            np.concatenate([self.accelerations, self.accelerations], axis=1),
            np.minimum(by_joints, by_tool) ** 2,
        )


AVERAGE_S: Final = 0.05
"""Time over which a motion is averaged without `jerk_max`: half of what a joint move's S-curve takes to accelerate."""
_AVERAGE_LEAST_S: Final = 0.01
"""Least such time: PVT records of 10 ms, halved down to 2 ms, hold no shorter one."""
_LEAST_STEP: Final = 1e-12
"""Part of a path below which a step between places has no third derivative: there the curvature jumps."""
_MOVES: Final = 1e-6
"""Part of the most moved joint's speed below which a joint stands."""


def moved_joints(robot: Robot, first: FloatArray) -> BoolArray:
    """Return which joints move on a path, of shape (joints,), from their derivatives of shape (n, joints)."""
    used = np.abs(first).max(axis=0) / np.array([joint.speed_max for joint in robot.joints])
    return np.asarray(used > _MOVES * used.max())


def jerks_max(robot: Robot) -> FloatArray:
    """Return the highest jerks of the joints, shape (joints,): infinite without `jerk_max`, else what records hold."""
    return np.array(
        [
            np.inf if joint.jerk_max is None else min(joint.jerk_max, 2.0 * joint.acceleration_max / _AVERAGE_LEAST_S)
            for joint in robot.joints
        ]
    )


def machine_average_s(robot: Robot, rates: PathRates) -> float:
    """Return the time over which a motion along a path is averaged, by the jerk of the joints that move.

    On a straight path the jerk of a motion is at most twice its acceleration over that time.
    """
    jerks, accelerations = jerks_max(robot), np.array([joint.acceleration_max for joint in robot.joints])
    each = np.where(np.isinf(jerks), AVERAGE_S, 2.0 * accelerations / jerks)
    return float(each[moved_joints(robot, rates.first)].max())


def squares_in_bends(robot: Robot, rates: PathRates, limits: PathLimits, average_s: float) -> FloatArray:
    """Return the squares of speeds up to which a bend changes accelerations little in the averaging time, shape (n,).

    At the speed v a path changes an acceleration by q''' v^3 in each second: in that time by twice the limit at most.
    """
    second, steps = with_axes(robot, rates.second), np.diff(rates.s)
    moved = np.flatnonzero(steps > _LEAST_STEP * rates.s[-1])
    third = np.zeros_like(second)
    each = np.abs(second[moved + 1] - second[moved]) / steps[moved, np.newaxis]
    for places in (moved, moved + 1):
        np.maximum.at(third, places, each)
    with np.errstate(divide="ignore"):
        return np.asarray(((2.0 * limits.accelerations / (average_s * third)) ** (2.0 / 3.0)).min(axis=1))


def with_axes(robot: Robot, joints: FloatArray) -> FloatArray:
    """Return values of the joints beside those of the axes, shape (n, joints + axes), from shape (n, joints)."""
    return np.concatenate([joints, robot.coupling.to_axes(joints)], axis=1)
