"""Fill hand-written pieces of a page: replace each line `<!-- generate: NAME ARGUMENT -->` by generated text."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

DOCS: Final = Path(__file__).resolve().parents[1]

_DIRECTIVE: Final = re.compile(r"^<!-- generate: (\S+)(?: (.*))? -->$", re.MULTILINE)


def filled(piece: Path, generators: Mapping[str, Callable[[str], str]]) -> str:
    """Return a piece with every directive replaced by its generator's text; raise KeyError for an unknown name."""
    text = piece.read_text(encoding="utf-8")
    return _DIRECTIVE.sub(lambda directive: generators[directive[1]](directive[2] or ""), text).strip()
