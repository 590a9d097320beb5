"""The command line `steptwin`: a room for each group of `--help`; a command imports heavy modules only when it runs."""

from importlib import import_module

from steptwin.host.cli.app import GROUPS, main

__all__ = ["main"]

for _group in GROUPS:
    for _name in _group.modules.split():
        import_module(f"{__name__}.{_group.room}.{_name}")  # adds its commands
