"""Render docs/gcode.md: what is done with each word of G-code in each dialect."""

from typing import Final

from docs.generate.commands import GeneratedPage
from docs.generate.markdown import table
from steptwin.features.gcode.dialects import MANNERS, WORDS, Use, Word

_MARKS: Final = {Use.APPLY: "yes", Use.IGNORE: "ignored", Use.NOTE: "told", Use.REFUSE: "-", Use.UNKNOWN: "-"}


def _words() -> str:
    names = [manners.name or "without" for manners in MANNERS.values()]
    rows = [[", ".join(f"`{code}`" for code in word.codes.split()), *_marks(word), word.why] for word in WORDS]
    return table(["words", *names, "why"], rows, text_columns=len(names) + 2)


def _marks(word: Word) -> list[str]:
    """Return the mark in each dialect; a printer ignores an M word that it does not know."""
    ignores = [manners.one_command and word.codes.startswith("M") for manners in MANNERS.values()]
    uses = [Use(use) for use in word.uses]
    return [
        "ignored" if use is Use.UNKNOWN and ignored else _MARKS[use] for use, ignored in zip(uses, ignores, strict=True)
    ]


GCODE_PAGE: Final = GeneratedPage("gcode", "the table in features/gcode/dialects.py", {"words": lambda _: _words()})
