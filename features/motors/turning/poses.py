"""A robot's arm at many poses, with its rotors' angles and inertias there."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from typing import Final, Self

import numpy as np

from steptwin.features.motors.rotors.arm import Arm
from steptwin.features.motors.rotors.torques import carried_torque_nm
from steptwin.features.motors.turning.drives import check_described
from steptwin.features.motors.turning.mechanism import arm_of
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot

_POSES: Final = 64
"""Number of poses that are examined, besides home."""
_PRIMES: Final = (2, 3, 5, 7, 11, 13, 17, 19)
"""Bases of Halton's sequence, one for each axis that a board may drive."""


@dataclass(frozen=True, slots=True, eq=False)
class ArmAtPoses:
    """The arm with its payload, at home and at other reachable poses.

    Attributes:
        arm: its bodies.
        joints: shape (poses, joints), in mm and degrees.
        rad: shape (poses, axes), the rotors' angles.
        inertias_kgm2: shape (poses, axes, axes), torque at the first axis' rotor for each rad/s^2 of the second axis',
            without the rotor's own inertia.
    """

    arm: Arm
    joints: FloatArray
    rad: FloatArray
    inertias_kgm2: FloatArray

    @classmethod
    def of(cls, robot: Robot) -> Self:
        """Return the arm of a robot; raise InputError if its file does not describe its motors and masses."""
        arm, joints = arm_of(robot, check_described(robot).payload_kg), _poses(robot)
        return cls(arm, joints, rotors_of(robot, joints), carried_inertias(robot, arm, joints))


def _poses(robot: Robot) -> FloatArray:
    """Return home and other reachable poses, shape (n, joints): Halton's sequence over the joint ranges."""
    lower, upper = ([getattr(joint, side) for joint in robot.joints] for side in ("lower", "upper"))
    spread = np.array(lower) + halton(_POSES, len(lower)) * np.subtract(upper, lower)
    joints = np.vstack([[robot.home], spread])
    possible = np.isfinite(make_kinematics(robot).forward(joints)).all(axis=1)
    return np.asarray(joints[possible])


def halton(count: int, dimensions: int) -> FloatArray:
    """Return the first points of Halton's sequence after 0, shape (count, dimensions), from 0 to below 1.

    A coordinate is the point's number in a prime base with its digits mirrored at the point (J. H. Halton, Numerische
    Mathematik 2, 1960). scipy.stats takes a second to import, which would delay served boards.

    Raises:
        ValueError: there are more dimensions than a board drives axes.
    """
    points = np.zeros((count, dimensions))
    for axis, base in zip(range(dimensions), _PRIMES[:dimensions], strict=True):
        numbers, weight = np.arange(1, count + 1), 1.0
        while numbers.any():
            weight /= base
            points[:, axis] += weight * (numbers % base)
            numbers //= base
    return points


def carried_inertias(robot: Robot, arm: Arm, joints: FloatArray) -> FloatArray:
    """Return the load inertias at each rotor, without its own, shape (poses, axes, axes).

    An element is the torque at the first axis' rotor for each rad/s^2 of the second axis', with the other axes still.
    """
    rad, count = rotors_of(robot, joints), len(robot.axes)
    still = np.zeros_like(rad)
    columns = [
        carried_torque_nm(arm, rad, still, still + np.eye(count)[axis], gravity_m_s2=0.0) for axis in range(count)
    ]
    return np.stack(columns, axis=2)


def rotors_of(robot: Robot, joints: FloatArray | Sequence[float]) -> FloatArray:
    """Convert joint positions in mm and degrees, or their rates, to rotor angles in rad; shape (..., joints)."""
    return np.asarray(robot.coupling.to_axes(np.asarray(joints)) * rad_per_unit(robot))


def rad_per_unit(robot: Robot) -> FloatArray:
    """Return the rotors' angles in rad for each mm or degree of their axes, shape (axes,)."""
    return 2.0 * pi / np.array([joint.transmission.travel_per_rev for joint in robot.axes])
