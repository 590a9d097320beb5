"""Verify a stored run again from its files alone, and compare its report with them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from steptwin.host.common.features import giving, judge_of
from steptwin.host.record.bus_log import count_frames
from steptwin.host.record.folder.digests import of_other_runs
from steptwin.host.record.folder.layout import BUS_LOG, REPORT, MachineStop, existing_file
from steptwin.host.record.folder.reading import StoredRun, read_run
from steptwin.host.record.folder.report_file import StoredReport
from steptwin.host.verify import Report, contradictions, verify_comparison
from steptwin.host.verify.figures import axis_figures
from steptwin.protocol.timer import COUNTS_PER_SECOND

_END_S: Final = 1e-3
"""Largest rounding of the run's end in the report."""

_MS: Final = 3
"""Decimals of a duration: motions last whole milliseconds."""


@dataclass(frozen=True, slots=True)
class FolderVerdict:
    """Result of verifying a folder.

    Attributes:
        report: the new report.
        driver_profile: name of the drivers on the board, from the stored report.
        tampered: one line for each sign that the files were changed after the run.
        fault: the fault that ended the run, from the stored report; None if the run came to its end.
        interruption: end of a recording without an end, which cannot pass; None if it has one.
        noted: reasons that only the stored report knows: of a capture, those seen in the logic analyser's file.
        simulated: False for a capture of a real controller.
        kept: what features keep of the stored report, by key.
        stop: stop of a live board's machine since its motion began, which cannot pass; None without one.
        of_other_runs: files that differ from the stored report's digests: changed, or of another run.
    """

    report: Report
    driver_profile: str
    tampered: tuple[str, ...]
    fault: Mapping[str, Any] | None
    interruption: str | None = None
    noted: tuple[str, ...] = ()
    simulated: bool = True
    kept: Mapping[str, Any] = field(default_factory=dict)
    of_other_runs: tuple[str, ...] = ()
    stop: MachineStop | None = None

    @property
    def reasons(self) -> tuple[str, ...]:
        """One line for each reason why the folder fails."""
        interrupted = () if self.interruption is None else (self.interruption,)
        stopped = () if self.stop is None else (f"was {self.stop}",)
        told = interrupted + stopped + self.tampered + self.noted + self.report.reasons
        return told if told or not self.of_other_runs else (mixture(self.of_other_runs),)

    @property
    def passed(self) -> bool:
        """True if the run passed and was complete, and the folder is unchanged."""
        return not self.reasons and self.fault is None


def mixture(files: Sequence[str]) -> str:
    """Return a line about files that differ from the report's digests."""
    are = f"{files[0]} is not the file" if len(files) == 1 else f"{', '.join(files)} are not the files"
    return f"{are} with which {REPORT} was written: changed since, or of another run"


def verify_folder(folder: Path, plan_folder: Path | None = None) -> FolderVerdict:
    """Verify a stored run against its own plan, or against that of `plan_folder`.

    Raises:
        InputError: a file is missing or unreadable (the message names file and key), or `plan_folder` must not replace
            the folder's own plan.
        ContradictionError: the files contradict themselves or each other.
    """
    stored = read_run(folder, plan_folder)
    report = verify_comparison(stored.comparison, stored.report.run)
    inner = [line for axis in stored.comparison.evidence.axes for line in contradictions(axis)]
    for name, seen in stored.comparison.evidence.features.items():
        inner += judge_of(name).contradictions(seen, stored.comparison)
    tampered = (*inner, *_after_the_end(stored), *_frames_missing(folder, stored), *_differences(stored, report))
    interruption = stored.interruption
    if interruption and not (tampered or report.reasons):
        interruption += "; so far it is right"
    said = stored.report
    return FolderVerdict(
        report,
        said.driver_profile,
        tampered,
        said.fault,
        interruption,
        _noted(said),
        simulated=said.capture is None,
        kept=said.kept,
        of_other_runs=of_other_runs(folder, said.document),
        stop=said.stop,
    )


def _noted(said: StoredReport) -> tuple[str, ...]:
    """Return the reasons that only the stored report knows."""
    return said.capture.reasons if said.capture else ()


def _after_the_end(stored: StoredRun) -> list[str]:
    """Return a line for each axis with an edge after the run's end; a live board's recording may be longer."""
    if stored.report.passed is None:
        return []
    end_s = stored.report.run.simulated_s
    lasts_s = ((axis.name, axis.last_counts / COUNTS_PER_SECOND) for axis in stored.comparison.evidence.axes)
    return [
        f"{name}: an edge at {last_s:.3f} s since power-up, but {REPORT} says simulated_s = {end_s:.3f}"
        for name, last_s in lasts_s
        if last_s > end_s + _END_S
    ]


def _frames_missing(folder: Path, stored: StoredRun) -> list[str]:
    """Return a line if the bus log has another number of frames than the report.

    A recording without an end may have more after its last mark.
    """
    frames = count_frames(existing_file(folder, BUS_LOG))
    said = stored.report.run.bus.frames
    if stored.report.recording and frames > said:
        return []
    return [] if frames == said else [f"{REPORT} says bus.frames = {said}, {BUS_LOG} has {frames}"]


def _differences(stored: StoredRun, report: Report) -> list[str]:
    """Return a line for each figure of the report that contradicts the files; a live board's report has no verdict."""
    if stored.report.passed is None:
        return []
    given, said = report.to_dict(), stored.report
    passed = report.passed and said.fault is None and not _noted(said)
    pairs: list[tuple[str, Any, Any]] = [
        ("passed", said.passed, passed),
        ("duration_s", said.run.duration_s, round(stored.duration_s, _MS)),
        ("axes", len(said.axes), len(given["axes"])),
        *((each.name, said.document.get(each.name), given.get(each.name)) for each, _ in giving("judge")),
        ("speeds", said.document.get("speeds"), given.get("speeds")),
    ]
    exact = [key for key, figure in axis_figures().items() if figure.exact]
    for axis, figures in zip(given["axes"], said.axes, strict=False):
        pairs += [(f"{axis['name']}.{key}", figures.get(key), axis[key]) for key in exact]
    return [f"{REPORT} says {key} = {old}, the files give {new}" for key, old, new in pairs if old != new]
