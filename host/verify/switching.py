"""Verify digital outputs: each planned change was made in time and in the planned order, without any other change.

A plan may contain the level that an output already has; no change is expected then. Changes before the motion, as on a
live board, only define the initial level.
"""

from collections.abc import Sequence
from dataclasses import replace

from steptwin.host.planning.motion import OutputChange
from steptwin.host.robots.robot import Robot
from steptwin.host.verify.evidence import AxisEvidence, Evidence, OutputEdge


def output_reports(planned: tuple[OutputChange, ...], evidence: Evidence) -> tuple[OutputChange, ...]:
    """Return each planned change with its real time: the k-th effective change is compared with the k-th real one."""
    levels = {edge.name: bool(edge.level) for edge in evidence.outputs if edge.counts < evidence.start_counts}
    made = iter(_in_motion(evidence))
    reports = []
    for change in planned:
        name, on = change.output, change.on
        already, changed_s = levels.get(name, False) == on, None
        levels[name] = on
        if not already:
            edge = next(made, None)
            if edge is not None and (edge.name, bool(edge.level)) == (name, on):
                changed_s = evidence.trajectory_s(edge.counts)
        reports.append(replace(change, changed_s=changed_s, already=already))
    return tuple(reports)


def _in_motion(evidence: Evidence) -> list[OutputEdge]:
    """Return the changes from the motion's start on."""
    return [edge for edge in evidence.outputs if edge.counts >= evidence.start_counts]


def output_reasons(reports: tuple[OutputChange, ...], evidence: Evidence) -> list[str]:
    """Return one line for each failed output, and one for unplanned changes."""
    reasons = [
        f"{report.output}: switched {'on' if report.on else 'off'} {_when(report.changed_s)}"
        f" (planned from {report.from_s:.3f} to {report.until_s:.3f} s)"
        for report in reports
        if not report.in_time
    ]
    unplanned = len(_in_motion(evidence)) - sum(report.changed_s is not None for report in reports)
    if unplanned:
        reasons.append(f"outputs: {unplanned} changes that were not planned (limit 0)")
    return reasons


def _when(changed_s: float | None) -> str:
    return "never" if changed_s is None else f"at {changed_s:.6f} s"


def output_edges(robot: Robot, axes: Sequence[AxisEvidence]) -> tuple[OutputEdge, ...]:
    """Return every change of the robot's outputs in order of time; pins without a named output are left out."""
    pins = {axis.name: axis.pins for axis in axes}
    changes = [
        OutputEdge(name, counts, level)
        for name, output in robot.outputs.items()
        for edges in [pins[output.joint][f"out{output.out}"]]
        for counts, level in zip(edges.counts.tolist(), edges.levels.tolist(), strict=True)
    ]
    return tuple(sorted(changes, key=lambda change: change.counts))
