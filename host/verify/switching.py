"""Digital outputs: did each change when the plan wanted it, while the machine stood still, and nothing else?"""

from dataclasses import dataclass
from itertools import zip_longest

from steptwin.host.planning.trajectory import Switching
from steptwin.host.verify.evidence import Evidence, OutputChange
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True)
class OutputReport:
    """One planned change of an output.

    Attributes:
        name: of the output.
        on: the level that it was to take.
        from_s: when it might change, as time of the motion.
        until_s: when it must have changed.
        changed_s: when it did; None if it did not.
    """

    name: str
    on: bool
    from_s: float
    until_s: float
    changed_s: float | None

    @property
    def in_time(self) -> bool:
        """Whether it changed within its time."""
        return self.changed_s is not None and self.from_s <= self.changed_s <= self.until_s


def output_reports(planned: tuple[Switching, ...], evidence: Evidence) -> tuple[OutputReport, ...]:
    """Each planned change with the next one, of any output, that the board made."""
    made = _made(planned, evidence)
    return tuple(
        OutputReport(switching.output, switching.on, switching.from_s, switching.until_s, changed_s)
        for switching, changed_s in zip(planned, made, strict=True)
    )


def output_reasons(reports: tuple[OutputReport, ...], evidence: Evidence) -> list[str]:
    """Why the outputs fail, one line each."""
    reasons = [
        f"{report.name}: switched {'on' if report.on else 'off'} {_when(report.changed_s)}"
        f" (planned from {report.from_s:.3f} to {report.until_s:.3f} s)"
        for report in reports
        if not report.in_time
    ]
    unplanned = len(evidence.outputs) - sum(report.changed_s is not None for report in reports)
    if unplanned:
        reasons.append(f"outputs: {unplanned} changes that were not planned (limit 0)")
    return reasons


def _made(planned: tuple[Switching, ...], evidence: Evidence) -> list[float | None]:
    """When each planned change was made: they must come in the order of the plan, or count as not made."""
    made: list[float | None] = []
    for switching, change in zip_longest(planned, evidence.outputs):
        if switching is None:
            break
        right = change is not None and (change.name, bool(change.level)) == (switching.output, switching.on)
        made.append(_time_s(change, evidence) if right else None)
    return made


def _time_s(change: OutputChange, evidence: Evidence) -> float:
    return (change.counts - evidence.start_counts) / COUNTS_PER_SECOND


def _when(changed_s: float | None) -> str:
    return "never" if changed_s is None else f"at {changed_s:.6f} s"
