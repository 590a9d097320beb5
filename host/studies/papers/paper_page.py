"""Render a computed paper as a page in Markdown."""

from collections.abc import Iterator, Sequence
from math import isfinite, nan
from typing import Any, Final

from steptwin.host.studies.papers.evaluation import Compared, Computed, EvaluatedErratum, EvaluatedItem, EvaluatedPaper
from steptwin.host.studies.papers.paper import Erratum, Paper, Picture


def table(columns: Sequence[str], rows: Sequence[Sequence[str]], *, text_columns: int = 1) -> str:
    """Return a table whose first `text_columns` columns are texts and the others numbers."""
    rule = ["---"] * text_columns + ["--:"] * (len(columns) - text_columns)
    return "\n".join(_line(cells) for cells in (columns, rule, *rows))


def code(text: str) -> str:
    """Return a block of literal text."""
    return f"```\n{text}\n```"


def _line(cells: Sequence[str]) -> str:
    escaped = (cell.replace("|", "\\|") for cell in cells)
    return f"| {' | '.join(escaped)} |"


_HOW_TO_READ: Final = (
    "Each number of ours is computed when the page is made. A difference is ours minus the paper's. The paper's number"
    " is stated in it, derived from what it states, or read off a figure. The page was written from notes of what"
    " the paper states, without its text at hand: where it says that the paper has no number, the notes have none, and"
    " parts of the paper whose number the notes lack are named by what they are about."
)

_COMPARED: Final = ("quantity", "the paper's is", "paper", "ours", "difference", "tolerance", "agrees")


def page_name(robot: str) -> str:
    """Return the name of a robot's page in Markdown."""
    return f"{robot}.md"


def html_name(robot: str) -> str:
    """Return the name of a robot's page in HTML."""
    return f"{robot}.html"


def picture_name(robot: str, picture: "Picture[Any]") -> str:
    """Return the name of a picture's file; all of a robot's begin with its name, so that papers can share a folder."""
    return f"{robot}-{picture.name}.png"


def render_page(paper: EvaluatedPaper, *, with_pictures: bool = True) -> str:
    """Return the whole page; it ends with a newline."""
    robot = paper.paper.robot
    blocks = [
        f"<!-- Made by `steptwin paper {robot}`. -->",
        f"# The paper of {robot}, figure by figure",
        f"> {paper.paper.citation}",
        " ".join(summary(paper)),
        _HOW_TO_READ,
        *(block for item in paper.items for block in _item(item, robot, with_pictures=with_pictures)),
    ]
    return "\n\n".join(block for block in blocks if block) + "\n"


def errata_table(paper: Paper[Any]) -> str:
    """Return a table of a paper's mistakes in words."""
    return _errata_table(paper.errata)


def _errata_table(errata: tuple[Erratum[Any], ...]) -> str:
    rows = [[erratum.place, erratum.printed, erratum.right, erratum.found] for erratum in errata]
    return table(["place", "printed", "right", "how it was found"], rows, text_columns=4)


def summary(paper: EvaluatedPaper) -> tuple[str, str]:
    """Return a sentence about the numbers compared and one about the mistakes."""
    compared = [value for value in paper.values if value.agrees is not None]
    agree = sum(value.agrees is True for value in compared)
    proven = sum(formula.proven for formula in paper.formulas)
    return (
        f"Numbers of the paper compared with ours: {len(compared)}; that agree: {agree}.",
        f"Mistakes in the paper: {len(paper.paper.errata)}; quantities computed as printed and as corrected:"
        f" {len(paper.formulas)}; where only the corrected one is right: {proven}.",
    )


def _item(item: EvaluatedItem, robot: str, *, with_pictures: bool) -> Iterator[str]:
    yield f"## {item.item.place}: {item.item.title}"
    yield item.item.text
    if item.item.not_comparable:
        yield f"**Not comparable:** {item.item.not_comparable}"
    compared = [value for value in item.values if value.agrees is not None]
    if compared:
        yield table(_COMPARED, [_compared(value) for value in compared], text_columns=2)
    alone = [value for value in item.values if value.agrees is None]
    if alone:
        yield table(["quantity without a number in the paper", "ours"], [[one.value.what, _ours(one)] for one in alone])
    for listing, rows in zip(item.item.listings, item.listings, strict=True):
        yield f"{listing.title}:"
        yield table(listing.columns, rows, text_columns=listing.text_columns)
    if item.errata:
        yield "Mistakes of the paper here:"
        yield _errata_table(item.item.errata)
        yield from _formulas(item.errata)
    if with_pictures:
        for picture in item.item.pictures:
            yield f"![{picture.caption}]({picture_name(robot, picture)})"


def _compared(one: Compared) -> list[str]:
    value = one.value
    paper, difference = (nan if number is None else number for number in (value.paper, one.difference))
    return [
        value.what,
        value.source,
        f"{paper:.12g}{_unit(value.unit)}",
        _ours(one),
        number_text(difference, value.decimals),
        f"{value.tolerance:g}",
        "yes" if one.agrees else "NO",
    ]


def _ours(one: Compared) -> str:
    return f"{number_text(one.ours, one.value.decimals)}{_unit(one.value.unit)}"


def _unit(unit: str) -> str:
    return f" {unit}" if unit else ""


def _formulas(errata: tuple[EvaluatedErratum, ...]) -> Iterator[str]:
    rows = [_formula(one.erratum.place, formula) for one in errata for formula in one.formulas]
    if rows:
        columns = ["computed", "compared with", "as printed", "as corrected", "has to be"]
        yield table(columns, rows, text_columns=2)


def _formula(place: str, one: Computed) -> list[str]:
    formula = one.formula
    numbers = [
        f"{number_text(number, formula.decimals)}{_unit(formula.unit) if isfinite(number) else ''}"
        for number in (one.printed, one.corrected, one.truth)
    ]
    return [f"{place}: {formula.what}", formula.truth_from, *numbers]


def number_text(number: float, decimals: int) -> str:
    """Return a number without a sign if it rounds to 0; a formula that has no value here has none."""
    return f"{number:z.{decimals}f}" if isfinite(number) else "no value"
