"""The command line `steptwin`: a folder for each group of `--help`; a module is imported when its command is called."""

from steptwin.host.cli.app import main

__all__ = ["main"]
