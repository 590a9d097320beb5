"""Turn the rotors of a robot by its drivers' currents, during a run or after it."""

import time
from dataclasses import dataclass

from steptwin.features.motors.rotors.rotor_backend import fastest_rotors
from steptwin.features.motors.turning.after_run import MotionSlip, RotorTrace, first_of, rotors_after_run
from steptwin.features.motors.turning.drives import check_described
from steptwin.features.motors.turning.driving import Driving, Progress
from steptwin.features.motors.turning.torques import Torques, torques_of_plan
from steptwin.features.motors.turning.verdict import JointLoad, MotorVerdict, ToolPaths, ToolReached, motor_verdict
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import Comparison
from steptwin.protocol.drivers import DriverProfile

__all__ = ["JointLoad", "MotorRun", "MotorVerdict", "check_described", "motors_of_run"]


@dataclass(frozen=True, slots=True, eq=False)
class MotorRun:
    """The motors of a run.

    Attributes:
        driving: the currents of the run's drivers, and the arm.
        trace: motion of the rotors.
        torques: needed and available torques.
        paths: the tool's poses.
        verdict: the judgement.
        wall_s: time that the computation took.
    """

    driving: Driving
    trace: RotorTrace
    torques: Torques
    paths: ToolPaths
    verdict: MotorVerdict
    wall_s: float

    @property
    def slip(self) -> MotionSlip | None:
        """The first slip of all joints."""
        return first_of(self.driving, self.trace.first_slip_counts)


def motors_of_run(
    robot: Robot,
    comparison: Comparison,
    profile: DriverProfile | None = None,
    *,
    current_a: float | None = None,
    trace: RotorTrace | None = None,
    progress: Progress = lambda _: None,
) -> MotorRun:
    """Turn the rotors by a run's record and judge them.

    Args:
        robot: the robot, with motors and masses.
        comparison: the run's plan and record.
        profile: the run's drivers; None: those of the robot's file.
        current_a: phase current at full torque instead of the record's.
        trace: motion of rotors that have turned with the board; None: turn them now.
        progress: called with the fraction done.

    Raises:
        InputError: the robot's file does not describe its motors and masses, or a motor cannot have this current.
    """
    driving = Driving.of(robot, comparison.evidence, profile)
    if current_a is not None:
        driving = driving.at_current(current_a)
    fastest_rotors()  # Compilation happens once in a process; it is no part of the measured time.
    began_s = time.perf_counter()
    if trace is None:
        trace = rotors_after_run(driving, progress)
    wall_s = time.perf_counter() - began_s
    paths = ToolPaths.of(driving, comparison, trace)
    torques = torques_of_plan(driving, comparison, trace.supply_span_v[0])
    verdict = motor_verdict(driving, comparison, torques, trace, ToolReached.of(paths))
    return MotorRun(driving, trace, torques, paths, verdict, wall_s)
