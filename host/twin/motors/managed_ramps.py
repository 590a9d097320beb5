"""A robot whose joints accelerate no harder than its motors manage, all at once and with torque to spare."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from math import inf, nextafter

from scipy.optimize import brentq

from steptwin.emulator.driver_profiles import DriverProfile
from steptwin.host.common.errors import InputError
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.motors.ramps import Ramp, ramps_of
from steptwin.host.twin.motors.verdict import MARGIN_MIN


@lru_cache(maxsize=256)
def with_managed_ramps(robot: Robot, drivers: DriverProfile | None = None) -> Robot:
    """Return a robot whose accelerations, in moves, stops and homings, its motors manage; none becomes higher.

    Its motors are at its own drivers, or at others as they usually are set.

    Of what the motors manage of a joint while the others stand, all joints that ask something of a motor get the same
    part: the greatest that leaves it MARGIN_MIN of its torque when all ramp at once, as in a stop or in homings side by
    side.

    Raises:
        InputError: its file does not describe its motors and masses, or a motor is too weak without any acceleration.
    """
    ramps = dict(zip(robot.joint_names, ramps_of(robot, drivers), strict=True))
    moving = _at_once({name: each.moving for name, each in ramps.items()})
    searching = {name: each.homing for name, each in ramps.items() if each.homing}
    homing = _at_once(searching) if searching else {}
    joints = (
        _gentler(joint, robot.coupling.joints_of(axis)[axis], moving[joint.name], homing.get(joint.name))
        for axis, joint in enumerate(robot.joints)
    )
    return replace(robot, joints=tuple(joints))


def _at_once(ramps: Mapping[str, Ramp]) -> dict[str, float]:
    """Return the accelerations, by joint, that all may have at once."""
    for name, ramp in ramps.items():
        if ramp.managed == 0.0:
            weak = f"{ramp.weakest}'s motor is too weak for {name}'s highest speed"
            raise InputError(f"{name}: without any acceleration {weak}")

    parts = {motor: _part_for(motor, ramps) for motor in next(iter(ramps.values())).by_motor}
    return {
        name: ramp.lowered_to(min(parts[motor] for motor, most in ramp.by_motor.items() if most < inf))
        for name, ramp in ramps.items()
    }


def _part_for(motor: str, ramps: Mapping[str, Ramp]) -> float:
    """Return the part of what the motors manage of each joint at which this motor manages all of them at once."""

    def beyond(part: float) -> float:
        """Return what the joints ask of it, as a part of what it manages, beyond what it should."""
        return sum(ramp.lowered_to(part) / ramp.by_motor[motor] for ramp in ramps.values()) - (1.0 - MARGIN_MIN)

    return 1.0 if beyond(1.0) <= 0.0 else float(brentq(beyond, 0.0, 1.0))


def _gentler(joint: Joint, element: float, acceleration: float, homing_acceleration: float | None) -> Joint:
    """Return a joint with an acceleration of its axis, and with one of its homing, which moves the axis so, too.

    A joint alone moves its axis by `element`.
    """
    part = acceleration / (joint.axis_acceleration_max or joint.acceleration_max)
    acceleration_max, homing = part * joint.acceleration_max, joint.homing
    axis_acceleration_max = joint.axis_acceleration_max and part * joint.axis_acceleration_max
    if homing is not None and homing_acceleration is not None:
        by_axis = nextafter((axis_acceleration_max or acceleration_max) / element, 0.0) if element > 1.0 else inf
        homing = replace(homing, acceleration=min(homing_acceleration, acceleration_max, by_axis))
    return replace(joint, acceleration_max=acceleration_max, axis_acceleration_max=axis_acceleration_max, homing=homing)
