"""Measure the motors of a run: the rotors of each robot after its job, in simulated seconds per wall second."""

import time
from dataclasses import dataclass
from statistics import median
from typing import Final

from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.machine.kernels import fastest_kernel
from steptwin.host.twin.motors.after_run import rotors_after_run
from steptwin.host.twin.motors.driving import Driving

RUNS: Final = (("warehouse-scara", "store"), ("lab-scara", "spiral"), ("hybrid-arm", "helix"))
REPEATS: Final = 3


@dataclass(frozen=True)
class RotorFigure:
    """One row of the table: the median over REPEATS after a warm-up."""

    robot: str
    job: str
    axes: int
    simulated_s: float
    wall_s: float

    @property
    def simulated_per_wall(self) -> float:
        """Time that the rotors turn, divided by the time that it takes."""
        return self.simulated_s / self.wall_s


def figures() -> list[RotorFigure]:
    """Make each run once, then turn its motors by its record several times."""
    return [_figure(*run) for run in RUNS]


def _figure(robot_name: str, job: str) -> RotorFigure:
    robot = load_robot(robot_name)
    outcome = execute(plan(robot, make_job(robot, job, {})), job, fastest_kernel())
    driving = Driving.of(robot, outcome.comparison.evidence)
    took_s = []
    for _ in range(1 + REPEATS):  # the first one compiles
        began_s = time.perf_counter()
        rotors_after_run(driving)
        took_s.append(time.perf_counter() - began_s)
    return RotorFigure(robot_name, job, len(robot.joints), driving.total_ms / 1000, median(took_s[1:]))
