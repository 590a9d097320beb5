"""Let fastest motions be limited by a robot's motors: its torques as rows for the planner, its rotors as their judge.

It stands in the twin, since pull-out torques, arms and rotors are the emulator's: planning defines what it needs
(`host/planning/fastest/drives.py`), and who plans for a machine with motors hands `motor_limits` in.
"""

from steptwin.host.planning.fastest import DriveLimits
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.robot import Robot

__all__ = ["motor_forecast", "motor_limits"]


def motor_limits(robot: Robot, left_percent: float) -> DriveLimits:
    """Return what a robot's motors allow if they are to leave some percent of their pull-out torque.

    Raises:
        InputError: the robot's file does not describe its motors and masses.
    """
    from steptwin.host.twin.motor_limits.motor_rows import MotorLimits  # for this alone all of the emulator is imported

    return MotorLimits.of(robot, left_percent)


def motor_forecast(robot: Robot, motion: Trajectory) -> str | None:
    """Return what to say of a robot's motors before a motion runs: they will slip, or may; None if nothing is to say.

    Nothing is said of a robot whose file does not describe motors and masses.
    """
    if robot.dynamics is None or any(joint.motor is None or joint.link is None for joint in robot.joints):
        return None
    from steptwin.host.twin.motor_limits.forecast import forecast

    return forecast(robot, motion)
