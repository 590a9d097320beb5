"""Workspaces: the positions that a tool reaches, as a random cloud and as sections with exact boundaries."""

from steptwin.host.robots.workspace.arm import ATTITUDES
from steptwin.host.robots.workspace.monte_carlo import SAMPLES_MAX, MonteCarlo, monte_carlo
from steptwin.host.robots.workspace.sections import PlanSection, ProfileSection, Scan, scan

__all__ = ["ATTITUDES", "SAMPLES_MAX", "MonteCarlo", "PlanSection", "ProfileSection", "Scan", "monte_carlo", "scan"]
