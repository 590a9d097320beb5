"""Result of a run on an embedded board: verdict, evidence, bus log, and the fault that ended it, if any."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

from steptwin.host.common.errors import BusError, DeviceFaultError, StepTwinError
from steptwin.host.common.features import judge_of
from steptwin.host.operate.inputs_outputs import waits_document
from steptwin.host.planning.motion import Wait
from steptwin.host.planning.plan import Plan
from steptwin.host.record.folder import FOLDER_VERSION, VERSION_KEY, keep_recording, prepare_folder, write_folder
from steptwin.host.record.folder.writing import can_draw, draw_pictures
from steptwin.host.twin.machine.boards import crystals_document
from steptwin.host.verify import Comparison, Evidence, Report
from steptwin.host.verify.figures import judged_document
from steptwin.protocol.frame import Frame


@dataclass(frozen=True, slots=True)
class RunFault:
    """A fault of a drive, or a time-out of a wait, that ended a run.

    Attributes:
        message: axis and error.
        codes: every axis' EMCY error codes, oldest first.
        joints: joint positions by the drives' own count, in mm and degrees.
        positions_agree: True if the drivers' counts are equal.
        timed_out: True if no drive failed, but a wait for an input timed out.
    """

    message: str
    codes: dict[str, list[int]]
    joints: dict[str, float]
    positions_agree: bool
    timed_out: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Return the fault under the keys of report.json."""
        return {
            "message": self.message,
            "codes": {name: [f"0x{code:04X}" for code in codes] for name, codes in self.codes.items()},
            "joints": self.joints,
            "positions_agree": self.positions_agree,
            **({"timed_out": True} if self.timed_out else {}),
        }


@dataclass(frozen=True, slots=True)
class RunEnd:
    """End of a run.

    Attributes:
        evidence: the drivers' counted steps.
        stopped: True if the motion ended early.
        ended_s: time of the motion at its end.
        reasons: why the drivers' counts differ from the plan; empty if they do not, or if the motion stopped.
        not_begun: message that no motion began, and why; empty if one did.
    """

    evidence: Evidence
    stopped: bool
    ended_s: float
    reasons: Sequence[str] = ()
    not_begun: str = ""


class RunVerdict(Protocol):
    """Verdict of a feature on a run that it has acted on; replaces the run's own verdict."""

    @property
    def passed(self) -> bool:
        """True if everything was as it should be."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict under keys of report.json."""
        ...


class NotBegunError(StepTwinError):
    """No motion began.

    Attributes:
        verdicts: verdicts of features on the run until then, by name.
    """

    verdicts: Mapping[str, RunVerdict]

    def to_dict(self) -> dict[str, Any]:
        """Return the verdicts under the keys of report.json."""
        return merged_documents(self.verdicts)


class SilentStartError(NotBegunError, BusError):
    """No node answered the host."""


class FaultyStartError(NotBegunError, DeviceFaultError):
    """A drive had a fault, or refused a request of the host."""


def not_begun(error: BusError | DeviceFaultError, verdicts: Mapping[str, RunVerdict]) -> NotBegunError:
    """Return the error about a motion that another error has prevented."""
    kind = SilentStartError if isinstance(error, BusError) else FaultyStartError
    made = kind(str(error)).plainly(error.plain)
    made.verdicts = verdicts
    return made


def merged_documents(verdicts: Mapping[str, RunVerdict]) -> dict[str, Any]:
    """Merge the documents of verdicts, under the keys of report.json."""
    return {key: value for each in verdicts.values() for key, value in each.to_dict().items()}


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a run.

    Attributes:
        plan: the motion that was run.
        comparison: plan and drivers' counts.
        report: figures and verdict.
        bus_log: every frame with the instant when it became valid, in counts since power-up.
        fault: fault that ended the run; None if it was complete.
        driver_profile: name of the board's drivers.
        waits: waits for inputs; the plan includes their standstills, and ends with one that timed out.
        verdicts: verdicts of features that acted on the run, by name.
        operations: operations on the machine as requests of the control port, each with its instant `at_s` since
            power-up.
        axes_per_board: number of axes on each of several boards; empty: one board had all.
        crystals_ppm: deviation of each board's crystal, in parts per million; empty: all were exact.
        late_reasons: reasons of the report that features have found after the run; no scenario excuses them.
    """

    plan: Plan
    comparison: Comparison
    report: Report
    bus_log: list[tuple[int, Frame]]
    fault: RunFault | None
    driver_profile: str
    waits: tuple[Wait, ...] = ()
    verdicts: Mapping[str, RunVerdict] = field(default_factory=dict)
    operations: tuple[Mapping[str, Any], ...] = ()
    axes_per_board: tuple[int, ...] = ()
    crystals_ppm: tuple[int, ...] = ()
    late_reasons: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """True if the run was complete, every pulse is as planned, and no feature has a reason against it."""
        return self.fault is None and self.report.passed

    @property
    def right(self) -> bool:
        """True if every pulse is as planned; with verdicts of features, if these are passed."""
        return all(each.passed for each in self.verdicts.values()) if self.verdicts else self.report.passed

    def with_feature(self, name: str, seen: Any) -> "Outcome":
        """Return the outcome with a feature's evidence after the run, in place of earlier evidence."""
        comparison, report, judge = self.comparison, self.report, judge_of(name)
        evidence, planned = comparison.evidence, comparison.expected.features.get(name)
        before = evidence.features.get(name)
        old = [] if before is None else judge.reasons(before, planned, evidence.start_counts)
        new = judge.reasons(seen, planned, evidence.start_counts)
        return replace(
            self,
            comparison=replace(comparison, evidence=replace(evidence, features={**evidence.features, name: seen})),
            report=replace(
                report,
                reasons=(*(each for each in report.reasons if each not in old), *new),
                features={
                    **report.features,
                    name: judged_document(name, seen, evidence.start_counts, comparison.axis_names),
                },
            ),
            late_reasons=(*(each for each in self.late_reasons if each not in old), *new),
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the document of `steptwin run --json`."""
        document = self.report.to_dict() | {"driver_profile": self.driver_profile, "simulated": True}
        document |= waits_document(self.waits) | crystals_document(self.crystals_ppm)
        if self.axes_per_board:
            document["boards"] = list(self.axes_per_board)
        if self.operations:
            document["operations"] = list(self.operations)
        if self.fault:
            document |= {"passed": False, "fault": self.fault.to_dict()}
        return document | merged_documents(self.verdicts)

    def save(self, folder: Path | str) -> bool:
        """Write report, plan, every edge, bus log, waveform and pictures into a folder (docs/run-folder.md).

        Another run's files are replaced, those of a live board's recording are not.

        Returns:
            False if the pictures were left out because matplotlib is not installed.

        Raises:
            InputError: the folder has the recording of a live board, cannot be created, or is not writable.
            OSError: a file cannot be written.
        """
        keep_recording(folder)
        path = prepare_folder(folder)
        document = self.to_dict() | {VERSION_KEY: FOLDER_VERSION}
        comparison = self.comparison
        write_folder(path, document, self.plan, comparison.evidence, self.bus_log, comparison.expected.features)
        drawn = can_draw()
        if drawn:
            draw_pictures(path)
        return drawn
