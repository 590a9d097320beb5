"""The command line `steptwin`: one file a command; a command imports heavy modules only when it runs."""

from importlib import import_module

from steptwin.host.cli.app import COMMANDS, main

__all__ = ["main"]

for _names in COMMANDS.values():
    for _name in _names:
        import_module(f"{__name__}.{_name.replace('-', '_')}")  # adds the command
