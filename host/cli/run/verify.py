"""`steptwin verify DIR`: verify a stored run again, from its files alone."""

from typing import TYPE_CHECKING, Any

from steptwin.host.cli.app import command, end_unless
from steptwin.host.cli.arguments import AnswerOptions, PlanDir, RunDir
from steptwin.host.cli.options import naming_options
from steptwin.host.cli.run.verdict_text import fault_line, print_report
from steptwin.host.common.errors import DeviceFaultError, NotVerifiedError

if TYPE_CHECKING:
    from steptwin.host.record.folder import FolderVerdict


@command("out/drawer-pull", "out/live --plan out/virtual")
def verify(answer: AnswerOptions, folder: RunDir, plan: PlanDir = None) -> None:
    """Verify a stored run again: same verdict and exit code as the run, or 1 if its files were changed.

    A live board's recording that was interrupted is verified as far as it goes, with exit code 1.
    """
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
    document |= {"driver_profile": verdict.driver_profile, "simulated": True}
    if verdict.interruption is not None:
        document["interruption"] = verdict.interruption
    if verdict.fault is not None and not verdict.tampered:
        document["fault"] = dict(verdict.fault)
    return document
