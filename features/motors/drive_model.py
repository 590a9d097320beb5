"""Drive model of motors for planning: limits of fastest motions, a forecast, and the highest speed override.

Pull-out torques, arms and rotors need the emulator, so functions import them when called.
"""

from steptwin.features.motors.limits import motor_forecast, motor_limits
from steptwin.host.planning.drives import DriveLimits
from steptwin.host.planning.plan import HighestSpeed, Plan
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.robot import Robot


def limits(robot: Robot, left_percent: float) -> DriveLimits:
    """Return the limits of a robot's motors; raises as `motor_limits`."""
    return motor_limits(robot, left_percent)


def forecast(robot: Robot, motion: Trajectory) -> str | None:
    """Return a warning if a robot's rotors will or may slip; None if not."""
    return motor_forecast(robot, motion)


def highest_speed(plan: Plan, percent: int) -> HighestSpeed | None:
    """Return the highest speed, up to a percentage, that the motors hold; None if the file describes no motors."""
    if not plan.robot.has_motors:
        return None
    from steptwin.features.motors.limits.override import held_speed

    return held_speed(plan, percent)
