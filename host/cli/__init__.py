"""The command line `steptwin`: one file a command; heavy modules are imported when a command needs them."""

from host.cli import eds, fk, ik, jobs, robots, run, workspace
from host.cli.app import main

__all__ = ["eds", "fk", "ik", "jobs", "main", "robots", "run", "workspace"]
