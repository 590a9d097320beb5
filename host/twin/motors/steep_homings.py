"""Homings that accelerate a joint harder than the motors manage: one of them slips, and the board does not know it."""

from steptwin.emulator.drivers.driver_profiles import DriverProfile
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.motors.ramps import JointRamp, ramps_of


def steep_homings(robot: Robot, profile: DriverProfile) -> list[str]:
    """Return a line for each homing of a robot that is too steep, with its drivers or others as they usually are set.

    Raises:
        InputError: the robot's file does not describe its motors and masses.
    """
    return [
        steep_homing(joint.name, joint.unit, ramps.homing)
        for joint, ramps in zip(robot.joints, ramps_of(robot, profile), strict=True)
        if ramps.homing is not None and ramps.homing.too_steep
    ]


def steep_homing(joint: str, unit: str, ramp: JointRamp) -> str:
    """Return what happens in a homing that is too steep, and what the motors manage; `unit` is mm or deg."""
    what = "homing stalls" if ramp.weakest == joint else f"homing turns {ramp.weakest} out of step"
    return (
        f"{joint}: {what} at {ramp.asked:g} {unit}/s2 where the arm is hardest to turn: its motors manage"
        f" {ramp.managed:.0f} (joints.{joint}.homing.acceleration in the robot's file)"
    )
