"""How much faster than planned a motion may run on the way, by the motors of its robot.

Who makes a motion faster asks nobody's motors, so the plan knows beforehand what they hold: its rotors turn by it, as
`run --motors` does, at the highest speed that all else allows, with the reserve that a motion limited by motors has.
"""

from dataclasses import replace
from typing import Final

from steptwin.features.motors.limits.motor_rows import FASTER
from steptwin.features.motors.turning.after_run import MotionSlip, first_slip
from steptwin.features.motors.turning.driving import Driving
from steptwin.host.common.errors import StepTwinError
from steptwin.host.common.planning_time import PlanningTimeError, check_planning_time, in_planning_time, plan_within
from steptwin.host.planning.plan import PLANNED_PERCENT, HighestSpeed, Plan
from steptwin.host.planning.trajectory import DerivedTrajectory
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.machine.kernels import fastest_kernel

LOOK_S: Final = 20.0
"""Processor time for it: the rotors of two minutes of a motion turn in it."""


def held_speed(plan: Plan, percent: int) -> HighestSpeed:
    """Return the highest speed up to a percentage at which the rotors keep step, at least the planned one.

    A motion whose rotors take too long to turn, or whose run beforehand fails, is made no faster.
    """
    try:
        with plan_within(LOOK_S), in_planning_time():
            return _held(plan, percent)
    except PlanningTimeError:
        return HighestSpeed(PLANNED_PERCENT, f"its motors: to turn them beforehand takes more than {LOOK_S:g} s")
    except StepTwinError as error:
        return HighestSpeed(PLANNED_PERCENT, f"its motors: a run beforehand fails: {error}")


def _held(plan: Plan, percent: int) -> HighestSpeed:
    def progress(_: float) -> None:
        check_planning_time()

    alone = replace(plan, trajectory=DerivedTrajectory(plan.trajectory))  # without its waits
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
