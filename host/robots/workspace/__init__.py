"""Workspaces: the positions that a tool reaches, as a random cloud and as sections with exact boundaries."""

from steptwin.host.robots.workspace.monte_carlo import SAMPLES_MAX, MonteCarlo, monte_carlo
from steptwin.host.robots.workspace.sections import Scan, has_sections, orientation_words, scan

__all__ = ["SAMPLES_MAX", "MonteCarlo", "Scan", "has_sections", "monte_carlo", "orientation_words", "scan"]
