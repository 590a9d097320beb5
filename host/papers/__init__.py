"""The papers of the five robots, figure by figure: each as data, with our numbers beside the paper's."""

from typing import Any, Final

from steptwin.host.common.bad_input import unknown
from steptwin.host.papers import calibration, hybrid, lab, teaching, warehouse
from steptwin.host.papers.evaluation import EvaluatedPaper, evaluated
from steptwin.host.papers.paper import Paper
from steptwin.host.papers.runs import Runs
from steptwin.host.papers.writing import write_paper

__all__ = ["PAPERS", "EvaluatedPaper", "Paper", "Runs", "evaluated", "paper_of", "write_paper"]

PAPERS: Final[dict[str, Paper[Any]]] = {
    module.PAPER.robot: module.PAPER for module in (lab, warehouse, teaching, calibration, hybrid)
}
"""The papers by their robots' names."""


def paper_of(robot: str) -> Paper[Any]:
    """Return a robot's paper; raise InputError, with the nearest names, for a robot that has none."""
    if robot not in PAPERS:
        raise unknown("paper of robot", robot, PAPERS)
    return PAPERS[robot]
