"""The papers of the five robots, figure by figure: each as data, with our numbers beside the paper's."""

from typing import Final

from steptwin.host.common.bad_input import unknown
from steptwin.host.studies.papers.calibration import CalibrationStudy
from steptwin.host.studies.papers.evaluation import EvaluatedPaper, evaluated
from steptwin.host.studies.papers.hybrid import HybridStudy
from steptwin.host.studies.papers.lab import LabStudy
from steptwin.host.studies.papers.paper import Paper
from steptwin.host.studies.papers.paper_file import load_paper
from steptwin.host.studies.papers.paper_folder import paper_files, write_paper
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


def paper_of(robot: str) -> Paper:
    """Return a robot's paper; raise InputError, with the nearest names, for a robot that has none."""
    if robot not in PAPERS:
        raise unknown("paper of robot", robot, PAPERS)
    return PAPERS[robot]
