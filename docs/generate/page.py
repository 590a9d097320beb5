"""The page: hand-written pieces from docs/robots/, each line `<!-- generate: ... -->` replaced by what it names."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Final

from docs.generate import tables
from docs.generate.commands import session
from docs.generate.results import results
from docs.generate.runs import ROBOTS, Runs
from host.robots import load_robot

DOCS: Final = Path(__file__).resolve().parents[1]
PAGE: Final = DOCS / "robots.md"
PICTURE_KINDS: Final = ("path", "joints", "error")

_NOTICE: Final = "<!-- Made by `make docs` from the pieces in docs/robots/: change those, not this file. -->"
_DIRECTIVE: Final = re.compile(r"^<!-- generate: (\S+)(?: (.*))? -->$", re.MULTILINE)


def picture(robot: str, job: str, kind: str) -> str:
    """Where a picture of a run is, seen from the page."""
    return f"pictures/{robot}-{job}-{kind}.png"


def render_page(runs: Runs) -> str:
    """The whole page; it ends with a newline."""
    pieces = [_NOTICE, _introduction(), *(_robot(name, runs) for name in ROBOTS)]
    return "\n\n".join(piece.strip() for piece in pieces) + "\n"


def _introduction() -> str:
    return _filled(DOCS / "robots" / "introduction.md", {"board": lambda _: tables.board()})


def _robot(name: str, runs: Runs) -> str:
    robot = load_robot(name)
    return _filled(
        DOCS / "robots" / f"{name}.md",
        {
            "dimensions": lambda _: tables.dimensions(robot),
            "dh": lambda _: tables.dh_table(robot),
            "joints": lambda _: tables.joints(robot),
            "outputs": lambda _: tables.outputs(robot),
            "places": lambda _: tables.places(robot),
            "steptwin": session,
            "options": lambda job: tables.options(robot, job),
            "results": lambda job: results(runs.outcome(name, job)),
            "pictures": lambda job: _pictures(name, job),
        },
    )


def _filled(piece: Path, generators: dict[str, Callable[[str], str]]) -> str:
    """A piece with its directives carried out; KeyError for one that there is not."""
    text = piece.read_text(encoding="utf-8")
    return _DIRECTIVE.sub(lambda directive: generators[directive[1]](directive[2] or ""), text)


def _pictures(robot: str, job: str) -> str:
    """The tool's path on the page, the others behind links."""
    path, joints, error = (picture(robot, job, kind) for kind in PICTURE_KINDS)
    return (
        f"![Tool path of {robot} {job}, planned and counted]({path})\n\n"
        f"Also: [planned joint motion]({joints}), [counted minus planned]({error})."
    )
