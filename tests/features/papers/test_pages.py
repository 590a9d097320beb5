"""A page a paper, made of its file; what it shows is there."""

import re

import pytest

from docs.generate.paper_pages import PAPERS, PAPERS_FOLDER, left_open, misprints, numbers, read_paper
from steptwin.host.planning.jobs import job_names
from steptwin.host.robots import MACHINES, load_robot, robot_names

WORDS_MAX = 1200


@pytest.mark.parametrize("robot", PAPERS)
def test_a_page(robot: str) -> None:
    """tests/end_to_end/test_docs.py renders the whole pages, with their runs."""
    page = (PAPERS_FOLDER / f"{robot}.md").read_text(encoding="utf-8")
    rows = read_paper(robot).rows
    assert all(part(rows) in page for part in (numbers, misprints, left_open)), "run `make docs`"
    assert sum(any(map(str.isalnum, word)) for word in page.split()) <= WORDS_MAX
    assert all((PAPERS_FOLDER / picture).exists() for picture in re.findall(r"\]\(([^)]+\.png)\)", page))


@pytest.mark.parametrize("robot", PAPERS)
def test_the_file_of_a_paper(robot: str) -> None:
    """Items are named once; the job exists; what is the paper's has its place there, or the item is the place."""
    paper = read_paper(robot)
    assert len({row.item for row in paper.rows}) == len(paper.rows)
    assert paper.job in job_names(load_robot(robot))
    place = re.compile(r"(abstract|introduction|parameter text|text|sects?\. \d|(tables?|figs?\.|eqs?\.) \d)")
    for row in paper.rows:
        assert bool(row.place) is bool((row.printed and not row.note.startswith("misprint")) or row.note == "left open")
        if row.printed:
            assert place.match(row.place or row.item), row.item


def test_every_robot_of_a_paper_has_its_page_and_there_is_no_other_file() -> None:
    assert set(PAPERS) == set(robot_names()) - set(MACHINES)
    files = {f"{robot}{end}" for robot in PAPERS for end in (".md", "-frames.png")}
    assert {path.name for path in PAPERS_FOLDER.iterdir()} == files
