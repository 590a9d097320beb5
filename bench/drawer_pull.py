"""Measure the whole drawer pull: six axes over CAN at 100 points a second, in simulated seconds per wall second."""

import time
from dataclasses import dataclass
from statistics import median

from steptwin.controller.backend import Kernel
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.execution import execute
from steptwin.host.verify import compare, verify_comparison

REPEATS = 9


@dataclass(frozen=True)
class DrawerPullFigure:
    """One row of the table: medians over REPEATS runs after a warm-up."""

    kernel: str
    frames: int
    emulation_s: float
    verification_s: float
    simulated_per_wall: float
    """Simulated time divided by the wall time from switching the board on to switching the drives off."""
    error_steps_max: float
    timing_us_p50: float


def measure(kernel: Kernel) -> DrawerPullFigure:
    """Run the job REPEATS times after a warm-up; raise AssertionError if a run fails its verification."""
    robot = load_robot("warehouse-scara")
    planned = plan(robot, make_job(robot, "drawer-pull", {}))
    emulation, verification = [], []
    for repeat in range(REPEATS + 1):
        outcome = execute(planned, "drawer-pull", kernel)
        assert outcome.report.passed, outcome.report.reasons
        started = time.perf_counter()
        verify_comparison(compare(outcome.comparison.expected, outcome.comparison.evidence), outcome.report.run)
        if repeat:  # run 0 warms up
            emulation.append(outcome.report.run.wall_s)
            verification.append(time.perf_counter() - started)
    report = outcome.report
    moving = [axis for axis in report.axes if axis.pulses]
    return DrawerPullFigure(
        kernel.name,
        report.run.bus.frames,
        median(emulation),
        median(verification),
        report.run.simulated_s / median(emulation),
        max(axis.position_error_steps_max for axis in moving),
        max(axis.timing_error_us_p50 for axis in moving),
    )
