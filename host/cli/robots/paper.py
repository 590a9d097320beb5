"""`steptwin paper ROBOT --out DIR`: go through a robot's paper, item by item, with our numbers beside its own."""

from typing import TYPE_CHECKING

from steptwin.host.cli.app import command, end_unless
from steptwin.host.cli.arguments import AnswerOptions, Replace, keep_files, out_folder
from steptwin.host.cli.options import argument, option
from steptwin.host.cli.output import Columns, print_rows, say
from steptwin.host.common.errors import InputError
from steptwin.host.common.whole_file import files_together

if TYPE_CHECKING:
    from steptwin.host.studies.papers import EvaluatedPaper


@command("warehouse-scara --out out/warehouse", "lab-scara --json")
def paper(
    answer: AnswerOptions,
    robot: str | None = argument("ROBOT", "Name of one of the robots that come with StepTwin."),
    out: str | None = option("DIR", "Folder to write the page into: Markdown, pictures, HTML."),
    replace: Replace = False,
) -> None:
    """Go through the paper of a robot, item by item: its numbers, ours, and its misprints as printed and corrected.

    The robot's jobs are run for it. The exit code is 1 if a number does not agree.
    """
    from steptwin.host.studies.papers import Runs, evaluated, paper_files, paper_of, write_paper
    from steptwin.host.studies.papers.paper_page import html_name, page_name

    if robot is None:
        raise InputError("ROBOT is missing: the robot whose paper it is")
    chosen = paper_of(robot)
    folder = None if out is None else out_folder(out, paper_files(chosen))
    if folder is not None:
        keep_files((folder / name for name in paper_files(chosen)), replace=replace)
    runs = Runs()
    page = evaluated(chosen, runs)
    pictures = False
    if folder is not None:
        with files_together(folder, stale=paper_files(chosen)) as parts:
            pictures = write_paper(parts, page, runs)
    answer.tell(page.to_dict(), lambda: _print_page(page))
    if folder is not None:
        what = "page and pictures are" if pictures else "page is"
        answer.add_files(what, folder, page_name(robot), html_name(robot), pictures=pictures)
    say(*page.disagreements, err=True)
    end_unless(page.agrees)


def _print_page(page: "EvaluatedPaper") -> None:
    from steptwin.host.studies.papers.paper_page import number_text, summary

    say(page.paper.citation)
    values: Columns = {
        "the paper's place": lambda one: one.value.place or "-",
        "kind": "{0.value.kind}",
        "quantity": "{0.value.what}",
        "paper": "{0.value.expected:g}",
        "ours": lambda one: number_text(one.ours, one.value.decimals),
        "unit": "{0.value.unit}",
        "agrees": lambda one: "yes" if one.agrees else "NO",
    }
    print_rows(values, [one for one in page.values if one.value.expected is not None], text_columns=3)
    formulas: Columns = {
        "misprint": "{0.erratum.place}",
        "computed": "{0.formula.what}",
        "as printed": lambda one: number_text(one.numbers.printed, one.formula.decimals),
        "corrected": lambda one: number_text(one.numbers.corrected, one.formula.decimals),
        "has to be": lambda one: number_text(one.numbers.truth, one.formula.decimals),
        "unit": "{0.formula.unit}",
    }
    print_rows(formulas, page.proofs, text_columns=2)
    say(*summary(page))
