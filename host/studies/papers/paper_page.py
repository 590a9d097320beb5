"""Render a computed paper as a page in Markdown."""

from collections.abc import Iterator, Sequence
from math import isfinite, nan
from typing import Final

from steptwin.host.studies.papers.evaluation import Compared, EvaluatedItem, EvaluatedPaper, Proof
from steptwin.host.studies.papers.paper import Basis, Coverage, Erratum, Gap, Item, Paper, Picture, Source


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
    "Each number of ours is computed when the page is made; a difference is ours minus the paper's. The paper's numbers"
    " carry their place in it, and are stated there unless the place says that they follow from what it states or are"
    " read off a figure. Only results compare the paper with the twin: dimensions are taken over, and self-checks hold"
    " the twin against itself."
)

_COLUMNS: Final = {
    Basis.DIMENSION: {"dimension taken over": "what", "place": "place", "paper": "has", "ours": "ours",
                      "agrees": "agrees"},
    Basis.RESULT: {"result": "what", "place": "place", "paper": "has", "ours": "ours", "difference": "difference",
                   "tolerance": "tolerance", "agrees": "agrees"},
    Basis.CHECK: {"self-check": "what", "has to be": "has", "ours": "ours", "tolerance": "tolerance",
                  "holds": "agrees"},
    Basis.ALONE: {"quantity without a number in the paper": "what", "ours": "ours"},
}  # fmt: skip
"""The columns of a table for each kind of value, each with the name of its cells."""


def page_name(robot: str) -> str:
    """Return the name of a robot's page in Markdown."""
    return f"{robot}.md"


def html_name(robot: str) -> str:
    """Return the name of a robot's page in HTML."""
    return f"{robot}.html"


def picture_name(robot: str, picture: Picture) -> str:
    """Return the name of a picture's file; all of a robot's begin with its name, so that papers can share a folder."""
    return f"{robot}-{picture.name}.png"


def render_page(paper: EvaluatedPaper, *, with_pictures: bool = True) -> str:
    """Return the whole page; it ends with a newline."""
    robot = paper.paper.robot
    blocks = [
        f"<!-- Made by `steptwin paper {robot}`. -->",
        f"# The paper of {robot}, item by item",
        f"> {paper.paper.citation}",
        "\n".join(f"- {line}" for line in summary(paper)),
        _HOW_TO_READ,
        "## What of the paper is here",
        contents_table(paper.paper),
        *(block for item in paper.items for block in _item(item, robot, with_pictures=with_pictures)),
        *_gaps("What the paper leaves open", "what is open", "here", paper.paper.left_open),
        *_gaps("What our copy of the paper lacks", "what is lost", "here instead", paper.paper.lost),
    ]
    return "\n\n".join(block for block in blocks if block) + "\n"


def contents_table(paper: Paper) -> str:
    """Return the list of the paper's parts, each with the section of the page that has it, and the answer."""
    rows = [
        [part.place, part.what, f"[{item.place}](#{anchor(heading(item))}): {part.how}", part.answer, part.why]
        for item in paper.items
        for part in item.parts
    ]
    return table(["the paper's", "what", "here", "is it here", "what is missing, and why"], rows, text_columns=5)


def heading(item: Item) -> str:
    """Return the title of an item's section."""
    return f"{item.place}: {item.title}"


def anchor(title: str) -> str:
    """Return the name by which links find a section's title, as GitHub makes it."""
    kept = (character for character in title.lower() if character.isalnum() or character in " -_")
    return "".join(kept).replace(" ", "-")


def _gaps(title: str, what: str, instead: str, gaps: tuple[Gap, ...]) -> Iterator[str]:
    if gaps:
        yield f"## {title}"
        rows = [[gap.place, gap.what, gap.instead] for gap in gaps]
        yield table(["place", what, instead], rows, text_columns=3)


def errata_table(paper: Paper) -> str:
    """Return a table of a paper's misprints and contradictions in words."""
    return _errata_table(paper.errata)


def _errata_table(errata: tuple[Erratum, ...]) -> str:
    rows = [[erratum.place, erratum.printed, erratum.right, erratum.found] for erratum in errata]
    return table(["place", "printed", "right", "how it was found"], rows, text_columns=4)


def summary(paper: EvaluatedPaper) -> tuple[str, ...]:
    """Return lines that count: parts, numbers by their kinds, and misprints beside what is open and lost."""
    parts = paper.paper.parts
    answers = ", ".join(f"{sum(part.answer is answer for part in parts)} {answer}" for answer in Coverage)
    counts = {kind: [one.agrees for one in paper.values if one.value.kind is kind] for kind in Basis}
    proven = sum(proof.proven for proof in paper.proofs)
    return (
        f"Items of the paper: {len(parts)}; found here: {answers}.",
        f"Results of the paper that the twin reproduces: {sum(map(bool, counts[Basis.RESULT]))} of"
        f" {len(counts[Basis.RESULT])}. Dimensions taken over: {len(counts[Basis.DIMENSION])}. Self-checks that hold:"
        f" {sum(map(bool, counts[Basis.CHECK]))} of {len(counts[Basis.CHECK])}.",
        f"Misprints and contradictions of the paper: {len(paper.paper.errata)}; quantities computed as printed and as"
        f" corrected: {len(paper.proofs)}; where only the corrected one is right: {proven}. Left open by the paper:"
        f" {len(paper.paper.left_open)}. Lost in our copy: {len(paper.paper.lost)}.",
    )


def _item(item: EvaluatedItem, robot: str, *, with_pictures: bool) -> Iterator[str]:
    yield f"## {heading(item.item)}"
    yield item.item.text
    yield from _values(item)
    for listing, rows in zip(item.item.listings, item.listings, strict=True):
        yield f"{listing.title}:"
        yield table(listing.columns, rows, text_columns=listing.text_columns)
    if item.item.errata:
        yield "Misprints and contradictions of the paper here:"
        yield _errata_table(item.item.errata)
    if item.proofs:
        columns = ["computed", "compared with", "as printed", "as corrected", "has to be"]
        yield table(columns, [_proof(proof) for proof in item.proofs], text_columns=2)
    if with_pictures:
        for picture in item.item.pictures:
            yield f"![{picture.place}: {picture.caption}]({picture_name(robot, picture)})"


def _values(item: EvaluatedItem) -> Iterator[str]:
    """Yield a table for each kind of value that the item has."""
    for kind, columns in _COLUMNS.items():
        found = [_cells(one) for one in item.values if one.value.kind is kind]
        if found:
            rows = [[cells[name] for name in columns.values()] for cells in found]
            yield table(list(columns), rows, text_columns=2 if "place" in columns else 1)


def _cells(one: Compared) -> dict[str, str]:
    value, unit = one.value, _unit(one.value.unit)
    return {
        "what": value.what,
        "place": value.place if value.source is Source.STATED else f"{value.place} ({value.source})",
        "has": f"{nan if value.expected is None else value.expected:.12g}{unit}",
        "ours": f"{number_text(one.ours, value.decimals)}{unit}",
        "difference": number_text(nan if one.difference is None else one.difference, value.decimals),
        "tolerance": f"{value.tolerance:g}",
        "agrees": "yes" if one.agrees else "NO",
    }


def _unit(unit: str) -> str:
    return f" {unit}" if unit else ""


def _proof(proof: Proof) -> list[str]:
    formula = proof.formula
    numbers = [
        f"{number_text(number, formula.decimals)}{_unit(formula.unit) if isfinite(number) else ''}"
        for number in proof.numbers
    ]
    return [f"{proof.erratum.place}: {formula.what}", formula.truth_from, *numbers]


def number_text(number: float, decimals: int) -> str:
    """Return a number without a sign if it rounds to 0; a formula that has no value here has none."""
    return f"{number:z.{decimals}f}" if isfinite(number) else "no value"
