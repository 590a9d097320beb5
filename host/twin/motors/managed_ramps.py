"""A robot whose joints accelerate no harder than its motors manage, with torque to spare."""

from dataclasses import replace
from functools import lru_cache
from typing import Final

from steptwin.host.common.errors import InputError
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.motors.ramps import JointRamps, Ramp, ramps_of

RAMP_PART: Final = 0.5
"""Part of what the motors manage. They manage it while one joint ramps and the others stand: half of it leaves a motor
as much again for the others' ramps, as when all joints stop at once."""


@lru_cache(maxsize=256)
def with_managed_ramps(robot: Robot) -> Robot:
    """Return a robot whose accelerations, in moves, stops and homings, its motors manage; none becomes higher.

    Raises:
        InputError: its file does not describe its motors and masses, or a motor is too weak without any acceleration.
    """
    joints = zip(robot.joints, ramps_of(robot), strict=True)
    return replace(robot, joints=tuple(_gentler(joint, ramps) for joint, ramps in joints))


def _gentler(joint: Joint, ramps: JointRamps) -> Joint:
    part = _part(joint, ramps.moving)
    acceleration_max, homing = part * joint.acceleration_max, joint.homing
    if homing is not None and ramps.homing is not None:
        acceleration = min(_part(joint, ramps.homing) * homing.acceleration, acceleration_max)
        homing = replace(homing, acceleration=acceleration)
    return replace(
        joint,
        acceleration_max=acceleration_max,
        axis_acceleration_max=joint.axis_acceleration_max and part * joint.axis_acceleration_max,
        homing=homing,
    )


def _part(joint: Joint, ramp: Ramp) -> float:
    """Return the part of the file's acceleration that remains."""
    if ramp.managed == 0.0:
        weak = f"{ramp.weakest}'s motor is too weak for {joint.name}'s highest speed"
        raise InputError(f"{joint.name}: without any acceleration {weak}")
    return min(1.0, RAMP_PART * ramp.managed / ramp.asked)
