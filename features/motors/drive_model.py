"""Drive model of motors for planning: limits of fastest motions, a forecast, and the highest speed override.

A faster motion is not planned anew, so a plan computes beforehand what its motors hold. The rotors turn by it, as with
`run --motors`, at the highest speed that all other limits allow, with the reserve of a motion limited by motors.
Pull-out torques, arms and rotors need the emulator, so functions import them when called.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, Final

from steptwin.features.motors import NAME
from steptwin.features.motors.limits import motor_forecast, motor_limits
from steptwin.host.common.errors import StepTwinError
from steptwin.host.common.planning_time import PlanningTimeError, check_planning_time, in_planning_time, plan_within
from steptwin.host.planning.drives import DriveLimits
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.plan import PLANNED_PERCENT, HighestSpeed, Plan
from steptwin.host.robots.robot import Robot

if TYPE_CHECKING:
    from steptwin.features.motors.turning.after_run import MotionSlip

name: Final = NAME
LOOK_S: Final = 20.0
"""Processor time to find the highest speed: the rotors of two minutes of a motion turn in it."""


def limits(robot: Robot, left_percent: float) -> DriveLimits:
    """Return the limits of a robot's motors; raises as `motor_limits`."""
    return motor_limits(robot, left_percent)


def forecast(robot: Robot, motion: Motion) -> str | None:
    """Return a warning if a robot's rotors will or may slip; None if not."""
    return motor_forecast(robot, motion)


def highest_speed(plan: Plan, percent: int) -> HighestSpeed | None:
    """Return the highest speed up to a percentage at which the rotors keep step, at least the planned one.

    It is the planned one if the rotors take too long to turn, or if the run beforehand fails; None if the robot's file
    describes no motors.
    """
    if not plan.robot.has_motors:
        return None
    try:
        with plan_within(LOOK_S), in_planning_time():
            return _held_speed(plan, percent)
    except PlanningTimeError:
        return HighestSpeed(PLANNED_PERCENT, f"its motors: to turn them beforehand takes more than {LOOK_S:g} s")
    except StepTwinError as error:
        return HighestSpeed(PLANNED_PERCENT, f"its motors: a run beforehand fails: {error}")


def _held_speed(plan: Plan, percent: int) -> HighestSpeed:
    from steptwin.features.motors.limits.motor_rows import FASTER
    from steptwin.features.motors.turning.after_run import first_slip
    from steptwin.features.motors.turning.driving import Driving
    from steptwin.host.twin.embedded.execution import execute
    from steptwin.host.twin.machine.kernels import fastest_kernel

    def progress(_: float) -> None:
        check_planning_time()

    alone = replace(plan, motion=replace(plan.motion, waits=()))
    ran = execute(alone, "", fastest_kernel(), progress=progress)
    if ran.fault is not None:
        return HighestSpeed(PLANNED_PERCENT, f"its motors: a run beforehand fails: {ran.fault}")
    driving = Driving.of(plan.robot, ran.comparison.evidence)
    slips: dict[int, MotionSlip] = {}

    def keeps_step(percent: int) -> bool:
        slip = first_slip(driving.stretched(FASTER * PLANNED_PERCENT / percent), progress)
        if slip is not None:
            slips[percent] = slip
        return slip is None

    low, high = PLANNED_PERCENT, percent
    if keeps_step(high):
        return HighestSpeed(high, "its motors")
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if keeps_step(middle) else (low, middle)
    return HighestSpeed(low, f"{slips[high].joint}: its motor")
