"""Hand-written pieces of a page: each line `<!-- generate: NAME ARGUMENT -->` is replaced by what it names."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

DOCS: Final = Path(__file__).resolve().parents[1]

_DIRECTIVE: Final = re.compile(r"^<!-- generate: (\S+)(?: (.*))? -->$", re.MULTILINE)


def filled(piece: Path, generators: Mapping[str, Callable[[str], str]]) -> str:
    """A piece with its directives carried out; KeyError for one that there is not."""
    text = piece.read_text(encoding="utf-8")
    return _DIRECTIVE.sub(lambda directive: generators[directive[1]](directive[2] or ""), text).strip()
