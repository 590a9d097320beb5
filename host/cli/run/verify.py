"""`steptwin verify DIR`: verify a stored run again, from its files alone, or a capture of a real controller."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from steptwin.host.cli.app import command, end_unless
from steptwin.host.cli.arguments import AnswerOptions
from steptwin.host.cli.options import argument, naming_options, option
from steptwin.host.cli.run.captured import CaptureOptions, no_folder, verify_capture
from steptwin.host.cli.run.verdict_text import fault_line, print_report
from steptwin.host.common.errors import DeviceFaultError, InputError, NotVerifiedError

if TYPE_CHECKING:
    from steptwin.host.record.folder import FolderVerdict


@command("out/drawer-pull", "--capture night.sr --plan out/carry")
def verify(
    captured: CaptureOptions,
    answer: AnswerOptions,
    folder: Path | None = argument("[DIR]", "Folder written by `steptwin run --out` or `steptwin serve --out`."),
    plan: Path | None = option(
        "DIR|'ROBOT JOB'", "Folder of the run with the plan of a live board's folder or a capture; or its job's name."
    ),
) -> None:
    """Verify a stored run again: same verdict and exit code as the run, or 1 if its files were changed.

    A live board's recording that was interrupted is verified as far as it goes, with exit code 1. With --capture,
    verify what a logic analyser has recorded at the drivers of any controller.
    """
    if captured.capture is not None:
        if folder is not None:
            raise InputError(f"DIR {folder} and --capture {captured.capture}: give only one of them")
        verify_capture(answer, captured, plan)
        return
    captured.refuse()
    _verify_folder(answer, folder or no_folder(), plan)


def _verify_folder(answer: AnswerOptions, folder: Path, plan: Path | None) -> None:
    from steptwin.host.record.folder import ContradictionError, verify_folder

    try:
        with naming_options(plan_folder="--plan"):
            verdict = verify_folder(folder, plan)
    except ContradictionError as error:
        raise NotVerifiedError(str(error)) from error
    document = _document(verdict)
    answer.tell(document, lambda: print_report(document))
    if "fault" in document:
        raise DeviceFaultError(fault_line(document["fault"]))
    end_unless(document["passed"])


def _document(verdict: "FolderVerdict") -> dict[str, Any]:
    """Return the document as `run --json` prints it; a changed folder is not evidence of a fault."""
    document = verdict.report.to_dict()
    document |= {"passed": verdict.passed, "reasons": list(verdict.reasons)}
    document |= {"driver_profile": verdict.driver_profile, "simulated": verdict.simulated}
    if verdict.interruption is not None:
        document["interruption"] = verdict.interruption
    if verdict.fault is not None and not verdict.tampered:
        document["fault"] = dict(verdict.fault)
    return document
