"""`steptwin verify DIR`: verify a stored run again, from its files alone."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, naming_options
from steptwin.host.cli.output import tell
from steptwin.host.cli.run.verdict_text import EXIT_NOT_VERIFIED, fault_line, print_report
from steptwin.host.common.errors import DeviceFaultError, NotVerifiedError

if TYPE_CHECKING:
    from steptwin.host.record.folder import FolderVerdict

RunDir = Annotated[
    Path,
    typer.Argument(metavar="DIR", help="Folder written by `steptwin run --out` or `steptwin serve --out`."),
]

PlanDir = Annotated[
    Path | None,
    typer.Option("--plan", metavar="DIR", help="For a live board's folder: folder of the run with its plan."),
]


@command("out/drawer-pull", "out/live --plan out/virtual")
def verify(
    folder: RunDir,
    plan: PlanDir = None,
    as_json: AsJson = False,
) -> None:
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
    tell(document, lambda: print_report(document), as_json=as_json)
    if "fault" in document:
        raise DeviceFaultError(fault_line(document["fault"]))
    if not document["passed"]:
        raise typer.Exit(EXIT_NOT_VERIFIED)


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
