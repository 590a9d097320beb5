"""A stored run judged again: from its files alone, and its report held against what the files give."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from steptwin.host.record.bus_log import count_frames
from steptwin.host.record.folder.layout import BUS_LOG, REPORT, existing
from steptwin.host.record.folder.reading import StoredRun, read_run
from steptwin.host.verify import Report, contradictions, verify_comparison

_OF_THE_EDGES: Final = (
    "name", "steps_start", "steps_end", "pulses", "reversals", "peak_rate_hz", "clk_high_us_min", "clk_low_us_min",
    "violations", "mean_step_interval_us", "active_edge",
)  # fmt: skip
"""Figures that follow from the edges alone, so that they come out again to the last digit."""

_MS: Final = 3
"""Decimals of a duration: motions last whole milliseconds."""


@dataclass(frozen=True, slots=True)
class FolderVerdict:
    """What verifying a folder gives.

    Attributes:
        report: computed anew.
        driver_profile: which drivers the board had, as its report says.
        tampered: why the folder is not as a run left it, one line each.
        fault: what ended the run, as its report says; None if it came to its end.
    """

    report: Report
    driver_profile: str
    tampered: tuple[str, ...]
    fault: Mapping[str, Any] | None

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why it fails, whatever the cause."""
        return self.tampered + self.report.reasons

    @property
    def passed(self) -> bool:
        """Whether the run was right, came to its end, and the folder is as the run left it."""
        return not self.reasons and self.fault is None


def verify_folder(folder: Path, plan_folder: Path | None = None) -> FolderVerdict:
    """Verify a stored run against its own plan, or against that of `plan_folder`.

    Raises:
        InputError: a file is missing or cannot be read, the message names file and key; or `plan_folder` must not
            replace the folder's own plan.
        ContradictionError: the files do not go together.
    """
    stored = read_run(folder, plan_folder)
    report = verify_comparison(stored.comparison, stored.report.run)
    inner = [line for axis in stored.comparison.evidence.axes for line in contradictions(axis)]
    tampered = (*inner, *_frames_missing(folder, stored), *_differences(stored, report))
    return FolderVerdict(report, stored.report.driver_profile, tampered, stored.report.fault)


def _frames_missing(folder: Path, stored: StoredRun) -> list[str]:
    """Whether the bus log has as many frames as the report says."""
    frames = count_frames(existing(folder, BUS_LOG))
    said = stored.report.run.bus.frames
    return [] if frames == said else [f"{REPORT} says bus.frames = {said}, {BUS_LOG} has {frames}"]


def _differences(stored: StoredRun, report: Report) -> list[str]:
    """Where report.json says something else than the files give; a live board's does not say what was planned."""
    if stored.report.passed is None:
        return []
    given, said = report.to_dict(), stored.report
    passed = report.passed and said.fault is None
    pairs: list[tuple[str, Any, Any]] = [
        ("passed", said.passed, passed),
        ("duration_s", said.run.duration_s, round(stored.duration_s, _MS)),
        ("axes", len(said.axes), len(given["axes"])),
    ]
    for axis, figures in zip(given["axes"], said.axes, strict=False):
        pairs += [(f"{axis['name']}.{key}", figures.get(key), axis[key]) for key in _OF_THE_EDGES]
    return [f"{REPORT} says {key} = {old}, the files give {new}" for key, old, new in pairs if old != new]
