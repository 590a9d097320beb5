"""Homings that accelerate a joint harder than the motors manage: one of them slips, and the board does not know it."""

from steptwin.emulator.driver_profiles import DriverProfile
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.drivers import driver_profile
from steptwin.host.twin.motors.ramps import Ramp, ramps_of


def steep_homings(robot: Robot, profile: DriverProfile) -> list[str]:
    """Return a line for each homing of a robot that is too steep, with its own drivers or others as they usually are.

    Raises:
        InputError: the robot's file does not describe its motors and masses.
    """
    current_a = None if profile == driver_profile(robot.board) else profile.current_a
    return [
        steep_homing(joint.name, joint.unit, ramps.homing)
        for joint, ramps in zip(robot.joints, ramps_of(robot, current_a), strict=True)
        if ramps.homing is not None and ramps.homing.too_steep
    ]


def steep_homing(joint: str, unit: str, ramp: Ramp) -> str:
    """Return what happens in a homing that is too steep, and what the motors manage; `unit` is mm or deg."""
    what = "homing stalls" if ramp.weakest == joint else f"homing turns {ramp.weakest} out of step"
    return (
        f"{joint}: {what} at {ramp.asked:g} {unit}/s2 where the arm is hardest to turn: its motors manage"
        f" {ramp.managed:.0f} (joints.{joint}.homing.acceleration in the robot's file)"
    )
