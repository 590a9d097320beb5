"""The papers of the five robots, figure by figure: each as data, with our numbers beside the paper's."""

from typing import Any, Final

from steptwin.host.common.bad_input import unknown
from steptwin.host.studies.papers import calibration, hybrid, lab, teaching, warehouse
from steptwin.host.studies.papers.evaluation import EvaluatedPaper, evaluated
from steptwin.host.studies.papers.paper import Paper
from steptwin.host.studies.papers.paper_folder import paper_files, write_paper
from steptwin.host.studies.papers.runs import Runs

__all__ = ["PAPERS", "EvaluatedPaper", "Paper", "Runs", "evaluated", "paper_files", "paper_of", "write_paper"]

PAPERS: Final[dict[str, Paper[Any]]] = {
    module.PAPER.robot: module.PAPER for module in (lab, warehouse, teaching, calibration, hybrid)
}
"""The papers by their robots' names."""


def paper_of(robot: str) -> Paper[Any]:
    """Return a robot's paper; raise InputError, with the nearest names, for a robot that has none."""
    if robot not in PAPERS:
        raise unknown("paper of robot", robot, PAPERS)
    return PAPERS[robot]
