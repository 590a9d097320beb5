"""Write the folder of a paper: the page in Markdown, its pictures, and all of it in one HTML file."""

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from steptwin.host.common.whole_file import whole_file
from steptwin.host.papers.evaluation import EvaluatedPaper
from steptwin.host.papers.html import to_html
from steptwin.host.papers.page import html_name, page_name, render_page
from steptwin.host.papers.runs import Runs


def write_paper(folder: Path, paper: EvaluatedPaper, runs: Runs) -> bool:
    """Write page, pictures and HTML file into a folder that exists; return False if matplotlib is not installed.

    Then the page has no pictures. Files of other papers in the folder stay.
    """
    pictures = pictures_of(paper, runs)
    markdown = render_page(paper, with_pictures=pictures is not None)
    robot = paper.paper.robot
    write_page(folder, robot, markdown, pictures or {})
    with whole_file(folder / html_name(robot)) as file:
        file.write(to_html(markdown, f"The paper of {robot}, figure by figure", pictures or {}).encode())
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
    from steptwin.host.papers.drawing import draw_pictures

    return draw_pictures(paper, runs)
