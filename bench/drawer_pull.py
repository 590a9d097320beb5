"""Measure the whole drawer pull: six axes over CAN at 100 points a second, in simulated seconds per wall second.

How fast that is depends on the machine. So the time of a bare bus is measured in turns with it: a loop of plain Python
that makes each of the run's frames, finds who listens to its identifier, calls this receiver and keeps a log. No
emulation that is driven frame by frame can be faster than that, and the ratio to it hardly depends on the machine.
"""

import time
from dataclasses import dataclass
from statistics import median

from steptwin.controller.motion.backend import Kernel
from steptwin.host.common.processes import collect_seldom
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.verify import compare, verify_comparison
from steptwin.protocol.frame import Frame

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
    bare_bus_ratio: float
    """Wall time divided by that of a bare bus with the same frames."""
    error_steps_max: float
    timing_us_p50: float


def measure(kernel: Kernel) -> DrawerPullFigure:
    """Run the job REPEATS times after a warm-up; raise AssertionError if a run fails its verification.

    Garbage is collected as seldom as in a process of the command line.
    """
    collect_seldom()
    robot = load_robot("warehouse-scara")
    planned = plan(robot, make_job(robot, "drawer-pull", {}))
    emulation, verification, bare = [], [], []
    for repeat in range(REPEATS + 1):
        outcome = execute(planned, "drawer-pull", kernel)
        assert outcome.report.passed, outcome.report.reasons
        started = time.perf_counter()
        verify_comparison(compare(outcome.comparison.expected, outcome.comparison.evidence), outcome.report.run)
        if repeat:  # run 0 warms up
            emulation.append(outcome.report.run.wall_s)
            verification.append(time.perf_counter() - started)
            bare.append(_bare_bus_s(outcome.bus_log))
    report = outcome.report
    moving = [axis for axis in report.axes if axis.pulses]
    return DrawerPullFigure(
        kernel.name,
        report.run.bus.frames,
        median(emulation),
        median(verification),
        report.run.simulated_s / median(emulation),
        median(emulation) / median(bare),
        max(axis.position_error_steps_max for axis in moving),
        max(axis.timing_error_us_p50 for axis in moving),
    )


def _bare_bus_s(log: list[tuple[int, Frame]]) -> float:
    """Return the time that plain Python takes to deliver the frames of a bus log, and to keep a log of them."""
    heard: list[bytes] = []

    def receive(frame: Frame, _counts: int) -> None:
        heard.append(frame.data)

    receivers = {frame.cob_id: receive for _, frame in log}
    sent = [(counts, frame.cob_id, bytes(frame.data)) for counts, frame in log]
    delivered: list[tuple[int, Frame]] = []
    started = time.perf_counter()
    for counts, cob_id, data in sent:
        frame = Frame(cob_id, data)
        receivers[cob_id](frame, counts)
        delivered.append((counts, frame))
    bare_s = time.perf_counter() - started
    assert delivered == log
    assert len(heard) == len(log)
    return bare_s
