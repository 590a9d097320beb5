"""What motors are to planning: a limit of fastest motions, a forecast, and a limit of the speed on the way.

Pull-out torques, arms and rotors need the emulator, so they are imported when they are asked for.
"""

from steptwin.features.motors.limits import motor_forecast, motor_limits
from steptwin.host.planning.drives import DriveLimits
from steptwin.host.planning.plan import HighestSpeed, Plan
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.robot import Robot


def limits(robot: Robot, left_percent: float) -> DriveLimits:
    """Return what a robot's motors allow; raises as `motor_limits`."""
    return motor_limits(robot, left_percent)


def forecast(robot: Robot, motion: Trajectory) -> str | None:
    """Return whether a robot's rotors will slip, or may; None if all is well."""
    return motor_forecast(robot, motion)


def highest_speed(plan: Plan, percent: int) -> HighestSpeed | None:
    """Return the highest speed up to a percentage that the motors hold; None for a robot without described motors."""
    if not plan.robot.has_motors:
        return None
    from steptwin.features.motors.limits.override import held_speed

    return held_speed(plan, percent)
