"""The command line `steptwin`: one file a command; heavy modules are imported when a command needs them."""

from host.cli import dbc, eds, fk, ik, jobs, plot, robots, run, serve, trace, verify, workspace
from host.cli.app import main

__all__ = ["dbc", "eds", "fk", "ik", "jobs", "main", "plot", "robots", "run", "serve", "trace", "verify", "workspace"]
