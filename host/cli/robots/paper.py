"""`steptwin paper ROBOT --out DIR`: go through a robot's paper, item by item, with our numbers beside its own."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, Replace, keep_files, out_folder
from steptwin.host.cli.output import print_table, say, say_no_pictures, tell
from steptwin.host.cli.run.verdict_text import EXIT_NOT_VERIFIED
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.studies.papers import EvaluatedPaper


@command("warehouse-scara --out out/warehouse", "lab-scara --json")
def paper(
    robot: Annotated[
        str | None, typer.Argument(metavar="ROBOT", help="Name of one of the robots that come with StepTwin.")
    ] = None,
    out: Annotated[
        str | None, typer.Option(metavar="DIR", help="Folder to write the page into: Markdown, pictures, HTML.")
    ] = None,
    replace: Replace = False,
    as_json: AsJson = False,
) -> None:
    """Go through the paper of a robot, item by item: its numbers, ours, and its misprints as printed and corrected.

    The robot's jobs are run for it. The exit code is 1 if a number does not agree.
    """
    from steptwin.host.studies.papers import Runs, evaluated, paper_files, paper_of, write_paper

    if robot is None:
        raise InputError("ROBOT is missing: the robot whose paper it is")
    chosen = paper_of(robot)
    folder = out_folder(out, paper_files(chosen))
    if folder is not None:
        keep_files((folder / name for name in paper_files(chosen)), replace=replace)
    runs = Runs()
    page = evaluated(chosen, runs)
    pictures = folder is not None and write_paper(folder, page, runs)
    tell(page.to_dict(), lambda: _print_page(page), as_json=as_json)
    if folder is not None:
        _say_where(folder, robot, pictures=pictures, to_stderr=as_json)
    for line in page.disagreements:
        say(line, err=True)
    if not page.agrees:
        raise typer.Exit(EXIT_NOT_VERIFIED)


def _print_page(page: "EvaluatedPaper") -> None:
    from steptwin.host.studies.papers.paper_page import number_text, summary

    say(page.paper.citation)
    values = [
        [one.value.place or "-", one.value.kind, one.value.what, f"{one.value.expected:g}",
         number_text(one.ours, one.value.decimals), one.value.unit, "yes" if one.agrees else "NO"]
        for one in page.values
        if one.value.expected is not None
    ]  # fmt: skip
    columns = ["the paper's place", "kind", "quantity", "paper", "ours", "unit", "agrees"]
    print_table(columns, values, text_columns=3)
    formulas = [
        [erratum.erratum.place, one.formula.what,
         *(number_text(number, one.formula.decimals) for number in (one.printed, one.corrected, one.truth)),
         one.formula.unit]
        for item in page.items
        for erratum in item.errata
        for one in erratum.formulas
    ]  # fmt: skip
    columns = ["misprint", "computed", "as printed", "corrected", "has to be", "unit"]
    print_table(columns, formulas, text_columns=2)
    say(*summary(page))


def _say_where(folder: Path, robot: str, *, pictures: bool, to_stderr: bool) -> None:
    from steptwin.host.studies.papers.paper_page import html_name, page_name

    what = "page and pictures are" if pictures else "page is"
    say(f"{what} in {folder}/: {page_name(robot)}, {html_name(robot)}", err=to_stderr)
    if not pictures:
        say_no_pictures()
