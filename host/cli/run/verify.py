"""`steptwin verify DIR`: verify a stored run from its files alone."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from steptwin.host.cli.app import command, end_unless
from steptwin.host.cli.arguments import AnswerOptions
from steptwin.host.cli.options import argument, given_options, naming_options, of_features, option
from steptwin.host.cli.output import warn
from steptwin.host.cli.run.hooks import tellings
from steptwin.host.cli.run.verdict_text import fault_line, print_report
from steptwin.host.common.errors import DeviceFaultError, InputError, NotVerifiedError

if TYPE_CHECKING:
    from steptwin.host.record.folder import FolderVerdict


class OtherEvidence(Protocol):
    """A feature's options of `steptwin verify` for evidence other than a run's folder."""

    @property
    def usage(self) -> str:
        """Option that names the evidence, with the placeholder of its value."""
        ...

    @property
    def source(self) -> str | None:
        """Option with its value; None if it is not given."""
        ...

    def verify(self, answer: AnswerOptions, plan: Path | None) -> bool:
        """Verify the evidence against a plan, and print the answer; return whether it has passed."""
        ...


@dataclass(frozen=True, slots=True)
class EvidenceOptions:
    """Evidence that features verify besides the folders of runs."""

    others: Sequence[OtherEvidence] = of_features("verify_options")

    def chosen(self) -> OtherEvidence | None:
        """Return the named evidence; None for a folder. Raise InputError for an option without its evidence."""
        for other in self.others:
            if other.source is not None:
                return other
            if alone := next(iter(given_options(other)), None):
                raise InputError(f"{alone}: is for {other.usage}")
        return None


@command("out/pick", "out/live --plan out/pick")
def verify(
    evidence: EvidenceOptions,
    answer: AnswerOptions,
    folder: Path | None = argument("[DIR]", "Folder written by `steptwin run --out` or `steptwin serve --out`."),
    plan: Path | None = option(
        "DIR|'ROBOT JOB'", "Folder of the run with the plan of a live board's folder or of other evidence; or its job."
    ),
) -> None:
    """Verify a stored run again: same verdict and exit code as the run, or 1 if its files were changed.

    Of a run with a scenario it judges the motion alone: where a fault has stopped it as documented, the exit code is 3.
    A live board's recording that was interrupted is verified as far as it goes, with exit code 1, as is one whose
    machine was stopped.
    """
    other = evidence.chosen()
    if other is not None:
        if folder is not None:
            raise InputError(f"DIR {folder} and {other.source}: give only one of them")
        end_unless(other.verify(answer, plan))
    elif folder is None:
        choices = ["the folder of a run", *(each.usage for each in evidence.others)]
        raise InputError(f"DIR is missing: {', or '.join(choices)}")
    else:
        _verify_folder(answer, folder, plan)


def _verify_folder(answer: AnswerOptions, folder: Path, plan: Path | None) -> None:
    from steptwin.host.record.folder import ContradictionError, StoppedError, digests, mixture, verify_folder

    try:
        with naming_options(plan_folder="--plan"):
            verdict = verify_folder(folder, plan)
    except (ContradictionError, StoppedError) as error:
        raise NotVerifiedError(str(error)) from error
    document = _document(verdict) | digests(folder)
    if verdict.of_other_runs:
        document["of_other_runs"] = list(verdict.of_other_runs)
        if mixture(verdict.of_other_runs) not in verdict.reasons:
            warn(mixture(verdict.of_other_runs))

    def tell() -> None:
        print_report(document)
        for each in tellings():
            each.print_verified(document)

    answer.tell(document, tell)
    if "fault" in document:
        raise DeviceFaultError(fault_line(document["fault"]))
    end_unless(document["passed"])


def _document(verdict: "FolderVerdict") -> dict[str, Any]:
    """Return the document of `run --json`; a changed folder is no evidence of a fault."""
    from steptwin.host.record.folder import stop_document

    document = verdict.report.to_dict()
    document |= {"passed": verdict.passed, "reasons": list(verdict.reasons)}
    document |= {"driver_profile": verdict.driver_profile, "simulated": verdict.simulated}
    if verdict.stop is not None:
        document["stopped"] = stop_document(verdict.stop)
    if verdict.interruption is not None:
        document["interruption"] = verdict.interruption
    if verdict.fault is not None and not (verdict.tampered or verdict.of_other_runs):
        document["fault"] = dict(verdict.fault)
    document |= verdict.kept
    return document
