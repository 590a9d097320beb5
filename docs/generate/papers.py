"""Write docs/papers: the page of each paper with its pictures, as `steptwin paper` writes them."""

from typing import Final

from docs.generate.commands import DOCS
from steptwin.host.studies.papers import PAPERS, evaluated
from steptwin.host.studies.papers.drawing import draw_pictures
from steptwin.host.studies.papers.paper_folder import write_page
from steptwin.host.studies.papers.paper_page import page_name, render_page
from steptwin.host.studies.papers.runs import Runs

PAPERS_FOLDER: Final = DOCS / "papers"


def write_papers(runs: Runs) -> None:
    """Write all pages; delete the pictures that no page shows any more."""
    PAPERS_FOLDER.mkdir(exist_ok=True)
    drawn = set()
    for name, paper in PAPERS.items():
        page = evaluated(paper, runs)
        pictures = draw_pictures(page, runs)
        write_page(PAPERS_FOLDER, name, render_page(page), pictures)
        drawn |= {page_name(name), *pictures}
    for path in PAPERS_FOLDER.iterdir():
        if path.name not in drawn:
            path.unlink()
