"""Render docs/programs.md: its table of G-code words says what each dialect does with them."""

from typing import Final

from docs.generate.commands import GeneratedPage
from docs.generate.markdown import table
from steptwin.features.gcode.dialects import MANNERS, WORDS, Use, Word

_MARKS: Final = {Use.APPLY: "yes", Use.IGNORE: "ignored", Use.NOTE: "noted", Use.REFUSE: "-", Use.UNKNOWN: "-"}


def _words() -> str:
    """Return the table; words with equal marks and reasons share a row."""
    names = [manners.name or "none" for manners in MANNERS.values()]
    rows: dict[tuple[str, ...], list[str]] = {}
    for word in WORDS:
        codes = (f"`{code}`" for code in word.codes.split())
        rows.setdefault((*_marks(word), word.why), []).extend(codes)
    lines = [[", ".join(codes), *cells] for cells, codes in rows.items()]
    return table(["words", *names, "why"], lines, text_columns=len(names) + 2)


def _marks(word: Word) -> list[str]:
    """Return the mark in each dialect; a printer ignores an M word that it does not know."""
    ignores = [manners.one_command and word.codes.startswith("M") for manners in MANNERS.values()]
    uses = [Use(use) for use in word.uses]
    return [
        "ignored" if use is Use.UNKNOWN and ignored else _MARKS[use] for use, ignored in zip(uses, ignores, strict=True)
    ]


PROGRAMS_PAGE: Final = GeneratedPage(
    "programs", "the table in features/gcode/dialects.py", {"words": lambda _: _words()}
)
