"""Render docs/robots.md: the hand-written pieces in docs/robots/, filled from the robots' files and runs."""

from typing import Final

from docs.generate import tables
from docs.generate.commands import session
from docs.generate.pieces import DOCS, filled
from docs.generate.results import results
from docs.generate.runs import ROBOTS
from steptwin.host.papers import PAPERS
from steptwin.host.papers.page import errata_table
from steptwin.host.papers.runs import Runs
from steptwin.host.robots import load_robot

PAGE: Final = DOCS / "robots.md"
PICTURE_KINDS: Final = ("path", "joints", "error")

_NOTICE: Final = "<!-- Made by `make docs` from the pieces in docs/robots/: change those, not this file. -->"


def picture(robot: str, job: str, kind: str) -> str:
    """Return the path of a run's picture, relative to the page."""
    return f"pictures/{robot}-{job}-{kind}.png"


def render_page(runs: Runs) -> str:
    """Return the whole page; it ends with a newline."""
    pieces = [_NOTICE, _introduction(), *(_robot(name, runs) for name in ROBOTS)]
    return "\n\n".join(pieces) + "\n"


def _introduction() -> str:
    return filled(DOCS / "robots" / "introduction.md", {"board": lambda _: tables.board()})


def _robot(name: str, runs: Runs) -> str:
    robot = load_robot(name)
    return filled(
        DOCS / "robots" / f"{name}.md",
        {
            "dimensions": lambda _: tables.dimensions(robot),
            "dh": lambda _: tables.dh_table(robot),
            "joints": lambda _: tables.joints(robot),
            "outputs": lambda _: tables.outputs(robot),
            "inputs": lambda _: tables.inputs(robot),
            "places": lambda _: tables.places(robot),
            "steptwin": session,
            "options": lambda job: tables.options(robot, job),
            "results": lambda job: results(runs.outcome(name, job)),
            "errata": lambda _: errata_table(PAPERS[name]),
            "pictures": lambda job: _pictures(name, job),
        },
    )


def _pictures(robot: str, job: str) -> str:
    """Show the tool's path on the page and link the other pictures."""
    path, joints, error = (picture(robot, job, kind) for kind in PICTURE_KINDS)
    return (
        f"![Tool path of {robot} {job}, planned and counted]({path})\n\n"
        f"Also: [planned joint motion]({joints}), [counted minus planned]({error})."
    )
