"""Verify digital outputs: each planned change was made within its time, in the planned order, and no other change.

A plan may ask for a level that an output already has: then nothing is to change. What an output did before the motion,
as on a live board, only says which level it began with.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from steptwin.host.planning.trajectory import Switching
from steptwin.host.robots.robot import Robot
from steptwin.host.verify.evidence import AxisEvidence, Evidence, OutputChange


@dataclass(frozen=True, slots=True)
class OutputReport:
    """One planned switching of an output; times are the trajectory's.

    Attributes:
        name: name of the output.
        on: the planned level.
        from_s: earliest time of the change.
        until_s: latest time of the change.
        changed_s: time of the change on the board; None if the board did not make it.
        already: True if the output had this level already, so that nothing was to change.
    """

    name: str
    on: bool
    from_s: float
    until_s: float
    changed_s: float | None
    already: bool

    @property
    def in_time(self) -> bool:
        """True if the output changed between `from_s` and `until_s`, or had nothing to change."""
        return self.already or (self.changed_s is not None and self.from_s <= self.changed_s <= self.until_s)


def output_reports(planned: tuple[Switching, ...], evidence: Evidence) -> tuple[OutputReport, ...]:
    """Return a report for each planned switching: the k-th that changes a level is held to the k-th change made."""
    levels = {change.name: bool(change.level) for change in evidence.outputs if change.counts < evidence.start_counts}
    made = iter(_in_motion(evidence))
    reports = []
    for switching in planned:
        name, on = switching.output, switching.on
        already, changed_s = levels.get(name, False) == on, None
        levels[name] = on
        if not already:
            change = next(made, None)
            if change is not None and (change.name, bool(change.level)) == (name, on):
                changed_s = evidence.trajectory_s(change.counts)
        reports.append(OutputReport(name, on, switching.from_s, switching.until_s, changed_s, already))
    return tuple(reports)


def _in_motion(evidence: Evidence) -> list[OutputChange]:
    """Return the changes from the motion's start on."""
    return [change for change in evidence.outputs if change.counts >= evidence.start_counts]


def output_reasons(reports: tuple[OutputReport, ...], evidence: Evidence) -> list[str]:
    """Return one line for each output that fails, and one if the board made changes that were not planned."""
    reasons = [
        f"{report.name}: switched {'on' if report.on else 'off'} {_when(report.changed_s)}"
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


def output_changes(robot: Robot, axes: Sequence[AxisEvidence]) -> tuple[OutputChange, ...]:
    """Return every change of the robot's outputs in order of time; pins without a named output are left out."""
    pins = {axis.name: axis.pins for axis in axes}
    changes = [
        OutputChange(name, counts, level)
        for name, output in robot.outputs.items()
        for edges in [pins[output.joint][f"out{output.out}"]]
        for counts, level in zip(edges.counts.tolist(), edges.levels.tolist(), strict=True)
    ]
    return tuple(sorted(changes, key=lambda change: change.counts))
