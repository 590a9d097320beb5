"""Fill hand-written pages with generated tables, and with commands of `steptwin` and their output."""

import re
import shlex
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Final

from docs.generate.markdown import code
from steptwin.host.cli.app import run

DOCS: Final = Path(__file__).resolve().parents[1]

_DIRECTIVE: Final = re.compile(r"^<!-- generate: (\S+)(?: (.*))? -->$", re.MULTILINE)


def filled(piece: Path, generators: Mapping[str, Callable[[str], str]]) -> str:
    """Return a piece with every directive replaced by its generator's text; raise KeyError for an unknown name."""
    text = piece.read_text(encoding="utf-8")
    return _DIRECTIVE.sub(lambda directive: generators[directive[1]](directive[2] or ""), text).strip()


@dataclass(frozen=True)
class GeneratedPage:
    """A page that is made of a hand-written piece, docs/NAME/NAME.md, and generators of its tables.

    Attributes:
        name: name of the page.
        tables: where the generators' figures come from, in words.
        generators: functions that make the text of each directive, from the directive's own words.
    """

    name: str
    tables: str
    generators: Mapping[str, Callable[[str], str]]

    @property
    def path(self) -> Path:
        """The page's file."""
        return DOCS / f"{self.name}.md"

    def render(self) -> str:
        """Return the whole page; it ends with a newline."""
        piece = f"{self.name}/{self.name}.md"
        notice = f"<!-- Made by `make docs` from docs/{piece} and {self.tables}: change those. -->"
        return f"{notice}\n\n{filled(DOCS / piece, self.generators)}\n"

    def write(self) -> None:
        """Write the page."""
        self.path.write_text(self.render(), encoding="utf-8")


_STYLE: Final = re.compile(r"\x1b\[[0-9;]*m")
"""Terminal colours and bold type, which the environment may force even without a terminal."""


def session(arguments: str, expected_exit_code: int = 0) -> str:
    """Run a command; return the command line and its output as one block, without the line about wall time.

    Raises:
        ValueError: the command ends with another exit code than expected.
    """
    printed = StringIO()
    with redirect_stdout(printed):
        exit_code = run(shlex.split(arguments))
    if exit_code != expected_exit_code:
        raise ValueError(f"steptwin {arguments}: exit code {exit_code}")
    lines = (line.rstrip() for line in _STYLE.sub("", printed.getvalue()).splitlines())
    return code("\n".join([f"$ steptwin {arguments}", *(line for line in lines if "x real time" not in line)]))
