"""Turn the rotors of a robot by what its drivers did, after a run or as it goes."""

from steptwin.host.robots.robot import Robot
from steptwin.host.twin.motors.after_run import Progress, check_described, rotors_after_run
from steptwin.host.twin.motors.verdict import JointLoad, MotorVerdict, motor_verdict
from steptwin.host.verify import Comparison

__all__ = ["JointLoad", "MotorVerdict", "check_described", "motors_of_run"]


def motors_of_run(
    robot: Robot, comparison: Comparison, *, current_a: float | None = None, progress: Progress = lambda _: None
) -> MotorVerdict:
    """Turn the rotors by a run's record and judge what they did.

    Args:
        robot: the robot, with motors and masses.
        comparison: the run's plan and record.
        current_a: phase current at full torque instead of the record's.
        progress: called with the part that is done.

    Raises:
        InputError: the robot's file does not describe its motors and masses, or a motor cannot have this current.
    """
    trace = rotors_after_run(robot, comparison.evidence, current_a=current_a, progress=progress)
    return motor_verdict(robot, comparison, trace, current_a=current_a)
