"""Make docs/papers: a page a paper, with one table of its numbers beside ours, of the files in docs/generate/papers.

What stands there as ours is computed by tests/features/papers, number by number.
"""

import tomllib
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple

from docs.generate.arm_drawings import draw_link_frames
from docs.generate.commands import DOCS
from docs.generate.drawing import write_picture
from docs.generate.markdown import table
from steptwin.host.robots import load_robot

PAPERS_FOLDER: Final = DOCS / "papers"
_DATA: Final = DOCS / "generate" / "papers"
PAPERS: Final = ("lab-scara", "warehouse-scara", "teaching-scara", "calibration-scara", "hybrid-arm")
"""The robots of papers, in the order of docs/robots.md."""


class PaperRow(NamedTuple):
    """A row of a page: an item, what the paper prints and where, ours, and a note; texts may be empty."""

    item: str
    printed: str
    place: str
    ours: str
    note: str


@dataclass(frozen=True, slots=True)
class Paper:
    """A paper's file: citation, text, the joints for the drawing of frames, the job, and the rows of the table."""

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


def render_paper(robot: str) -> str:
    """Return a page; it ends with a newline."""
    paper = read_paper(robot)
    rows = [[row.item, _printed(row), row.ours, row.note] for row in paper.rows]
    blocks = [
        f"<!-- Made by `make docs` from docs/generate/papers/{robot}.toml: change that. -->",
        f"# The paper of {robot}",
        f"> {paper.citation}".replace("\n", "\n> "),
        paper.text,
        f"![The frames of its DH table]({robot}-frames.png)",
        table(["item", "printed (place)", "ours", "note"], rows, text_columns=4),
        f"![Tool path of {paper.job}, planned and counted](../pictures/{robot}-{paper.job}-path.png)",
    ]
    return "\n\n".join(blocks) + "\n"


def _printed(row: PaperRow) -> str:
    place = f"({row.place})" if row.place else ""
    return " ".join(filter(None, (row.printed, place))) or "-"


def write_papers() -> None:
    """Write all pages and their pictures, and delete what no page shows any more."""
    written = set()
    for robot in PAPERS:
        (PAPERS_FOLDER / f"{robot}.md").write_text(render_paper(robot), encoding="utf-8")
        draw = partial(draw_link_frames, load_robot(robot), read_paper(robot).frames)
        write_picture(PAPERS_FOLDER / f"{robot}-frames.png", draw)
        written |= {f"{robot}.md", f"{robot}-frames.png"}
    for path in PAPERS_FOLDER.iterdir():
        if path.name not in written:
            path.unlink()
