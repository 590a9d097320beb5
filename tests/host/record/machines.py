"""Stored runs made without a board: a job's plan, and the evidence of a board that executes it perfectly."""

from dataclasses import replace
from functools import cache

import numpy as np

from steptwin.host.planning.jobs import make_job
from steptwin.host.record.folder import StoredRun
from steptwin.host.record.folder.report_file import StoredReport
from steptwin.host.robots import load_robot
from steptwin.host.verify import BusReport, Evidence, Expectation, LevelEdges, RunInfo, compare
from steptwin.protocol.timer import COUNTS_PER_SECOND
from tests.host.verify.motions import perfect_evidence


@cache
def perfect_run(name: str, job: str) -> StoredRun:
    """Return a run of a job of one of the five robots, with its outputs switched as early as planned."""
    robot = load_robot(name)
    motion = make_job(robot, job, {})
    expected = Expectation.of(robot, motion)
    evidence = perfect_evidence(expected)
    for change in motion.output_changes:
        output = robot.outputs[change.output]
        evidence = _with_edge(evidence, output.joint, f"out{output.out}", change.from_s, change.on)
    run = RunInfo(name, job, motion.duration_s, BusReport(1_000_000, 0, 0.0), motion.duration_s, 1.0)
    report = StoredReport(run, (), True, "chip-330pf", (), None, {})
    return StoredRun(robot, report, compare(expected, evidence))


def _with_edge(evidence: Evidence, joint: str, pin: str, t_s: float, on: bool) -> Evidence:
    """Return the evidence with one more change of a pin, after its others."""
    counts = evidence.start_counts + round(t_s * COUNTS_PER_SECOND)

    def changed(edges: LevelEdges) -> LevelEdges:
        return LevelEdges(np.append(edges.counts, counts), np.append(edges.levels, np.int8(on)))

    axes = [
        replace(axis, pins={**axis.pins, pin: changed(axis.pins[pin])}) if axis.name == joint else axis
        for axis in evidence.axes
    ]
    return replace(evidence, axes=tuple(axes))
