"""Make docs/papers: a page for each paper, of a hand-written piece and the paper's numbers in docs/generate/papers.

What stands there as ours is computed by tests/features/papers, number by number.
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple

from docs.generate.arm_drawings import draw_link_frames
from docs.generate.commands import DOCS, filled, session
from docs.generate.drawing import write_picture
from docs.generate.markdown import table
from docs.generate.paper_results import results
from docs.generate.runs import Runs
from docs.generate.tables import dh_table
from steptwin.host.robots import load_robot

PAPERS_FOLDER: Final = DOCS / "papers"
_DATA: Final = DOCS / "generate" / "papers"
PAPERS: Final = ("lab-scara", "warehouse-scara", "teaching-scara", "calibration-scara", "hybrid-arm")
"""The robots of papers, in the order of docs/index.md."""
PICTURE_KINDS: Final = ("path", "joints", "error")
_TAKEN_OVER: Final = "taken over"
_OPEN: Final = "left open"
_MISPRINT: Final = "misprint: "


class PaperRow(NamedTuple):
    """A row of a page: an item, what the paper prints and where, ours, and a note; texts may be empty."""

    item: str
    printed: str
    place: str
    ours: str
    note: str


@dataclass(frozen=True, slots=True)
class Paper:
    """A paper's file: citation, text, the joints for the drawing of frames, the job, and the rows of the tables."""

    citation: str
    text: str
    frames: tuple[float, ...]
    job: str
    rows: tuple[PaperRow, ...]


def read_paper(robot: str) -> Paper:
    """Read the file of a robot's paper."""
    data = tomllib.loads((_DATA / f"{robot}.toml").read_text(encoding="utf-8"))
    rows = tuple(PaperRow(*row) for row in data["rows"])
    return Paper(data["citation"], data["text"], tuple(data["frames"]), data["job"], rows)


def render_paper(robot: str, runs: Runs) -> str:
    """Return a page; it ends with a newline."""
    paper = read_paper(robot)
    notice = f"<!-- Made by `make docs` from {robot}.md and {robot}.toml in docs/generate/papers: change those. -->"
    page = filled(
        _DATA / f"{robot}.md",
        {
            "citation": lambda _: f"> {paper.citation}".replace("\n", "\n> "),
            "text": lambda _: paper.text,
            "frames": lambda _: f"![The frames of its DH table]({robot}-frames.png)",
            "dh": lambda _: dh_table(load_robot(robot)),
            "numbers": lambda _: numbers(paper.rows),
            "misprints": lambda _: misprints(paper.rows),
            "open": lambda _: left_open(paper.rows),
            "steptwin": session,
            "results": lambda job: results(runs.outcome(robot, job)),
            "pictures": lambda job: _pictures(robot, job),
        },
    )
    return f"{notice}\n\n{page}\n"


def numbers(rows: Sequence[PaperRow]) -> str:
    """Return the numbers that the robot's file takes over in a sentence, and a table of those that are computed."""
    taken = [f"{row.item} {row.printed} ({row.place})" for row in rows if row.note == _TAKEN_OVER]
    computed = [
        [row.item, _printed(row), f"{row.ours}, {row.note}" if row.note else row.ours]
        for row in rows
        if row.note not in (_TAKEN_OVER, _OPEN) and not row.note.startswith(_MISPRINT)
    ]
    rows_below = table(["number", "printed (place)", "ours"], computed, text_columns=3)
    return f"Taken over: {'; '.join(taken)}.\n\n{rows_below}"


def misprints(rows: Sequence[PaperRow]) -> str:
    """Return a table of what is printed and what is right."""
    lines = [
        [row.item, _printed(row), row.ours, row.note.removeprefix(_MISPRINT)]
        for row in rows
        if row.note.startswith(_MISPRINT)
    ]
    return table(["place", "printed", "right", "because"], lines, text_columns=4)


def left_open(rows: Sequence[PaperRow]) -> str:
    """Return a list of what the paper does not say, each with our choice."""
    return "\n".join(f"- {row.item} ({row.place}): {row.ours}" for row in rows if row.note == _OPEN)


def _printed(row: PaperRow) -> str:
    place = f"({row.place})" if row.place else ""
    return " ".join(filter(None, (row.printed, place))) or "-"


def picture(robot: str, job: str, kind: str) -> str:
    """Return the path of a run's picture, relative to the folder docs."""
    return f"pictures/{robot}-{job}-{kind}.png"


def _pictures(robot: str, job: str) -> str:
    """Show the tool's path and link the other pictures."""
    path, joints, error = (f"../{picture(robot, job, kind)}" for kind in PICTURE_KINDS)
    return (
        f"![Tool path of {robot} {job}, planned and counted]({path})\n\n"
        f"Also: [planned joint motion]({joints}), [counted minus planned]({error})."
    )


def write_papers(runs: Runs) -> None:
    """Write all pages and their drawings of frames, and delete what no page shows any more."""
    written = set()
    for robot in PAPERS:
        (PAPERS_FOLDER / f"{robot}.md").write_text(render_paper(robot, runs), encoding="utf-8")
        draw = partial(draw_link_frames, load_robot(robot), read_paper(robot).frames)
        write_picture(PAPERS_FOLDER / f"{robot}-frames.png", draw)
        written |= {f"{robot}.md", f"{robot}-frames.png"}
    for path in PAPERS_FOLDER.iterdir():
        if path.name not in written:
            path.unlink()
