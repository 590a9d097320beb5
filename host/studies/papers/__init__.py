"""The papers of the five robots, figure by figure: each as data, with our numbers beside the paper's.

A paper's folder has the page in Markdown, its pictures, and all of it in one HTML file.
"""

from base64 import b64encode
from collections.abc import Mapping
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from markdown_it import MarkdownIt
from markdown_it.token import Token

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.whole_file import whole_file
from steptwin.host.studies.papers.calibration import CalibrationStudy
from steptwin.host.studies.papers.evaluation import EvaluatedPaper, evaluated
from steptwin.host.studies.papers.hybrid import HybridStudy
from steptwin.host.studies.papers.lab import LabStudy
from steptwin.host.studies.papers.paper import Paper
from steptwin.host.studies.papers.paper_file import load_paper
from steptwin.host.studies.papers.paper_page import anchor, html_name, page_name, picture_name, render_page
from steptwin.host.studies.papers.study import Runs
from steptwin.host.studies.papers.teaching import TeachingStudy
from steptwin.host.studies.papers.warehouse import WarehouseStudy

__all__ = ["PAPERS", "EvaluatedPaper", "Paper", "Runs", "evaluated", "paper_files", "paper_of", "write_paper"]

PAPERS: Final[dict[str, Paper]] = {
    study.robot_name: load_paper(file, study)
    for file, study in (
        ("lab", LabStudy),
        ("warehouse", WarehouseStudy),
        ("teaching", TeachingStudy),
        ("calibration", CalibrationStudy),
        ("hybrid", HybridStudy),
    )
}
"""The papers by their robots' names."""
_STYLE: Final = """\
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; max-width: 62rem; margin: 2rem auto; padding: 0 1rem }
h1, h2 { line-height: 1.25 }
h2 { margin-top: 2.5rem; border-bottom: 1px solid #ccc }
table { border-collapse: collapse; margin: 1rem 0; font-size: 0.9rem; display: block; overflow-x: auto }
th, td { border: 1px solid #ccc; padding: 0.25rem 0.6rem; vertical-align: top }
th { background: #f2f2f2 }
td { font-variant-numeric: tabular-nums }
td[style*="right"] { white-space: nowrap }
blockquote { margin-left: 0; padding-left: 1rem; border-left: 4px solid #ccc }
pre { background: #f6f6f6; padding: 0.8rem; overflow-x: auto }
img { max-width: 100% }
"""

_PAGE: Final = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
{body}</body>
</html>
"""


def paper_of(robot: str) -> Paper:
    """Return a robot's paper; raise InputError, with the nearest names, for a robot that has none."""
    if robot not in PAPERS:
        raise unknown("paper of robot", robot, PAPERS)
    return PAPERS[robot]


def to_html(markdown: str, title: str, pictures: Mapping[str, bytes]) -> str:
    """Return the page as HTML, with each PNG, by its name in the Markdown, inside; raise KeyError for one not given."""
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = parser.parse(_without_notice(markdown))
    for token, after in zip(tokens, [*tokens[1:], None], strict=True):
        _embed(token, pictures)
        if token.type == "heading_open" and after is not None:
            token.attrs["id"] = anchor(after.content)
    body = parser.renderer.render(tokens, parser.options, {})
    return _PAGE.format(title=escape(title), style=_STYLE, body=body)


def _embed(token: Token, pictures: Mapping[str, bytes]) -> None:
    """Put each picture in place of its name, in a token and those within it."""
    if token.type == "image":
        token.attrs["src"] = f"data:image/png;base64,{b64encode(pictures[str(token.attrs['src'])]).decode()}"
    for child in token.children or ():
        _embed(child, pictures)


def _without_notice(markdown: str) -> str:
    """Return the page without the comment at its beginning: as HTML is not let through, it would be shown."""
    notice, _, page = markdown.partition("\n")
    return page if notice.startswith("<!--") else markdown


def paper_files(paper: Paper) -> list[str]:
    """Return the names of all files of a paper's folder."""
    robot, pictures = paper.robot, [picture for item in paper.items for picture in item.pictures]
    return [page_name(robot), html_name(robot), *(picture_name(robot, picture) for picture in pictures)]


def write_paper(folder: Path, paper: EvaluatedPaper, runs: Runs) -> bool:
    """Write page, pictures and HTML file into a folder that exists; return False if matplotlib is not installed.

    Then the page has no pictures. Files of other papers in the folder stay.
    """
    pictures = pictures_of(paper, runs)
    markdown = render_page(paper, with_pictures=pictures is not None)
    robot = paper.paper.robot
    write_page(folder, robot, markdown, pictures or {})
    with whole_file(folder / html_name(robot)) as file:
        file.write(to_html(markdown, f"The paper of {robot}, item by item", pictures or {}).encode())
    return pictures is not None


def write_page(folder: Path, robot: str, markdown: str, pictures: Mapping[str, bytes]) -> None:
    """Write the page in Markdown and its pictures."""
    for name, picture in pictures.items():
        with whole_file(folder / name) as file:
            file.write(picture)
    with whole_file(folder / page_name(robot)) as file:
        file.write(markdown.encode())


def pictures_of(paper: EvaluatedPaper, runs: Runs) -> dict[str, bytes] | None:
    """Return the pictures by the names of their files; None if matplotlib is not installed."""
    if not find_spec("matplotlib"):
        return None
    from steptwin.host.studies.papers.drawing import draw_pictures

    return draw_pictures(paper, runs)
