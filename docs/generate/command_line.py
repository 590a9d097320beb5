"""Make docs/command-line.md: every command with its arguments and options, from the command line itself."""

import re
from typing import Any, Final

import typer
from typer.core import TyperArgument

from docs.generate.commands import DOCS
from docs.generate.markdown import code, table
from steptwin.host.cli.app import CliCommand, command_named, program
from steptwin.host.cli.commands import command_table

COMMAND_LINE_PAGE: Final = DOCS / "command-line.md"
_HEAD: Final = """<!-- Made by `make docs` from the commands in host/cli: change those. -->

# The command line

All commands with their options, as `--help` prints them. [first-run.md](first-run.md) uses some.
Exit codes: 0 is done and right, 1 not as it should be, 2 bad input, 3 stopped by a fault, 130 interrupted."""
_MARK: Final = re.compile(r"([<>*_])")


def render_command_line() -> str:
    """Return the whole page; it ends with a newline."""
    context = typer.Context(program(), info_name="steptwin")
    pieces = [_HEAD]
    title = ""
    for name, row in command_table().items():
        command = command_named(name)
        if row.group != title:
            title = row.group
            pieces.append(f"## {title}")
        pieces.append(_command(command, typer.Context(command, parent=context, info_name=name)))
    return "\n\n".join(pieces) + "\n"


def _command(command: CliCommand, context: Any) -> str:
    """Return the section of a command: what it does, its usage, its parameters, its examples."""
    shown = [each for each in command.get_params(context) if not getattr(each, "hidden", False)]
    rows = [_row(each, context) for each in shown if not (isinstance(each, TyperArgument) and not each.help)]
    usage = command.get_usage(context).removeprefix("Usage: ")
    return "\n\n".join(
        [
            f"### `steptwin {command.name}`",
            _MARK.sub(r"\\\1", "\n\n".join(command.paragraphs)),
            code(" ".join(usage.split())),
            table(["", "means"], rows, text_columns=2),
            code("\n".join(command.examples)),
        ]
    )


def _row(parameter: Any, context: Any) -> list[str]:
    """Return the names of an argument or option with the word for its value, and what it means."""
    record = parameter.get_help_record(context)
    if isinstance(parameter, TyperArgument):
        names = f"`{parameter.display_name_raw}`"
    else:
        word = f" {parameter.metavar}" if parameter.metavar else ""
        names = ", ".join(f"`{name}{word}`" for name in sorted(parameter.opts, key=len, reverse=True))
    return [names, _MARK.sub(r"\\\1", record[1] if record else "")]
